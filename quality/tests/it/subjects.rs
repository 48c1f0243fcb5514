//! Points have the defects of their recipe, and are the same in every run.

use autosplats::ViewDirection::Front;
use autosplats::cloud::glam::DVec3;
use autosplats_quality::exact::Exact;
use autosplats_quality::rays::Rays;
use autosplats_quality::subject::{Density, Recipe, Source, Subject};
use autosplats_quality::view::Shot;

const COUNT: usize = 40_000;
const RECIPE: Recipe = Recipe::new(Source::Bumpy(5), COUNT);

fn subject(recipe: Recipe) -> Subject {
    Subject::new(recipe).expect("a subject")
}

/// Offset of each point from its place without defects.
fn offsets(subject: &Subject) -> Vec<DVec3> {
    let clean = |point: usize| subject.clean.position(point as u32);
    (0..subject.clean.len()).map(|point| subject.cloud.world_position(point) - clean(point)).collect()
}

#[test]
fn the_same_recipe_gives_the_same_points() {
    let recipe = RECIPE.density(Density::Uneven).noise(0.002).outliers(0.01).misregistration(0.001);
    let [one, other] = [subject(recipe), subject(recipe)];
    assert_eq!(one.cloud.positions(), other.cloud.positions(), "points are reproducible");
    assert_eq!(recipe.name(), "bumpy:40K-uneven-noise0.2%-outliers1%-scans0.1%", "the name has all defects");
}

#[test]
fn clean_points_lie_on_the_surface() {
    let subject = subject(RECIPE);
    assert_eq!(subject.cloud.len(), COUNT, "number of points");
    assert!(offsets(&subject).iter().all(|offset| *offset == DVec3::ZERO), "points have no defects");
    for point in (0..COUNT as u32).step_by(97) {
        let place = subject.clean.position(point);
        let outward = place.normalize();
        let hit = subject.surface.trace(place + outward, -outward).expect("the ray hits the surface");
        assert!((hit.distance - 1.0).abs() < 1e-5, "point {point} is {} off", hit.distance - 1.0);
    }
}

#[test]
fn noise_has_its_deviation() {
    let subject = subject(RECIPE.noise(0.003));
    let offsets = offsets(&subject);
    let square = offsets.iter().map(|offset| offset.length_squared()).sum::<f64>() / offsets.len() as f64;
    let deviation = (square / 3.0).sqrt() / subject.diagonal;
    assert!((deviation - 0.003).abs() < 0.00005, "{deviation} in each direction");
}

#[test]
fn outliers_come_on_top() {
    let subject = subject(RECIPE.outliers(0.02));
    assert_eq!(subject.cloud.len(), COUNT + COUNT / 50, "2 % more points");
    assert!(
        !subject.is_outlier(COUNT as u32 - 1) && subject.is_outlier(COUNT as u32),
        "outliers follow all other points"
    );
    let far = (COUNT..subject.cloud.len()).filter(|&i| (subject.cloud.world_position(i).length() - 1.0).abs() > 0.3);
    assert!(far.count() > COUNT / 200, "many outliers are far from the surface");
}

#[test]
fn normals_are_the_surfaces_and_not_those_of_plane_fits() {
    let subject = Subject::new(Recipe::new(Source::Bumpy(6), 20_000).noise(0.003)).expect("a subject");
    // The bumpy sphere is centred at the origin, and all of its surface is visible from outside.
    let exact = |point: u32| {
        let outward = subject.clean.position(point).normalize();
        subject.surface.trace(2.0 * outward * subject.diagonal, -outward).expect("the surface").normal
    };
    let share = |found: &dyn Fn(u32) -> DVec3| {
        // The sine is precise at small angles.
        let is_right = |&point: &u32| found(point).cross(exact(point)).length().asin().to_degrees() < 0.1;
        (0..20_000).filter(is_right).count() as f64 / 20_000.0
    };
    let [found, fitted] = [share(&|point| subject.normal(point)), share(&|point| subject.clean.normal(point))];
    assert!(found > 0.99 && fitted < 0.5, "share of right normals: {found}, of plane fits {fitted}");
}

