//! The points of a scan that have a position.

use autosplats_cloud::Error;
use glam::{DMat4, DVec3};
use rayon::prelude::*;

use super::{super::Job, packets::Values, xml::ScanHeader};

/// A scan's header and values.
pub(super) struct Source<'a> {
    pub(super) header: &'a ScanHeader,
    pub(super) values: Values,
    coordinates: Coordinates,
    pub(super) pose: DMat4,
    /// Index of the element that states which points have coordinates.
    state: Option<usize>,
    /// Indices of the points kept; `None` keeps all.
    keep: Option<Vec<u32>>,
    keep_invalid: bool,
}

/// Indices of the elements that make a position.
#[derive(Clone, Copy)]
enum Coordinates {
    Cartesian([usize; 3]),
    /// Range, azimuth and elevation.
    Spherical([usize; 3]),
}

impl<'a> Source<'a> {
    /// Finds the points of a scan that have a position, and counts the others in `dropped`.
    pub(super) fn new(
        job: &Job<'_>,
        header: &'a ScanHeader,
        values: Values,
        dropped: &mut Dropped,
    ) -> Result<Self, Error> {
        let cartesian = header.elements(["cartesianX", "cartesianY", "cartesianZ"]);
        let spherical = header.elements(["sphericalRange", "sphericalAzimuth", "sphericalElevation"]);
        let (coordinates, state) = match (cartesian, spherical) {
            (Some(elements), _) => (Coordinates::Cartesian(elements), "cartesianInvalidState"),
            (None, Some(elements)) => (Coordinates::Spherical(elements), "sphericalInvalidState"),
            (None, None) => {
                let what = "its points have neither x, y and z nor range, azimuth and elevation; write the file again";
                return Err(job.malformed("XML section", what));
            }
        };
        let mut source = Self {
            header,
            coordinates,
            pose: header.pose.unwrap_or(DMat4::IDENTITY),
            state: header.element(state),
            keep: None,
            keep_invalid: job.options.keep_no_returns,
            values,
        };
        if u32::try_from(source.values.count).is_err() {
            return Err(job.unsupported("more than 4 billion points in a scan; split it"));
        }
        if !job.options.keep_no_returns {
            source.keep = source.measured(dropped);
        }
        Ok(source)
    }

    /// Indices of the points with a position; `None` if all have one.
    fn measured(&self, dropped: &mut Dropped) -> Option<Vec<u32>> {
        let count = self.values.count as u32;
        let direction_only = |i: &u32| self.state(*i as usize) == 1;
        let invalid = |i: u32| self.state(i as usize) != 0;
        let at_scanner = |i: u32| !invalid(i) && self.is_scanner(i as usize);
        let [directions, without] = match self.state {
            None => [0; 2],
            Some(_) => [
                (0..count).into_par_iter().filter(direction_only).count(),
                (0..count).into_par_iter().filter(|&i| invalid(i)).count(),
            ],
        };
        let zeros = (0..count).into_par_iter().filter(|&i| at_scanner(i)).count();
        // A single point at the scanner may be real. If all points are there, the file means something else by it.
        let drop_zeros = zeros > 1 && zeros < count as usize - without;
        dropped.directions += directions;
        dropped.nothing += without - directions;
        dropped.at_scanner += if drop_zeros { zeros } else { 0 };
        dropped.kept_at_scanner += if drop_zeros || zeros < 2 { 0 } else { zeros };
        let keep = |i: &u32| !(invalid(*i) || drop_zeros && at_scanner(*i));
        (without > 0 || drop_zeros).then(|| (0..count).into_par_iter().filter(keep).collect())
    }

    /// Invalid state of a point: 0 for a position, 1 for a direction only, 2 for neither.
    fn state(&self, value: usize) -> i64 {
        self.state.map_or(0, |state| self.values.streams[state].integer(value))
    }

    /// Number of points kept.
    pub(super) fn len(&self) -> usize {
        self.keep.as_ref().map_or(self.values.count, Vec::len)
    }

    /// Index of a kept point among the scan's values.
    #[inline]
    pub(super) fn value_of(&self, point: usize) -> usize {
        self.keep.as_ref().map_or(point, |keep| keep[point] as usize)
    }

    /// Whether a position is the scanner's own.
    fn is_scanner(&self, value: usize) -> bool {
        let zero = |element: usize| self.values.streams[element].value(value) == 0.0;
        match self.coordinates {
            Coordinates::Cartesian(elements) => elements.into_iter().all(zero),
            Coordinates::Spherical([range, ..]) => zero(range),
        }
    }

    fn local(&self, value: usize) -> DVec3 {
        match self.coordinates {
            Coordinates::Cartesian(elements) => {
                DVec3::from(elements.map(|element| self.values.streams[element].value(value)))
            }
            Coordinates::Spherical(elements) => {
                let [range, azimuth, elevation] = elements.map(|element| self.values.streams[element].value(value));
                let (sin, cos) = elevation.sin_cos();
                range * DVec3::new(cos * azimuth.cos(), cos * azimuth.sin(), sin)
            }
        }
    }

    pub(super) fn world(&self, point: usize) -> DVec3 {
        let value = self.value_of(point);
        if self.keep_invalid && self.state(value) != 0 {
            return DVec3::NAN;
        }
        let local = self.local(value);
        if self.pose == DMat4::IDENTITY { local } else { self.pose.transform_point3(local) }
    }
}

/// Counts of the points without a position, over all scans.
#[derive(Default)]
pub(super) struct Dropped {
    directions: usize,
    nothing: usize,
    at_scanner: usize,
    /// Points at the scanner that are kept, because their scan has no others.
    kept_at_scanner: usize,
}

impl Dropped {
    pub(super) fn note(&self, job: &Job<'_>) {
        let counts = [
            (self.nothing, "points without a return are dropped"),
            (self.directions, "points of which only the direction is known are dropped"),
            (self.at_scanner, "points at the scanner's own place, where nothing was measured, are dropped"),
            (self.kept_at_scanner, "points lie at the scanner's own place, and their scan has no others"),
        ];
        for (count, what) in counts.iter().filter(|(count, _)| *count > 0) {
            job.note(format!("{count} {what}"));
        }
    }
}
