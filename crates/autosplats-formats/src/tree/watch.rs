//! What is settled and found odd while nodes are decoded.

use std::collections::HashSet;
use std::sync::{Mutex, OnceLock, PoisonError};

use autosplats_cloud::{Key, PointCloud, TreeInfo, Wanted, shown_number};
use glam::DVec3;

use crate::{
    color_scale::Levels,
    read::las::{Colors, narrow_note},
};

/// Points per node that are compared with the node's cube.
const SAMPLES: usize = 64;

/// What holds of all nodes, and notes about single ones.
#[derive(Debug, Default)]
pub(super) struct Watch {
    /// Whether colours have 16 bits.
    wide: OnceLock<bool>,
    notes: Mutex<Notes>,
}

#[derive(Debug, Default)]
struct Notes {
    told: HashSet<Kind>,
    new: Vec<String>,
}

/// Each kind is told once.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Kind {
    NarrowColors,
    MixedColors,
    Outside,
    Spacing,
}

impl Watch {
    /// How to read the colours. The first call asks `first` for the levels of the first points that have colours.
    ///
    /// No lock is held meanwhile: threads that ask at the same time find the same answer.
    pub(super) fn colors<E>(&self, wanted: bool, first: impl FnOnce() -> Result<Levels, E>) -> Result<Colors, E> {
        if !wanted {
            return Ok(Colors::Unwanted);
        }
        if let Some(&wide) = self.wide.get() {
            return Ok(Colors::Settled { wide });
        }
        let levels = first()?;
        // The specification of LAS wants 16 bits, so black points have them.
        let wide = levels.are_wide() || !levels.any();
        if !wide {
            self.tell(Kind::NarrowColors, || narrow_note(levels));
        }
        Ok(Colors::Settled { wide: *self.wide.get_or_init(|| wide) })
    }

    /// Compares a decoded node with what the file states.
    pub(super) fn check(&self, key: Key, cloud: &PointCloud, levels: Levels, info: &TreeInfo, is_leaf: bool) {
        if let Some(&wide) = self.wide.get().filter(|&&wide| levels.any() && levels.are_wide() != wide) {
            let [own, others] = if wide { [8, 16] } else { [16, 8] };
            let what =
                format!("the colours of node {key} look like {own} bits, those of the first points like {others}");
            self.tell(Kind::MixedColors, || format!("{what}; {others} are taken everywhere"));
        }
        let [low, high] = key.cube(info.cube);
        let slack = (high - low) * 1e-3 + info.resolution.unwrap_or_default();
        let outside = |at: DVec3| at.is_finite() && !(at.cmpge(low - slack).all() && at.cmple(high + slack).all());
        let step = cloud.len().div_ceil(SAMPLES).max(1);
        if (0..cloud.len()).step_by(step).any(|index| outside(cloud.world_position(index))) {
            self.tell(Kind::Outside, || {
                format!("points of node {key} are outside its cube, so parts of the scan may be missed; build it again")
            });
        }
        if key == Key::ROOT && !is_leaf && !self.has_told(Kind::Spacing) {
            let note = spacing_note(cloud, info.spacing);
            self.tell(Kind::Spacing, || note.unwrap_or_default());
        }
    }

    pub(super) fn take_notes(&self) -> Vec<String> {
        std::mem::take(&mut self.notes.lock().unwrap_or_else(PoisonError::into_inner).new)
    }

    fn has_told(&self, kind: Kind) -> bool {
        self.notes.lock().unwrap_or_else(PoisonError::into_inner).told.contains(&kind)
    }

    /// Tells a note, unless one of its kind has been told. An empty note only counts as told.
    fn tell(&self, kind: Kind, note: impl FnOnce() -> String) {
        let mut notes = self.notes.lock().unwrap_or_else(PoisonError::into_inner);
        if notes.told.insert(kind) {
            notes.new.extend(Some(note()).filter(|note| !note.is_empty()));
        }
    }
}

/// Applies what is wanted of a node to the points that were decoded for it.
pub(super) fn chosen(mut cloud: PointCloud, wanted: &Wanted) -> PointCloud {
    if let Some(filter) = wanted.keep.as_ref().filter(|filter| !filter.is_all()) {
        cloud.keep(filter);
        let is_color = |name: &str| wanted.colors && wanted.exact && ["Red", "Green", "Blue"].contains(&name);
        cloud.retain_fields(|name| wanted.wants(name) || is_color(name));
    }
    cloud
}

/// Note on a stated spacing that is more than twice or less than half that of the root's points.
fn spacing_note(cloud: &PointCloud, stated: f64) -> Option<String> {
    // One point per cell of the spacing is on a surface; four times the spacing then has 16.
    let per_cell = |side: f64| {
        let cell = |place: &[f32; 3]| place.map(|along| (f64::from(along) / side).floor() as i64);
        let cells: HashSet<[i64; 3]> = cloud.positions().iter().map(cell).collect();
        cloud.len() as f64 / cells.len().max(1) as f64
    };
    let denser = per_cell(stated) > 4.0;
    let sparser = per_cell(4.0 * stated) < 4.0;
    let what = if denser { "more than twice" } else { "less than half" };
    (denser || sparser).then(|| {
        format!(
            "the stated spacing of {} is {what} that of the root's points; details may be off",
            shown_number(stated)
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spacing_is_told_if_it_is_off_by_more_than_two() {
        let positions = (0..10_000).map(|i| [i % 100, i / 100, 0].map(|along| 0.5 * along as f32)).collect();
        let plane = PointCloud::new(DVec3::ZERO, positions);
        for (stated, words) in [(0.5, None), (0.9, None), (0.3, None), (1.1, Some("twice")), (0.2, Some("half"))] {
            let note = spacing_note(&plane, stated);
            assert_eq!(note.is_some(), words.is_some(), "{stated}: {note:?}");
            assert!(note.unwrap_or_default().contains(words.unwrap_or_default()), "{stated}");
        }
    }
}
