//! What all points of a file hold together, which its header states.

use std::mem::{Discriminant, discriminant};

use autosplats_cloud::{Crs, Error, FieldValues, PointCloud};
use glam::{DMat4, DVec3};
use rayon::prelude::*;

use super::{Job, colors::WideColors};

/// Largest integer up to which `f64` holds all integers.
const MAX_EXACT_INTEGER: u64 = 1 << 53;

/// Facts about all clouds of a job, which have the same fields.
pub(super) struct Facts {
    /// A cloud without points, with the fields and the coordinate system of all.
    pub(super) like: PointCloud,
    pub(super) points: u64,
    /// Whether positions have an origin other than zero, and whether they have residuals.
    pub(super) origin: bool,
    pub(super) residuals: bool,
    wide: Option<WideColors>,
    colored: bool,
    fields: Vec<(String, Discriminant<FieldValues>)>,
    /// Names of the fields that have integers beyond 53 bits.
    pub(super) beyond: Vec<String>,
    pub(super) scans: bool,
    /// The pose of the sensor, if one sensor saw all points.
    pub(super) only_pose: Option<DMat4>,
}

impl Facts {
    /// Reads all points for what they hold.
    pub(super) fn of(job: &Job<'_>) -> Result<Self, Error> {
        let mut facts: Option<Self> = None;
        job.each(&mut |cloud| {
            let own = Self::of_cloud(cloud);
            match &mut facts {
                Some(facts) => facts.add(own, job)?,
                None => facts = Some(own),
            }
            Ok(())
        })?;
        Ok(facts.unwrap_or_else(|| Self::of_cloud(&PointCloud::default())))
    }

    fn of_cloud(cloud: &PointCloud) -> Self {
        let beyond = |values: &FieldValues| match values {
            FieldValues::U64(values) => values.par_iter().any(|&value| value > MAX_EXACT_INTEGER),
            FieldValues::I64(values) => values.par_iter().any(|&value| value.unsigned_abs() > MAX_EXACT_INTEGER),
            _ => false,
        };
        let fields = cloud.fields();
        Self {
            like: cloud.slice(0..0),
            points: cloud.len() as u64,
            origin: cloud.origin() != DVec3::ZERO,
            residuals: cloud.residuals().is_some(),
            wide: WideColors::of(cloud),
            colored: cloud.colors().is_some(),
            fields: fields.iter().map(|field| (field.name.clone(), discriminant(&field.values))).collect(),
            beyond: fields.iter().filter(|field| beyond(&field.values)).map(|field| field.name.clone()).collect(),
            scans: !cloud.scans().is_empty(),
            only_pose: match cloud.scans() {
                [scan] if scan.points == (0..cloud.len()) => Some(scan.world_from_sensor),
                _ => None,
            },
        }
    }

    fn add(&mut self, other: Self, job: &Job<'_>) -> Result<(), Error> {
        if (&self.fields, self.colored) != (&other.fields, other.colored) {
            let what = "its points do not all have the same values, so they cannot be read in parts";
            return Err(Error::unsupported(job.clouds.name(), what));
        }
        self.points += other.points;
        self.origin |= other.origin;
        self.residuals |= other.residuals;
        self.wide = self.wide.zip(other.wide).map(|(wide, other)| wide.and(other));
        let new: Vec<String> = other.beyond.into_iter().filter(|name| !self.beyond.contains(name)).collect();
        self.beyond.extend(new);
        self.scans |= other.scans;
        self.only_pose = self.only_pose.filter(|pose| other.only_pose == Some(*pose));
        Ok(())
    }

    /// Whether there is a coordinate system.
    pub(super) fn has_system(&self) -> bool {
        *self.like.crs() != Crs::default()
    }

    /// Whether the fields `Red`, `Green` and `Blue` are 16-bit integers.
    pub(super) fn are_short(&self) -> bool {
        self.wide.is_some_and(|wide| wide.are_short())
    }

    /// Whether the fields `Red`, `Green` and `Blue` are the colours, with more digits.
    pub(super) fn are_wide(&self) -> bool {
        self.wide.is_some_and(|wide| wide.are_colors())
    }
}

/// Notes that `format` cannot hold the sensors, the coordinate system and `others`, as far as the points have them.
pub(super) fn note_left_out(job: &Job<'_>, facts: &Facts, format: &str, others: &[(bool, &str)]) {
    let all = [(facts.scans, "the poses of the sensors"), (facts.has_system(), "the coordinate system")];
    let losses: Vec<&str> = all.iter().chain(others).filter(|(lost, _)| *lost).map(|(_, what)| *what).collect();
    if !losses.is_empty() {
        job.note(format!("{format} does not hold {}", losses.join(", ")));
    }
}
