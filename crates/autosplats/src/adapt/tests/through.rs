//! How much discs hide of what is seen through them.

use super::*;
use crate::adapt::through::LEAST_ON;

/// Share of their radius that fitted discs keep, ascending, for the chosen points.
fn kept(case: &Case, is_asked: impl Fn(&Surfel) -> bool) -> Vec<f32> {
    let (fitted, adapted) = (case.fitted.concat(), case.adapted());
    let asked = fitted.iter().zip(&adapted).filter(|(before, _)| before.radius > 0.0 && is_asked(before));
    let mut kept: Vec<f32> = asked.map(|(before, after)| after.radius / before.radius).collect();
    kept.sort_by(f32::total_cmp);
    kept
}

#[test]
fn a_crooked_sheet_before_a_denser_wall_hides_its_share() {
    let (positions, sheet) = test_clouds::before_a_wall(0.07);
    for projection in PROJECTIONS {
        let case = Case::new(&positions, projection, [400, 300]);
        // The others have lost neighbours to gaps.
        let of_sheet = kept(&case, |surfel| surfel.source < sheet && surfel.k_radius > 0.14);
        assert!(of_sheet.len() > 300, "{} discs", of_sheet.len());
        // One of 41 points is of the sheet. The disc's own point adds to the eight or nine others.
        let right = 1.12 / 41.0 / LEAST_ON;
        let [low, middle, high] = [1, 5, 7].map(|tenth| of_sheet[of_sheet.len() * tenth / 10]);
        let is_right = (0.8..1.25).contains(&(middle / right)) && low > 0.4 * right && high < 2.5 * right;
        assert!(is_right, "{projection:?}: {low} {middle} {high} of their radii, {right} is right");
        let of_wall = kept(&case, |surfel| surfel.source >= sheet);
        let whole = of_wall.iter().filter(|&&kept| kept == 1.0).count();
        assert!(whole * 100 > of_wall.len() * 99, "{projection:?}: {whole} of {} are whole", of_wall.len());
    }
}

#[test]
fn a_flat_sheet_before_a_denser_wall_stays_closed() {
    let (positions, sheet) = test_clouds::before_a_wall(0.0);
    for projection in PROJECTIONS {
        let case = Case::new(&positions, projection, [400, 300]);
        let of_sheet = kept(&case, |surfel| surfel.source < sheet && surfel.k_radius > 0.14);
        let whole = of_sheet.iter().filter(|&&kept| kept == 1.0).count();
        assert!(of_sheet.len() > 300 && whole * 4 > of_sheet.len() * 3, "{whole} of {} are whole", of_sheet.len());
    }
}

/// Strips that are as flat, but no wider than their points are apart.
#[test]
fn strips_before_a_denser_wall_hide_their_share() {
    let mut random = Random::new(25);
    let mut strip =
        |y: f32| -> Positions { (0..120).map(|_| [1.5 * random.signed(), y + 0.05 * random.signed(), 0.0]).collect() };
    let mut positions: Positions = [-0.7, 0.0, 0.7].into_iter().flat_map(&mut strip).collect();
    let strips = positions.len() as u32;
    let (with_wall, wall) = test_clouds::before_a_wall(0.0);
    positions.extend(&with_wall[wall as usize..]);
    for projection in PROJECTIONS {
        let case = Case::new(&positions, projection, [400, 300]);
        let of_strips = kept(&case, |surfel| surfel.source < strips && surfel.k_radius > 0.1);
        let shrunk = of_strips.iter().filter(|&&kept| kept < 0.9).count();
        assert!(of_strips.len() > 50 && shrunk * 3 > of_strips.len() * 2, "{shrunk} of {} shrank", of_strips.len());
    }
}

/// On the screen the wall is sixteen times as dense, and the sheet is crooked.
#[test]
fn what_is_close_to_the_eye_stays_closed() {
    let mut random = Random::new(24);
    let mut square = |half: f32, z: f32, waves: f32| -> Positions {
        let count = (1500.0 * 4.0 * half * half) as usize;
        let at = |[x, y]: [f32; 2]| [x, y, z + waves * (24.0 * x).sin()];
        (0..count).map(|_| at([half * random.signed(), half * random.signed()])).collect()
    };
    let mut positions = square(0.4, -3.0, 0.018);
    let near = positions.len() as u32;
    positions.extend(square(1.5, 0.0, 0.0));
    let camera = Camera { eye: DVec3::NEG_Z * 4.0, look_at: DVec3::ZERO, up: DVec3::Y, projection: PROJECTIONS[0] };
    let case = Case::of(&PointCloud::new(DVec3::ZERO, positions), &camera, [400, 300]);
    let of_near = kept(&case, |surfel| surfel.source < near);
    let whole = of_near.iter().filter(|&&kept| kept == 1.0).count();
    assert!(of_near.len() > 250 && whole * 50 > of_near.len() * 49, "{whole} of {} are whole", of_near.len());
}
