//! Cells that are filled again and again.

use super::{Cells, Level, SLABS};
use crate::adapt::tests::{Case, PROJECTIONS};
use crate::test_clouds::{self, noisy};

#[test]
fn nothing_is_left_of_the_frame_before() {
    let sphere = Case::new(&noisy(test_clouds::sphere(4000), 0.02), PROJECTIONS[0], [320, 240]);
    let small = Case::new(&noisy(test_clouds::sphere(900), 0.05), PROJECTIONS[1], [150, 200]);
    let mut cells = Cells::default();
    for case in [&sphere, &small, &sphere, &small] {
        cells.fill(&case.screen, &case.view, crate::adapt::tests::K, &crate::cancel::NEVER);
        let fresh = case.cells();
        assert!(cells.levels == fresh.levels, "cells of {:?}", case.view);
    }
    let clusters = |count: usize| {
        move |level: &Level| {
            (0..level.rows.len())
                .any(|row| (0..level.columns).any(|column| level.clusters([column, row]).count() == count))
        }
    };
    for count in [0, 1, 2, SLABS] {
        assert!(cells.levels.iter().any(clusters(count)), "cells of {count} clusters");
    }
}