#[test]
fn a_little_of_the_far_side_is_beyond_the_border() {
    let subject = Subject::new(Recipe::new(Source::Bumpy(6), 20_000)).expect("a subject");
    let camera = Shot::Parallel(Front).camera(&subject, [96, 60]).expect("a camera");
    let rays = Rays::new(&camera, [96, 60]).expect("a view");
    let towards_eye = -rays.axes[2];
    let beyond: Vec<_> = (0..20_000).filter(|&point| subject.is_beyond_border(point, &rays)).collect();
    let faces_eye = |&&point: &&u32| {
        // The position points outward, as the sphere is centred at the origin.
        let (normal, outward) = (subject.normal(point), subject.clean.position(point));
        normal.dot(towards_eye) * normal.dot(outward) > 0.0
    };
    let wrong = beyond.iter().filter(faces_eye).count();
    assert!((20..2000).contains(&beyond.len()), "{} points are beyond a border", beyond.len());
    // Some points behind a fold do face the eye.
    assert!(wrong * 5 < beyond.len(), "{wrong} of {} face the eye", beyond.len());
}

#[test]
fn every_other_point_is_of_a_second_scan() {
    let subject = subject(RECIPE.misregistration(0.0015));
    let lengths: Vec<_> = offsets(&subject).iter().map(|offset| offset.length() / subject.diagonal).collect();
    assert!(lengths.iter().step_by(2).all(|length| *length == 0.0), "the first scan stays in place");
    let second: Vec<_> = lengths.iter().skip(1).step_by(2).collect();
    let mean = second.iter().copied().sum::<f64>() / second.len() as f64;
    assert!((0.0015..0.002).contains(&mean), "the second scan is shifted, and turned a little: {mean}");
    assert!(subject.max_offset > 0.0015 * subject.diagonal, "the tolerance grows with the misregistration");
}

#[test]
fn densities_differ_and_counts_do_not() {
    for (density, least) in [(Density::Uneven, 5.0), (Density::Striped, 2.5), (Density::Gradient, 4.0)] {
        let subject = subject(RECIPE.density(density));
        let count = subject.cloud.len() as f64;
        assert!((count / COUNT as f64 - 1.0).abs() < 0.03, "{density:?}: {count} points");
        // The area of the ball of ten points is inversely proportional to the density.
        let mut areas: Vec<_> = (0..subject.clean.len() as u32)
            .step_by(37)
            .map(|point| subject.clean.around(subject.clean.position(point)).last().map_or(0.0, |d| d.length_squared()))
            .collect();
        areas.sort_unstable_by(f64::total_cmp);
        let spread = areas[areas.len() * 97 / 100] / areas[areas.len() * 3 / 100];
        assert!(spread > least, "{density:?}: densities differ by a factor of {spread}");
    }
}

#[test]
fn near_and_far_are_near_and_far() {
    let subject = subject(RECIPE);
    let size = [120, 90];
    let exact = |shot: Shot| {
        let camera = shot.camera(&subject, size).expect("a camera");
        Exact::trace(&subject, &camera, size).expect("a camera that can see")
    };
    let [whole, near, far] =
        [exact(Shot::Whole(Front)), exact(Shot::Near(Front, [0.5, 0.5], 5.0)), exact(Shot::Far(Front, 5.0))];
    let spacing = |exact: &Exact| {
        let spacings = exact.seen.iter().flatten().map(|seen| seen.spacing_px);
        spacings.clone().sum::<f64>() / spacings.count() as f64
    };
    let [whole_px, near_px, far_px] = [spacing(&whole), spacing(&near), spacing(&far)];
    assert!((3.0..7.0).contains(&(near_px / whole_px)), "near: {near_px} and {whole_px}");
    assert!((3.0..7.0).contains(&(whole_px / far_px)), "far: {far_px} and {whole_px}");

    // The band follows the outline and is a few pixels wide.
    let band = whole.band();
    let inside = whole.seen.iter().flatten().count();
    let near_border = band.iter().filter(|in_band| **in_band).count();
    let outline = std::f64::consts::TAU * (inside as f64 / std::f64::consts::PI).sqrt();
    let width = near_border as f64 / outline;
    assert!((3.0..8.0).contains(&width), "the band is {width} pixels wide");
}
