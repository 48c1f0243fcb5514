//! Which surfels become dots.

use super::*;

/// Fitted discs and how many of them become dots: for points of surfaces, then for outliers.
fn dots(case: &Case, is_stray: impl Fn(u32) -> bool) -> [[usize; 2]; 2] {
    let mut counts = [[0; 2]; 2];
    let is_disc = |surfel: &Surfel| surfel.radius > 1.01 * case.view.pixel_size(surfel.center[2]);
    for (before, after) in case.fitted.concat().iter().zip(&case.adapted()).filter(|(before, _)| is_disc(before)) {
        let [discs, dots] = &mut counts[usize::from(is_stray(before.source))];
        *discs += 1;
        *dots += usize::from(!is_disc(after));
    }
    counts
}

/// Points with neighbours and how many of them the fit dropped: for points of surfaces, then for outliers.
fn dropped(case: &Case, is_stray: impl Fn(u32) -> bool) -> [[usize; 2]; 2] {
    let mut counts = [[0; 2]; 2];
    for surfel in case.fitted.concat().iter().filter(|surfel| surfel.k_radius > 0.0) {
        let [all, gone] = &mut counts[usize::from(is_stray(surfel.source))];
        *all += 1;
        *gone += usize::from(surfel.radius == 0.0);
    }
    counts
}

#[test]
fn the_fit_drops_strays_and_hardly_anything_of_a_surface() {
    let of = |case: &Case, is_stray: &dyn Fn(u32) -> bool, least: f64| {
        let [[surface, its], [strays, gone]] = dropped(case, is_stray);
        assert!(its * 500 < surface, "{its} of the surface's {surface} are dropped");
        assert!(gone as f64 > least * strays as f64, "{gone} of {strays} are dropped");
    };
    for projection in PROJECTIONS {
        let (case, is_stray) = Case::noisy_with_strays(projection);
        of(&case, &is_stray, 0.3);
    }
    let (room, is_stray) = Case::stepped_with_strays();
    of(&room, &is_stray, 0.2);
}

#[test]
fn strewn_points_are_no_surface_however_flat_they_lie() {
    let mut positions = test_clouds::sphere(40_000);
    let surface = positions.len() as u32;
    let mut random = Random::new(42);
    positions.extend((0..1500).map(|_| [random.signed(), random.signed(), random.signed()].map(|c| 1.4 * c)));
    let case = Case::new(&positions, PROJECTIONS[0], [400, 300]);
    let [_, [strays, dots]] = dots(&case, |source| source >= surface);
    assert!(strays > 300 && dots * 4 > strays * 3, "{dots} of {strays} are dots");
}

#[test]
fn points_just_before_a_surface_are_dropped() {
    for projection in PROJECTIONS {
        let mut positions = test_clouds::sphere(40_000);
        let surface = positions.len() as u32;
        let mut random = Random::new(7);
        // Up to eighteen spacings of the sphere's points away, six from each other on average.
        let strewn = (0..1000).map(|_| random.direction().map(|c| c * (1.0 + 0.32 * random.unit())));
        positions.extend(strewn);
        let case = Case::new(&positions, projection, [400, 300]);
        let [[of_sphere, its_dots], [strays, dots]] = dots(&case, |source| source >= surface);
        assert!(strays > 200 && dots * 3 > strays * 2, "{dots} of {strays} are dots");
        assert!(its_dots * 1000 < of_sphere, "{its_dots} of the sphere's {of_sphere} are dots");
        let dropped = case.adapted().iter().filter(|surfel| surfel.source >= surface && surfel.radius == 0.0).count();
        assert!(dropped * 2 > strays, "{dropped} of {strays} are dropped");
    }
}

/// Noise hardly ever puts a point four deviations before its surface, or three steps for a depth camera.
#[test]
fn points_too_far_off_for_noise_are_dots() {
    for projection in PROJECTIONS {
        let (case, is_stray) = Case::noisy_with_strays(projection);
        let [[of_sphere, its_dots], [strays, dots]] = dots(&case, is_stray);
        assert!(strays > 100 && dots * 20 > strays * 19, "{dots} of {strays} are dots");
        assert!(its_dots * 100 < of_sphere, "{its_dots} of the sphere's {of_sphere} are dots");
    }
    let (room, is_stray) = Case::stepped_with_strays();
    // The other outliers have no sheet near enough to move to.
    let [[of_room, its_dots], [strays, dots]] = dots(&room, is_stray);
    assert!(strays > 30 && dots * 2 > strays, "{dots} of {strays} are dots");
    assert!(its_dots * 1000 < of_room, "{its_dots} of the room's {of_room} are dots");
}

/// Noise of disparities is unbounded, unlike noise of steps.
#[test]
fn depth_cameras_with_noise_of_disparities_lose_no_surface() {
    let mut random = Random::new(9);
    let room = Case::of_room(|depth| 1.0 / (1.0 / depth + 0.0014 * random.gaussian()));
    assert_eq!(room.known.on_device().len(), 1, "the noise of one scan is known");
    let [[of_room, its_dots], _] = dots(&room, |_| false);
    assert!(its_dots * 1000 < of_room, "{its_dots} of the room's {of_room} are dots");
}

/// In the plane of the surface, so that only their one-sided neighbourhoods reveal them.
#[test]
fn points_beyond_a_border_are_dots() {
    for projection in PROJECTIONS {
        let (positions, surface) = test_clouds::beyond_a_border();
        let case = Case::new(&positions, projection, [400, 300]);
        let [[of_surface, its_dots], [strays, dots]] = dots(&case, |source| source >= surface);
        assert!(strays > 40 && dots * 3 > strays * 2, "{dots} of {strays} are dots");
        assert!(its_dots * 1000 < of_surface, "{its_dots} of the surface's {of_surface} are dots");
    }
}

/// A cube of few points above a dense floor.
#[test]
fn sparse_edges_and_corners_are_surface() {
    for projection in PROJECTIONS {
        let mut random = Random::new(19);
        let floor = (0..60_000).map(|_| [1.2 * random.signed(), 0.9, 1.2 * random.signed()]);
        let mut positions: Positions = floor.collect();
        let floor = positions.len() as u32;
        let mut random = Random::new(20);
        positions.extend((0..2400).map(|at| {
            let [a, b] = [random.signed(), random.signed()].map(|c| 0.45 * c);
            let side = if at % 2 == 0 { 0.45 } else { -0.45 };
            [[a, b, side], [a, side, b], [side, a, b]][at % 3]
        }));
        let case = Case::new(&positions, projection, [480, 360]);
        let [_, [of_cube, dots]] = dots(&case, |source| source >= floor);
        assert!(of_cube > 1500 && dots * 33 < of_cube, "{dots} of {of_cube} are dots");
    }
}
