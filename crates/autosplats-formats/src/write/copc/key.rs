//! Places of nodes in the tree, in the order of the Morton curve.

use autosplats_cloud::Key;

use super::frame::unmorton;

/// Place of a node: its level, and the Morton code of its cube among those of the level.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Place {
    pub(super) level: u32,
    pub(super) code: u64,
}

impl Place {
    pub(super) const ROOT: Self = Self { level: 0, code: 0 };
    /// Codes have three bits a level.
    pub(super) const MAX_LEVEL: u32 = 21;

    pub(super) fn parent(self) -> Self {
        Self { level: self.level - 1, code: self.code >> 3 }
    }

    /// Whether the cube is that of `other`, or inside it.
    pub(super) fn is_in(self, other: Self) -> bool {
        self.level >= other.level && self.code >> (3 * (self.level - other.level)) == other.code
    }

    /// Lowest corner of the cube in a root's cube of `bits` bits.
    pub(super) fn corner(self, bits: u32) -> [u32; 3] {
        unmorton(self.code).map(|at| (u64::from(at) << (bits - self.level)) as u32)
    }

    pub(super) fn key(self) -> Key {
        let [x, y, z] = unmorton(self.code);
        Key { level: self.level, x, y, z }
    }
}
