//! Which scan lines have an area.

use super::*;

/// Points 0.005 apart along lines at these heights, and the `rest`.
fn lines(heights: &[f32], rest: Positions) -> Case {
    let line = |&y: &f32| (0..400).map(move |step| [0.005 * step as f32 - 1.0, y, 0.0]);
    let mut positions: Positions = heights.iter().flat_map(line).collect();
    positions.extend(rest);
    let camera = Camera { eye: DVec3::NEG_Z * 4.0, look_at: DVec3::ZERO, up: DVec3::Y, projection: PROJECTIONS[1] };
    Case::of(&PointCloud::new(DVec3::ZERO, positions), &camera, [600, 600])
}

/// Share of scan lines in the middle half of [`lines`] that find an area.
fn share_of_areas(case: &Case) -> f32 {
    let (fitted, adapted) = (case.fitted.concat(), case.adapted());
    let in_middle =
        |surfel: &Surfel| surfel.source < 8000 && surfel.center[0].abs() < 0.5 && surfel.center[1].abs() < 0.5;
    let rows: Vec<usize> = (0..fitted.len()).filter(|&at| is_row(&fitted[at]) && in_middle(&fitted[at])).collect();
    assert!(rows.len() > 300, "{} rows", rows.len());
    rows.iter().filter(|&&at| adapted[at].radius >= fitted[at].radius).count() as f32 / rows.len() as f32
}

#[test]
fn wires_are_no_area_and_nor_is_what_is_seen_through() {
    // Several distances, as the radii of balls grow in steps.
    for apart in [0.05, 0.06, 0.07, 0.08, 0.1, 0.12] {
        let many: Vec<f32> = (0..20).map(|line| apart * (line as f32 - 9.5)).collect();
        let surface = share_of_areas(&lines(&many, Vec::new()));
        assert!(surface > 0.99, "of lines {apart} apart {surface} find an area");
        let wires = share_of_areas(&lines(&[-apart, 0.0, apart], Vec::new()));
        assert!(wires < 0.01, "of three wires {apart} apart {wires} do");
        let mut random = Random::new(41);
        let wall = (0..200_000).map(|_| [1.2 * random.signed(), 1.2 * random.signed(), 1.0]).collect();
        let before_wall = share_of_areas(&lines(&many, wall));
        assert!(before_wall < 0.01, "of lines {apart} apart before a wall {before_wall} do");
    }
}

#[test]
fn a_closed_curve_is_no_area_however_large_the_ball() {
    let on_circle = |step: usize| {
        let (sin, cos) = (step as f32 * std::f32::consts::TAU / 180.0).sin_cos();
        [sin, cos, 0.3 * sin * cos]
    };
    let camera = Camera { eye: DVec3::NEG_Z * 4.0, look_at: DVec3::ZERO, up: DVec3::Y, projection: PROJECTIONS[1] };
    for size in [300, 600, 900] {
        let cloud = PointCloud::new(DVec3::ZERO, (0..180).map(on_circle).collect());
        let case = Case::of(&cloud, &camera, [size; 2]);
        let (fitted, adapted) = (case.fitted.concat(), case.adapted());
        let rows = fitted.iter().zip(&adapted).filter(|(fitted, _)| is_row(fitted));
        let widened = rows.clone().filter(|(fitted, adapted)| adapted.radius >= fitted.radius).count();
        assert!(rows.count() > 150 && widened == 0, "{widened} are as wide as an area in {size} pixels");
    }
}
