//! What all points hold together, and the points of each scan, as far as it is known before they are written.

use std::ops::Range;

use autosplats_cloud::{Error, FieldValues, PointCloud, Scan, add_scans};
use glam::{DMat3, DMat4, DVec3};
use rayon::prelude::*;

use super::super::{Job, facts::Facts};

/// Facts about all points.
pub(super) struct CloudFacts {
    pub(super) all: Facts,
    /// Two opposite corners of a box around all points.
    pub(super) corners: PointCloud,
    /// Number of points without finite coordinates.
    pub(super) nowhere: usize,
    pub(super) scans: Vec<Scan>,
    /// Whether there are colours of 16 bits.
    pub(super) wide: bool,
    /// Whether [returns] are counted from 1.
    pub(super) counted: bool,
    /// Names of fields with integers [beyond] 63 bits.
    pub(super) beyond: Vec<String>,
}

impl CloudFacts {
    /// Reads all points.
    pub(super) fn of(job: &Job<'_>) -> Result<Self, Error> {
        let all = Facts::of(job)?;
        let (mut nowhere, mut scans, mut counted, mut beyond_63) = (0, Vec::new(), true, Vec::new());
        let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        let mut before = 0;
        job.each(&mut |cloud| {
            for (axis, (low, high)) in low.iter_mut().zip(&mut high).enumerate() {
                let along = cloud.positions().iter().map(|position| position[axis]);
                (*low, *high) = along.fold((*low, *high), |(low, high), at| (low.min(at), high.max(at)));
            }
            nowhere += cloud.positions().par_iter().filter(|position| !is_finite(position)).count();
            add_scans(&mut scans, cloud.scans(), before);
            counted &= returns(cloud);
            let fields = cloud.fields().iter().filter(|field| beyond(&field.values)).map(|field| field.name.clone());
            let new: Vec<String> = fields.filter(|name| !beyond_63.contains(name)).collect();
            beyond_63.extend(new);
            before += cloud.len();
            Ok(())
        })?;
        Ok(Self {
            corners: PointCloud::new(DVec3::ZERO, vec![low, high]),
            nowhere,
            scans,
            wide: all.are_wide() && all.are_short(),
            counted,
            beyond: beyond_63,
            all,
        })
    }

    /// A cloud without points, with the fields of all.
    pub(super) fn like(&self) -> &PointCloud {
        &self.all.like
    }

    /// Number of points.
    pub(super) fn len(&self) -> usize {
        self.all.points as usize
    }

    /// Whether positions are stored in 32 bits if they are in this frame.
    pub(super) fn single(&self, frame: Frame) -> bool {
        frame.is_world() && !self.all.origin && !self.all.residuals
    }
}

pub(super) fn is_finite(position: &[f32; 3]) -> bool {
    position.iter().all(|along| along.is_finite())
}

/// Whether some integers exceed 63 bits.
fn beyond(values: &FieldValues) -> bool {
    matches!(values, FieldValues::U64(values) if values.iter().any(|&value| i64::try_from(value).is_err()))
}

/// The values of the field of this name.
pub(super) fn named<'a>(cloud: &'a PointCloud, name: &str) -> Option<&'a FieldValues> {
    cloud.fields().iter().find(|field| field.name == name).map(|field| &field.values)
}

/// Whether returns are counted from 1, as they should be, so that E57's own elements can hold them.
fn returns(cloud: &PointCloud) -> bool {
    let whole = |values: &&FieldValues| !matches!(values, FieldValues::F32(_) | FieldValues::F64(_)) && !beyond(values);
    let number = named(cloud, "ReturnNumber").filter(whole);
    let counts = named(cloud, "NumberOfReturns").filter(whole);
    counts.is_some() && number.is_some_and(|number| (0..number.len()).all(|i| number.get(i) >= 1.0))
}

/// Pose of a scan: rotation and translation from the scan's frame to the world.
#[derive(Clone, Copy)]
pub(super) struct Frame {
    pub(super) rotation: DMat3,
    pub(super) translation: DVec3,
}

impl Frame {
    pub(super) const WORLD: Self = Self { rotation: DMat3::IDENTITY, translation: DVec3::ZERO };

    pub(super) fn is_world(self) -> bool {
        self.rotation == DMat3::IDENTITY && self.translation == DVec3::ZERO
    }

    pub(super) fn local(self, world: DVec3) -> DVec3 {
        if self.is_world() { world } else { self.rotation.transpose() * (world - self.translation) }
    }
}

/// Points that make a scan.
pub(super) struct Run {
    pub(super) name: Option<String>,
    pub(super) pose: Option<DMat4>,
    pub(super) len: usize,
    pub(super) facts: RunFacts,
}

impl Run {
    pub(super) fn frame(&self) -> Frame {
        self.pose.map_or(Frame::WORLD, |pose| {
            // The rotation as readers will compute it, from the quaternion.
            let rotation = DMat3::from_quat(glam::DQuat::from_mat4(&pose).normalize());
            Frame { rotation, translation: pose.w_axis.truncate() }
        })
    }
}

/// Facts about the points of a scan.
#[derive(Clone, Copy)]
pub(super) struct RunFacts {
    /// Corners of a box around the points, in the scan's frame.
    pub(super) bounds: [DVec3; 2],
    /// Least and greatest intensity.
    pub(super) intensity: [f64; 2],
    /// Whether all points have finite coordinates.
    pub(super) valid: bool,
}

