//! Blended sheets against sums of one sheet after the other.

use glam::Vec3;
use pulp::Simd;

use super::blend::{Blend, NearbySheets};
use super::{SHEET_LEVELS, SHEETS, Sheets};
use crate::adapt::cells::Cells;
use crate::adapt::rules::{Goal, MAX_MOVE_NOISES};
use crate::adapt::tests::{Case, PROJECTIONS, angle};
use crate::camera::View;
use crate::fit::Surfel;
use crate::test_clouds::{self, noisy};

const NOISE: f32 = 0.02;

/// The sheets that all surfels of a case ask for.
fn sheets_of(case: &Case, cells: &Cells) -> Sheets {
    let mut sheets = Sheets::default();
    sheets.clear(cells);
    sheets.level = SHEET_LEVELS[0];
    case.fitted[0].iter().filter(|surfel| surfel.radius > 0.0).for_each(|surfel| sheets.ask(surfel, cells, &case.view));
    sheets.fit(cells, &|_, _, _| (NOISE, false), &case.view, &crate::cancel::NEVER);
    sheets
}

fn goal(surfel: &Surfel, view: &View) -> Goal {
    Goal::new(NOISE, false, surfel.k_radius, surfel.center[2], view)
}

#[pulp::with_simd(blend = pulp::Arch::new())]
#[inline(always)]
fn blend_with<'a, S: Simd>(
    simd: S,
    sheets: &'a Sheets,
    surfel: &'a Surfel,
    first: Option<(Vec3, f32)>,
    cells: &'a Cells,
    view: &'a View,
    around: &'a mut [NearbySheets; 2],
) -> Blend {
    sheets.blend(simd, surfel.center, first, &goal(surfel, view), (cells, view), around)
}

/// Offset and normal of the surface beside a surfel without a normal of its own, one sheet after the other.
fn blended_one_by_one(sheets: &Sheets, surfel: &Surfel, cells: &Cells, view: &View) -> Option<[Vec3; 2]> {
    let level = &cells.levels[sheets.level];
    let place = Vec3::from(surfel.center);
    let at = view.to_pixel(place).map(|at| at / level.side_px as f32 - 0.5);
    let (mut offset, mut normal, mut total) = (Vec3::ZERO, Vec3::ZERO, 0.0);
    for (cell, stack) in sheets.stacks[..level.columns * level.rows.len()].iter().enumerate() {
        let [x, y] = [cell % level.columns, cell / level.columns].map(|along| along as f32);
        let share = (1.0 - (at[0] - x).abs()).max(0.0) * (1.0 - (at[1] - y).abs()).max(0.0);
        if !sheets.fitted[cell] || share == 0.0 {
            continue;
        }
        for index in 0..SHEETS {
            let field = |field: usize| stack.0[field][index];
            let vector = |first: usize| Vec3::new(field(first), field(first + 1), field(first + 2));
            let (center, radius, axis, trust) = (vector(0), field(3), vector(5), field(18));
            if trust == 0.0 {
                continue;
            }
            let from = (place - center) / radius;
            let bent = Vec3::new(
                Vec3::new(field(9), field(10), field(11)).dot(from),
                Vec3::new(field(10), field(12), field(13)).dot(from),
                Vec3::new(field(11), field(13), field(14)).dot(from),
            );
            let height = (field(8) + bent.dot(from) - axis.dot(from)) * radius;
            let near = 1.0 - (from - axis * axis.dot(from)).length_squared();
            let likely = 1.0 - (height / (MAX_MOVE_NOISES * NOISE)).powi(2);
            if near > 0.0 && likely > 0.0 {
                let weight = share * near * near * likely.powi(8) * trust;
                let own = (axis - 2.0 * bent).normalize();
                normal += own * if own.dot(normal) < 0.0 { -weight } else { weight };
                offset += axis * height * weight;
                total += weight;
            }
        }
    }
    (total > 0.0).then(|| [offset / total, normal.normalize()])
}

#[test]
fn sixteen_at_a_time_are_one_after_the_other() {
    for (projection, size) in PROJECTIONS.into_iter().flat_map(|of| [[320, 240], [21, 18]].map(|size| (of, size))) {
        // The larger picture shows all of the sphere, the small one ends in the middle of its last cells.
        let case = Case::new(&noisy(test_clouds::sphere(8000), NOISE), projection, size);
        let cells = case.cells();
        let sheets = sheets_of(&case, &cells);
        let mut around = Default::default();
        let mut blended = 0;
        for surfel in &case.fitted[0] {
            let found = blend(&sheets, surfel, None, &cells, &case.view, &mut around);
            match (found, blended_one_by_one(&sheets, surfel, &cells, &case.view)) {
                (Blend::Surface(found), Some([offset, normal])) => {
                    blended += 1;
                    let off = found.offset.distance(offset);
                    assert!(off < 1e-3 * NOISE, "{surfel:?}: {found:?}, one by one {offset:?}");
                    let turned = angle(found.normal.into(), normal.into());
                    assert!(turned < 0.1, "{surfel:?}: {found:?}, one by one {normal:?}");
                }
                (Blend::Nothing, None) => {}
                (found, alone) => panic!("{surfel:?}: {found:?}, one by one {alone:?}"),
            }
        }
        assert!(2 * blended > case.fitted[0].len(), "{blended} of {} have sheets", case.fitted[0].len());
    }
}

#[test]
fn any_width_of_vectors_blends_to_the_same_bits() {
    let case = Case::new(&noisy(test_clouds::sphere(8000), NOISE), PROJECTIONS[0], [320, 240]);
    let cells = case.cells();
    let sheets = sheets_of(&case, &cells);
    let [mut around, mut around_alone]: [[NearbySheets; 2]; 2] = Default::default();
    let mut kinds = [0; 3];
    for (index, surfel) in case.fitted[0].iter().enumerate() {
        // Some have a reliable normal, and some of these differ from all sheets.
        let first = [None, Some(Vec3::from(surfel.normal)), Some(Vec3::from(surfel.major_axis))][index % 3];
        let first = first.map(|normal| (normal, 0.01));
        let found = blend(&sheets, surfel, first, &cells, &case.view, &mut around);
        let alone = blend_with(pulp::Scalar, &sheets, surfel, first, &cells, &case.view, &mut around_alone);
        assert_eq!(format!("{found:?}"), format!("{alone:?}"), "{surfel:?}");
        kinds[match found {
            Blend::Surface(_) => 0,
            Blend::Disagrees => 1,
            Blend::Nothing => 2,
        }] += 1;
    }
    assert!(kinds[0] > 100 && kinds[1] > 100, "surfaces and what disagrees: {kinds:?}");
}
