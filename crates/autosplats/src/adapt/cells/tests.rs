//! Cells that are filled again and again.

use super::{Cells, Level};
use crate::adapt::tests::{Case, PROJECTIONS};
use crate::test_clouds::{self, noisy};

#[test]
fn nothing_is_left_of_the_frame_before() {
    let sphere = Case::new(&noisy(test_clouds::sphere(4000), 0.02), PROJECTIONS[0], [320, 240]);
    let small = Case::new(&noisy(test_clouds::sphere(900), 0.05), PROJECTIONS[1], [150, 200]);
    let mut cells = Cells::default();
    for case in [&sphere, &small, &sphere, &small] {
        cells.fill(&case.screen, &case.view, crate::adapt::tests::K);
        let fresh = case.cells();
        assert_eq!(cells.levels.len(), fresh.levels.len(), "levels");
        for (level, fresh) in cells.levels.iter().zip(&fresh.levels) {
            assert_eq!([level.side_px, level.columns, level.rows], [fresh.side_px, fresh.columns, fresh.rows], "sizes");
            assert!(level.bunches == fresh.bunches, "cells of {} pixels", level.side_px);
        }
    }
    let has_second = |level: &Level| level.bunches[1].iter().any(|bunch| bunch.count[0] > 0.0);
    assert!(cells.levels.iter().any(has_second), "cells with more than a bunch");
    assert!(cells.levels[0].bunches[0].iter().any(|cell| cell.count[0] > 0.0), "points");
    assert!(cells.levels[0].bunches[0].iter().any(|cell| cell.count[0] == 0.0), "empty cells");
}
