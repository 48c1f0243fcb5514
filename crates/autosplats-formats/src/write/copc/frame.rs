//! The root's cube, and where records lie in it.
//!
//! # How it works
//!
//! Places are whole steps of the coordinates from the lowest corner of all points. The cube is a power of two steps
//! wide, so the borders of all nodes are whole steps too, and no point is on the wrong side of one by rounding. Where
//! the steps of the axes differ, places count the finest of them.

use glam::DVec3;

/// Fewest bits of a place: the cells of the root's points are then no finer than the coordinates.
const LEAST_BITS: u32 = CELL_BITS;
/// The cube of a node is cut into this many bits of cells along each axis, of which each gives a point.
pub(super) const CELL_BITS: u32 = 7;

/// Steps of coordinates: a coordinate is `offset + integer * scale`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Lattice {
    pub(super) scale: DVec3,
    pub(super) offset: DVec3,
}

impl Lattice {
    pub(super) fn world(&self, steps: [i64; 3]) -> DVec3 {
        DVec3::from_array(steps.map(|step| step as f64)) * self.scale + self.offset
    }
}

/// The root's cube.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Frame {
    lattice: Lattice,
    /// Steps of the lowest corner.
    low: [i64; 3],
    /// Width of a place in world units.
    unit: f64,
    /// Places along an edge of the cube, as a power of two: at most 32.
    pub(super) bits: u32,
    /// Places per step, if they are not the same.
    places_per_step: Option<[f64; 3]>,
}

impl Frame {
    /// The smallest cube around a box of steps, both corners of which are points.
    pub(super) fn around(lattice: Lattice, [low, high]: [[i64; 3]; 2]) -> Self {
        let scale = lattice.scale;
        let steps = [0, 1, 2].map(|axis| (high[axis] - low[axis]).max(0) as u64);
        let bits_of = |most: u64| (64 - most.leading_zeros()).max(LEAST_BITS);
        let most = steps.into_iter().max().unwrap_or(0);
        if scale.x == scale.y && scale.y == scale.z {
            return Self { lattice, low, unit: scale.x, bits: bits_of(most), places_per_step: None };
        }
        let mut unit = scale.min_element();
        let size = [0, 1, 2].map(|axis| steps[axis] as f64 * scale[axis]).into_iter().fold(0.0, f64::max);
        // One place is left for rounding.
        while size / unit >= f64::from(u32::MAX) {
            unit *= 2.0;
        }
        let bits = bits_of((size / unit) as u64 + 1).min(32);
        Self { lattice, low, unit, bits, places_per_step: Some((scale / unit).to_array()) }
    }

    /// The place of coordinates in steps; `None` outside of the cube.
    #[inline]
    pub(super) fn place(&self, steps: [i32; 3]) -> Option<[u32; 3]> {
        let mut places = [0; 3];
        for axis in 0..3 {
            let steps = i64::from(steps[axis]) - self.low[axis];
            let place = match self.places_per_step {
                None => steps as u64,
                Some(_) if steps < 0 => return None,
                Some(factor) => (steps as f64 * factor[axis]) as u64,
            };
            if place >> self.bits != 0 {
                return None;
            }
            places[axis] = place as u32;
        }
        Some(places)
    }

    /// Width of the cube in world units.
    pub(super) fn side(&self) -> f64 {
        self.unit * f64::from(self.bits).exp2()
    }

    /// Middle of the cube in world coordinates.
    pub(super) fn center(&self) -> DVec3 {
        self.lattice.world(self.low) + self.side() / 2.0
    }
}

/// Coordinates of a record, in steps.
#[inline]
pub(super) fn steps_of(record: &[u8]) -> [i32; 3] {
    [0, 4, 8].map(|at| i32::from_le_bytes([record[at], record[at + 1], record[at + 2], record[at + 3]]))
}

/// The low 21 bits of three numbers interleaved: x first, then y, then z, from the lowest bit on.
#[inline]
pub(super) fn morton(places: [u32; 3]) -> u64 {
    spread(places[0]) | spread(places[1]) << 1 | spread(places[2]) << 2
}

/// The three numbers that [`morton`] interleaved.
#[inline]
pub(super) fn unmorton(code: u64) -> [u32; 3] {
    [gather(code), gather(code >> 1), gather(code >> 2)]
}

#[inline]
fn spread(bits: u32) -> u64 {
    let mut bits = u64::from(bits) & 0x1f_ffff;
    bits = (bits | bits << 32) & 0x001f_0000_0000_ffff;
    bits = (bits | bits << 16) & 0x001f_0000_ff00_00ff;
    bits = (bits | bits << 8) & 0x100f_00f0_0f00_f00f;
    bits = (bits | bits << 4) & 0x10c3_0c30_c30c_30c3;
    (bits | bits << 2) & 0x1249_2492_4924_9249
}

#[inline]
fn gather(code: u64) -> u32 {
    let mut bits = code & 0x1249_2492_4924_9249;
    bits = (bits | bits >> 2) & 0x10c3_0c30_c30c_30c3;
    bits = (bits | bits >> 4) & 0x100f_00f0_0f00_f00f;
    bits = (bits | bits >> 8) & 0x001f_0000_ff00_00ff;
    bits = (bits | bits >> 16) & 0x001f_0000_0000_ffff;
    ((bits | bits >> 32) & 0x1f_ffff) as u32
}
