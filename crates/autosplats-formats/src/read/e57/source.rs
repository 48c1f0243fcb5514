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
    /// Finds the coordinates among the values. All points are kept at first.
    pub(super) fn new(job: &Job<'_>, header: &'a ScanHeader, values: Values) -> Result<Self, Error> {
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
        if u32::try_from(values.count).is_err() {
            return Err(job.unsupported("more than 4 billion points in a scan; split it"));
        }
        Ok(Self {
            header,
            coordinates,
            pose: header.pose.unwrap_or(DMat4::IDENTITY),
            state: header.element(state),
            keep: None,
            keep_invalid: job.options.keep_no_returns,
            values,
        })
    }

    /// Counts the points without a position, unless they are kept too.
    pub(super) fn counts(&self) -> Counts {
        let count = self.values.count as u32;
        if self.keep_invalid {
            return Counts { values: self.values.count, ..Counts::default() };
        }
        let number = |is: &(dyn Fn(u32) -> bool + Sync)| (0..count).into_par_iter().filter(|&i| is(i)).count();
        let invalid = |i: u32| self.state(i as usize) != 0;
        let [directions, without] = match self.state {
            None => [0; 2],
            Some(_) => [number(&|i| self.state(i as usize) == 1), number(&invalid)],
        };
        let at_scanner = number(&|i| self.is_at_scanner(i as usize));
        Counts { values: self.values.count, directions, without, at_scanner }
    }

    /// Keeps the points with a position. The counts are of the whole scan.
    pub(super) fn keep_measured(&mut self, counts: &Counts) {
        let drops_zeros = counts.drops_zeros();
        let keep = |i: &u32| {
            let value = *i as usize;
            self.state(value) == 0 && !(drops_zeros && self.is_at_scanner(value))
        };
        if counts.without > 0 || drops_zeros {
            self.keep = Some((0..self.values.count as u32).into_par_iter().filter(keep).collect());
        }
    }

    /// Whether a point has a position, which is the scanner's own.
    fn is_at_scanner(&self, value: usize) -> bool {
        self.state(value) == 0 && self.is_scanner(value)
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

/// Numbers of a scan's points. Those of its parts can be added.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Counts {
    /// All points.
    pub(super) values: usize,
    /// Those of which only the direction is known.
    directions: usize,
    /// Those without a position, including the above.
    without: usize,
    /// Those at the scanner's own place.
    at_scanner: usize,
}

impl Counts {
    pub(super) fn add(&mut self, other: Self) {
        self.values += other.values;
        self.directions += other.directions;
        self.without += other.without;
        self.at_scanner += other.at_scanner;
    }

    /// Whether points at the scanner are dropped. A single one may be real. If all points are there, the file means
    /// something else by it.
    fn drops_zeros(&self) -> bool {
        self.at_scanner > 1 && self.at_scanner < self.values - self.without
    }

    /// Number of points that are kept.
    pub(super) fn kept(&self) -> usize {
        self.values - self.without - if self.drops_zeros() { self.at_scanner } else { 0 }
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
    /// Adds those of a scan.
    pub(super) fn add(&mut self, counts: &Counts) {
        let Counts { directions, without, at_scanner, .. } = *counts;
        self.directions += directions;
        self.nothing += without - directions;
        self.at_scanner += if counts.drops_zeros() { at_scanner } else { 0 };
        self.kept_at_scanner += if counts.drops_zeros() || at_scanner < 2 { 0 } else { at_scanner };
    }

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