impl RunFacts {
    const NONE: Self = Self {
        bounds: [DVec3::INFINITY, DVec3::NEG_INFINITY],
        intensity: [f64::INFINITY, f64::NEG_INFINITY],
        valid: true,
    };

    fn and(self, other: Self) -> Self {
        let ([low, high], [other_low, other_high]) = (self.bounds, other.bounds);
        let ([least, most], [other_least, other_most]) = (self.intensity, other.intensity);
        Self {
            bounds: [low.min(other_low), high.max(other_high)],
            intensity: [least.min(other_least), most.max(other_most)],
            valid: self.valid && other.valid,
        }
    }

    fn of(cloud: &PointCloud, points: Range<usize>, frame: Frame) -> Self {
        let intensity = named(cloud, "Intensity");
        let one = |i: usize| {
            let valid = is_finite(&cloud.positions()[i]);
            let value = intensity.map(|values| values.get(i)).filter(|value| value.is_finite());
            // Of zeros of both signs, that without is taken, whichever comes first.
            Self {
                bounds: if valid { [frame.local(cloud.world_position(i)) + 0.0; 2] } else { Self::NONE.bounds },
                intensity: value.map_or(Self::NONE.intensity, |value| [value + 0.0; 2]),
                valid,
            }
        };
        points.into_par_iter().map(one).reduce(|| Self::NONE, Self::and)
    }
}

/// The scans of a cloud, then the points outside of all scans; and where they lie.
pub(super) struct Runs {
    pub(super) runs: Vec<Run>,
    /// Points that follow each other, and the number of their scan. They come in the cloud's order and hold all points.
    pieces: Vec<(Range<usize>, usize)>,
    /// Number of the points outside of all scans, which are written last though they come anywhere.
    pub(super) outside: Option<usize>,
}

/// Gets a cloud, points of it, and the number of their scan.
type Take<'a> = dyn FnMut(&PointCloud, Range<usize>, usize) -> Result<(), Error> + 'a;

impl Runs {
    /// Divides the points, and reads them for what they hold.
    pub(super) fn of(job: &Job<'_>, known: &CloudFacts) -> Result<Self, Error> {
        let mut all = Self::divide(job, known);
        let frames: Vec<Frame> = all.runs.iter().map(Run::frame).collect();
        let mut found = vec![RunFacts::NONE; all.runs.len()];
        all.each(job, &mut |cloud, points, run| {
            found[run] = found[run].and(RunFacts::of(cloud, points, frames[run]));
            Ok(())
        })?;
        for (run, facts) in all.runs.iter_mut().zip(found) {
            run.facts = facts;
        }
        Ok(all)
    }

    fn divide(job: &Job<'_>, known: &CloudFacts) -> Self {
        let mut scans: Vec<&Scan> = known.scans.iter().collect();
        scans.sort_by_key(|scan| (scan.points.start, scan.points.end));
        let (mut runs, mut pieces) = (Vec::new(), Vec::new());
        let outside = scans.len();
        let mut left = 0;
        let mut end = 0;
        let (mut shared, mut bent) = (false, false);
        for scan in scans {
            if scan.points.start > end {
                pieces.push((end..scan.points.start, outside));
                left += scan.points.start - end;
            }
            let range = scan.points.start.max(end)..scan.points.end.max(end);
            shared |= range != scan.points && !scan.points.is_empty();
            end = range.end;
            let pose = rigid(scan.world_from_sensor);
            bent |= pose.is_none();
            let pose = pose.unwrap_or(DMat4::from_translation(scan.position()));
            let pose = if pose.is_finite() { pose } else { DMat4::IDENTITY };
            let (name, len) = (scan.name.clone(), range.len());
            pieces.push((range, runs.len()));
            runs.push(Run { name, pose: Some(pose), len, facts: RunFacts::NONE });
        }
        if end < known.len() {
            pieces.push((end..known.len(), outside));
            left += known.len() - end;
        }
        if shared {
            job.note("points that several scans share are written with the first of them");
        }
        if bent {
            job.note("poses that scale or mirror are written without rotation");
        }
        let outside = (left > 0 || runs.is_empty()).then_some(outside);
        if outside.is_some() {
            runs.push(Run { name: None, pose: None, len: left, facts: RunFacts::NONE });
        }
        pieces.retain(|(points, _)| !points.is_empty());
        Self { runs, pieces, outside }
    }

    /// Passes on all points in the cloud's order.
    pub(super) fn each(&self, job: &Job<'_>, take: &mut Take<'_>) -> Result<(), Error> {
        let mut before = 0;
        job.each(&mut |cloud| {
            let end = before + cloud.len();
            let first = self.pieces.partition_point(|(points, _)| points.end <= before);
            for (points, run) in self.pieces[first..].iter().take_while(|(points, _)| points.start < end) {
                take(cloud, points.start.max(before) - before..points.end.min(end) - before, *run)?;
            }
            before = end;
            Ok(())
        })
    }
}

/// The map, if it keeps lengths and does not mirror.
fn rigid(map: DMat4) -> Option<DMat4> {
    let turn = DMat3::from_mat4(map);
    let error = turn.transpose() * turn - DMat3::IDENTITY;
    let rotation = error.to_cols_array().iter().all(|value| value.abs() < 1e-6) && turn.determinant() > 0.0;
    (rotation && map.is_finite()).then_some(map)
}
