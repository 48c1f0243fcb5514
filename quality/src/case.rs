//! The list of cases.

use autosplats::ViewDirection::{Back, Front, Iso, Left, Top};

use crate::subject::{BUNNY, DANCER, Density, HORSE, Recipe, Source};
use crate::sweep::Sweep;
use crate::view::Shot;

/// Sensor position at the edge of the herd's meadow, as high as on a car, metres.
const EDGE: [f64; 3] = [1.2, -6.9, 1.75];
/// View from behind the sensor at the meadow's edge.
const BEHIND_EDGE: Shot = Shot::Behind([2.7, 1.35], [0.3, -2.0, 0.5]);
/// A sensor of 32 beams at the edge of the meadow.
const FEW_BEAMS: Sweep = Sweep::new(EDGE, [-30.67, 10.67], 32, 1024);

/// A subject and a view of it.
#[derive(Clone, Copy, Debug)]
pub struct Case {
    /// How to make the subject.
    pub recipe: Recipe,
    /// The view.
    pub shot: Shot,
    /// Width and height of the picture, pixels.
    pub size: [u32; 2],
    /// Whether motion is measured too.
    pub motion: bool,
    /// Whether the case is a row of the contact sheets.
    pub sheet: bool,
}

impl Case {
    const fn new(recipe: Recipe, shot: Shot, size: [u32; 2]) -> Self {
        Self { recipe, shot, size, motion: false, sheet: false }
    }

    const fn moving(self) -> Self {
        Self { motion: true, ..self }
    }

    const fn shown(self) -> Self {
        Self { sheet: true, ..self }
    }

    /// Names of subject and view, separated by a space.
    pub fn name(&self) -> String {
        format!("{} {}", self.recipe.name(), self.shot.name())
    }
}

/// All cases, those of [`quick`] among them.
pub fn full() -> Vec<Case> {
    let scene = |name, count| Recipe::new(Source::Scene(name), count);
    let [figure, two_scales, statue] =
        [scene("figure", 300_000), scene("two-scales", 700_000), scene("statue", 800_000)];
    let [herd, cathedral] = [scene("herd", 1_000_000), scene("cathedral", 3_000_000)];
    let [bunny, dense_bunny] = [Recipe::new(BUNNY, 300_000), Recipe::new(BUNNY, 1_000_000)];
    let [horse, dancer] = [Recipe::new(HORSE, 300_000), Recipe::new(DANCER, 150_000)];
    let bumpy = Recipe::new(Source::Bumpy(7), 800_000);
    let noisy = bunny.noise(0.003);
    let ear = [0.40, 0.30];
    let meadow = |sweep| Recipe::swept(Source::Scene("herd"), sweep);
    let nave = |sweep| Recipe::swept(Source::Scene("cathedral"), sweep);
    // A car's sensor at the meadow's edge and a robot's in the nave.
    let many = Sweep::new(EDGE, [-24.8, 2.0], 64, 2048);
    let wide = Sweep::new([-5.7, -0.15, 1.75], [-45.0, 45.0], 64, 2048);
    let behind_nave = Shot::Behind([3.0, 0.9], [3.0, 0.5, 2.6]);
    let case = |recipe, shot| Case::new(recipe, shot, [960, 600]);
    let mut cases = vec![
        case(figure, Shot::Own).shown().moving(),
        case(figure, Shot::Near(Front, [0.5, 0.2], 5.0)),
        case(figure, Shot::Far(Iso, 5.0)).moving(),
        case(two_scales, Shot::Own).shown(),
        case(two_scales, Shot::Parallel(Front)),
        case(statue, Shot::Own).shown().moving(),
        case(statue, Shot::Near(Front, [0.5, 0.25], 4.0)),
        case(statue, Shot::Parallel(Back)),
        case(herd, Shot::Own).shown(),
        case(herd, Shot::Parallel(Top)),
        case(cathedral, Shot::Own).shown(),
        case(cathedral, Shot::From([-3.0, 7.0, 2.0], [14.0, 6.5, 4.0], 60.0)),
        case(meadow(many), BEHIND_EDGE).shown().moving(),
        case(meadow(many.noise(0.02)), BEHIND_EDGE).shown(),
        case(meadow(FEW_BEAMS), BEHIND_EDGE).shown(),
        case(nave(wide), behind_nave).shown(),
        case(nave(wide.noise(0.02)), behind_nave),
        case(bumpy, Shot::Whole(Front)).shown(),
        case(bumpy.noise(0.003), Shot::Whole(Front)).shown().moving(),
        case(bunny, Shot::Whole(Front)).shown().moving(),
        case(bunny, Shot::Near(Front, ear, 5.0)),
        case(bunny, Shot::Far(Front, 5.0)),
        case(dense_bunny, Shot::Near(Front, ear, 3.0)),
        case(bunny.density(Density::Uneven), Shot::Whole(Front)),
        case(bunny.density(Density::Striped), Shot::Whole(Front)),
        case(bunny.density(Density::Gradient), Shot::Whole(Front)),
        case(bunny.noise(0.001), Shot::Whole(Front)).shown().moving(),
        case(noisy, Shot::Whole(Front)).shown().moving(),
        case(noisy, Shot::Near(Front, ear, 5.0)),
        case(noisy, Shot::Far(Front, 5.0)).moving(),
        case(bunny.noise(0.01), Shot::Whole(Front)).shown(),
        case(bunny.outliers(0.02), Shot::Whole(Front)).shown(),
        case(bunny.misregistration(0.0015), Shot::Whole(Front)).shown(),
        case(bunny.noise(0.001).density(Density::Striped).outliers(0.005), Shot::Whole(Front)),
        case(horse, Shot::Whole(Left)).shown(),
        case(horse.noise(0.003), Shot::Whole(Left)),
        case(dancer, Shot::Whole(Front)).shown(),
        case(dancer.noise(0.001).density(Density::Uneven), Shot::Whole(Front)).shown(),
    ];
    // The herd under 32 beams is in both lists: the larger picture stays.
    let small = quick().into_iter().filter(|small| cases.iter().all(|case| case.name() != small.name()));
    let small: Vec<_> = small.map(|case| Case { sheet: false, ..case }).collect();
    cases.extend(small);
    cases
}

/// Small cases of few points and small pictures. They read no meshes, so the tests run everywhere.
pub fn quick() -> Vec<Case> {
    let scene = |name, count| Recipe::new(Source::Scene(name), count);
    let bumpy = Recipe::new(Source::Bumpy(6), 200_000);
    let case = |recipe, shot| Case::new(recipe, shot, [480, 300]);
    vec![
        case(scene("figure", 60_000), Shot::Own).shown().moving(),
        case(scene("two-scales", 150_000), Shot::Own),
        case(scene("statue", 150_000), Shot::Own),
        case(scene("statue", 150_000), Shot::Near(Front, [0.5, 0.25], 4.0)),
        case(bumpy, Shot::Whole(Front)),
        case(bumpy.density(Density::Uneven), Shot::Whole(Front)),
        case(bumpy.noise(0.003), Shot::Whole(Front)).shown().moving(),
        case(bumpy.outliers(0.02), Shot::Whole(Front)).shown(),
        case(Recipe::swept(Source::Scene("herd"), FEW_BEAMS), BEHIND_EDGE),
    ]
}
