//! `docs/QUALITY.md`, from outcomes alone.

use crate::measure::{Measures, Swept};
use crate::method::{FIT_KS, Method};
use crate::motion::Change;
use crate::run::Outcome;
use crate::still::Still;
use crate::table::{Table, number, percent};
use crate::target::{TARGETS, ratio};

const INTRODUCTION: &str = "\
# Quality: pictures against the exact surface

Written by `cargo xtask quality`; every number is computed. It is about pictures, not about time: for that there is \
[PERFORMANCE.md](PERFORMANCE.md).

## What is measured

A case is a subject and a view of it. A subject is a surface that is known exactly, and points on it: the built-in scenes, \
a sphere with bumps (`bumpy`), and meshes made smooth by Loop subdivision, with points strewn evenly by area. `noise` is \
Gaussian, the same in all directions; its standard deviation is given in percent of the diagonal of the points' box. \
`outliers` lie anywhere in the box, as many percent of the points. `scans` are two, every other point belongs to the \
second, which is shifted by so many percent of the diagonal and turned by 0.1°. `uneven` has dense and sparse patches, \
`striped` dense and sparse stripes, `gradient` a density that falls to a twentieth. Subjects named like `64x2048` are \
swept: their points are where the rays of a spinning lidar meet the surface, so many beams at constant steps of elevation \
and so many steps in a turn, dense along rings and far apart from ring to ring; their `noise` is along the ray, its \
standard deviation in metres.

Pictures have 960x600 pixels, those of the last cases, whose points are fewer, 480x300. One ray through the centre of each \
pixel tells what is truly there. These ways to draw the points are compared:

- **ours**: this project with its default settings.
- **paper**: the paper's, k = 10, one point a pixel, splats whole at silhouettes.
- **dots**: squares of 3×3 pixels, the nearest in front, without normals; shaded as if they faced the eye, with occlusion \
to show the shape.
- **fit k**: the paper's splats, but trimmed as ours are and with normals of plane fits to the k exact nearest neighbours \
in the whole cloud, outliers known and left out. The best k of each case, chosen with the truth at hand, is what *best \
fit* means.
- **known**: our splats, of points free of noise, misregistration and outliers, without those just beyond a silhouette, with \
the normals of the surface itself: what pictures are without errors of normals and of places. They are discs, so that swept \
points' do not reach from ring to ring, and in motion each picture is made alone.

Errors of normals are angles to the true normal, over all pixels that both pictures cover; *band* is their mean within 4 \
pixels of a silhouette, *flipped* the share above 90° to all that is truly seen at the pixel and the eight around it, at \
an edge either side. *Holes* are empty pixels at least two pixels inside the true silhouette, *leaks* pixels that show \
something behind the surface and all that is seen beside it, *before* the same in front of it, *IoU* is the covered \
pixels' intersection over union, *wider* the pixels by which the silhouette is too wide: all five only where points lie at \
most 1.5 pixels apart (*sampled*), swept ones from ring to ring, and left out if that is hardly anywhere. The target for IoU \
is held only by cases of whose surface 85 % is sampled: where it thins out, its border is anybody's guess. *Depth* is the mean \
error in depth in pixels. PSNR and FLIP compare pictures lit by the same lights in plain clay, over the pixels that \
either covers. A moving camera goes around the subject in six steps of 0.7°; *change* is the mean difference of one \
surface point between two pictures after one another, which in the true ones comes from light that goes with the camera, \
and from pixels.

";

const SWEPT: &str = "\
## Swept points

Percent of pixels. *Seen* is the share of the surface that the lidar sees: between its lowest and its highest beam, with \
nothing in the way, struck at less than 87°. Of that, *closed* is what is covered, by whatever it may be, and *right* what \
is covered by a surface that is no farther from the true one, in depth, than rings are apart there. *Over* are pixels \
covered though nothing is there, or what is there is not seen by the lidar and lies behind by more than a hundredth of the \
diagonal, as a share of those seen: closing gaps must not close what is open. Past the last ring on something no point \
tells where it ends, so not all of it can be closed. Nothing else is asked about what the lidar does not see, here and in \
all tables but that of motion.

";

const STILLS: &str = "\
## Lit pictures against many rays

PSNR in decibels with a truth of 16 rays a pixel in place of one, over the same pixels: what is finer than pixels is there \
with its mean, as a picture should have it. *Still* is ours as `autosplats render` and a window at rest make it, rendered \
twice as wide and high and averaged; the others are the same pictures as above, and *truth, one ray* is what they are held \
against there.

";

const CREDITS: &str = "\
The bunny is from the Stanford 3D Scanning Repository, the horse by Sumner and Popović, the dancer by Vlasic et al. FLIP \
is that of Andersson et al. 2020, at 67 pixels per degree.
";

/// The whole page. `sheets` are the names of pictures beside it.
pub fn page(outcomes: &[Outcome], sheets: &[String]) -> String {
    let pictures: String = sheets.iter().map(|name| format!("![{name}](quality/{name}.png)\n")).collect();
    [
        INTRODUCTION,
        "## Targets\n\n",
        &targets(outcomes),
        "## Summary\n\nMeans over the cases of a surface, without and with noise (or outliers, or scans that do not \
         fit).\n\n",
        &summary(outcomes),
        "## Pictures\n\nWhere the error of normals is green, our picture is empty; where it is blue, it shows what is not \
         there.\n\n",
        &pictures,
        "\n## Normals\n\nDegrees, and percent of pixels.\n\n",
        &normals(outcomes),
        "## Surface\n\nPercent of pixels; p is the paper's.\n\n",
        &cover(outcomes),
        &swept(outcomes),
        "## Lit pictures\n\nPSNR in decibels, FLIP from 0 to 1, depth in pixels. The best fit is the one with the best \
         normals.\n\n",
        &lit(outcomes),
        STILLS,
        &stills(outcomes),
        "## Motion\n\nMean change of a surface point from picture to picture: of its normal in degrees, of its lightness \
         in 255ths. Ours are *steady*, as the window makes them while the view moves: what is fitted to a point is \
         averaged over about eight pictures, and each picture with the one before; eight of the same movement go before those \
         that count. All others are made by themselves. *Alone* are ours, each made by itself, and *off* is the mean error of normals in the last \
         picture. *Smooth* are true pictures of 16 rays a pixel, in which detail finer than pixels does not \
         flicker.\n\n",
        &motion(outcomes),
        CREDITS,
    ]
    .concat()
}

fn targets(outcomes: &[Outcome]) -> String {
    let mut table =
        Table::new(&["target", "met", "worst", "where", "", "known: met", "ours alone misses", "known alone misses"]);
    for target in TARGETS {
        let of = |outcome, method| (target.value)(outcome, method).filter(|value| value.is_finite());
        let values: Vec<_> =
            outcomes.iter().filter_map(|outcome| Some((outcome, of(outcome, Method::Ours)?))).collect();
        let worst =
            values.iter().copied().reduce(|one, other| if target.is_worse(other.1, one.1) { other } else { one });
        let Some((at_worst, worst)) = worst else { continue };
        let met = values.iter().filter(|(_, value)| target.is_met(*value)).count();
        let verdict = if met == values.len() { "met" } else { "missed" };
        let known = values.iter().filter_map(|&(outcome, ours)| Some((ours, of(outcome, Method::Known)?)));
        let known: Vec<_> = known.map(|(ours, known)| [ours, known].map(|value| target.is_met(value))).collect();
        let count = |of: fn(&&[bool; 2]) -> bool| known.iter().filter(of).count();
        let dash_for_none = |text: String| if known.is_empty() { "–".into() } else { text };
        table.row(&[
            target.what.into(),
            format!("{met} of {}", values.len()),
            number(worst, target.decimals),
            at_worst.case.name(),
            verdict.into(),
            dash_for_none(format!("{} of {}", count(|[_, known]| *known), known.len())),
            dash_for_none(count(|[ours, known]| !ours && *known).to_string()),
            dash_for_none(count(|[ours, known]| *ours && !known).to_string()),
        ]);
    }
    table.finish()
}

/// What a table shows of one method.
fn of(outcome: &Outcome, method: Method, value: impl Fn(&Measures) -> f64) -> f64 {
    outcome.of(method).map_or(f64::NAN, value)
}

fn mean(measures: &Measures) -> f64 {
    measures.angles.map_or(f64::NAN, |angles| angles.mean)
}

fn band(measures: &Measures) -> f64 {
    measures.angles.map_or(f64::NAN, |angles| angles.band)
}

fn summary(outcomes: &[Outcome]) -> String {
    let mut table = Table::new(&[
        "surface",
        "cases",
        "normals °: ours",
        "paper",
        "best fit",
        "band °: ours",
        "paper",
        "best fit",
        "PSNR: ours",
        "paper",
        "dots",
        "FLIP: ours",
        "paper",
        "dots",
    ]);
    let group = |outcome: &Outcome| {
        let recipe = outcome.case.recipe;
        (recipe.surface_name(), recipe.sweep.is_some(), recipe.is_noisy())
    };
    let mut groups: Vec<_> = Vec::new();
    for outcome in outcomes {
        if !groups.contains(&group(outcome)) {
            groups.push(group(outcome));
        }
    }
    for (name, swept, noisy) in groups {
        let members: Vec<_> = outcomes.iter().filter(|outcome| group(outcome) == (name, swept, noisy)).collect();
        let average = |value: &dyn Fn(&Outcome) -> f64, decimals| {
            number(members.iter().map(|outcome| value(outcome)).sum::<f64>() / members.len() as f64, decimals)
        };
        let [ours, paper, dots] = [Method::Ours, Method::Paper, Method::Dots];
        table.row(&[
            [name, if swept { ", swept" } else { "" }, if noisy { ", noisy" } else { "" }].concat(),
            members.len().to_string(),
            average(&|o| of(o, ours, mean), 2),
            average(&|o| of(o, paper, mean), 2),
            average(&|o| o.best_fit(|angles| angles.mean).map_or(f64::NAN, |best| best.1), 2),
            average(&|o| of(o, ours, band), 2),
            average(&|o| of(o, paper, band), 2),
            average(&|o| o.best_fit(|angles| angles.band).map_or(f64::NAN, |best| best.1), 2),
            average(&|o| of(o, ours, |m| m.psnr), 2),
            average(&|o| of(o, paper, |m| m.psnr), 2),
            average(&|o| of(o, dots, |m| m.psnr), 2),
            average(&|o| of(o, ours, |m| m.flip), 3),
            average(&|o| of(o, paper, |m| m.flip), 3),
            average(&|o| of(o, dots, |m| m.flip), 3),
        ]);
    }
    table.finish()
}

fn normals(outcomes: &[Outcome]) -> String {
    let fits = FIT_KS.map(|k| format!("fit {k}"));
    let mut columns = vec![
        "case",
        "ours: mean",
        "median",
        "RMS",
        "< 5°",
        "< 10°",
        "> 90°",
        "flipped",
        "band",
        "paper: mean",
        "> 90°",
        "flipped",
        "band",
        "known: mean",
        "flipped",
        "band",
    ];
    columns.extend(fits.iter().map(String::as_str));
    columns.extend(["best k", "ours / best", "best k, band", "ours / best, band"]);
    let mut table = Table::new(&columns);
    for outcome in outcomes {
        let (Some(ours), Some(paper)) = (outcome.of(Method::Ours), outcome.of(Method::Paper)) else { continue };
        let (Some(ours), Some(paper)) = (ours.angles, paper.angles) else { continue };
        let mut cells = vec![
            outcome.case.name(),
            number(ours.mean, 2),
            number(ours.median, 2),
            number(ours.rms, 2),
            percent(ours.below_5, 1),
            percent(ours.below_10, 1),
            percent(ours.above_90, 2),
            percent(ours.flipped, 2),
            number(ours.band, 2),
            number(paper.mean, 2),
            percent(paper.above_90, 2),
            percent(paper.flipped, 2),
            number(paper.band, 2),
        ];
        let known = outcome.of(Method::Known).and_then(|known| known.angles);
        let known = known.map_or([f64::NAN; 3], |known| [known.mean, 100.0 * known.flipped, known.band]);
        cells.extend(known.map(|value| number(value, 2)));
        cells.extend(FIT_KS.map(|k| number(of(outcome, Method::Fit(k), mean), 2)));
        let best = |value: fn(&crate::measure::Angles) -> f64| {
            let k = outcome.best_fit(value).map_or("–".into(), |best| best.0.to_string());
            [k, number(ratio(outcome, Method::Ours, value).unwrap_or(f64::NAN), 2)]
        };
        cells.extend(best(|angles| angles.mean));
        cells.extend(best(|angles| angles.band));
        table.row(&cells);
    }
    table.finish()
}

fn cover(outcomes: &[Outcome]) -> String {
    let mut table = Table::new(&[
        "case",
        "spacing px",
        "sampled",
        "holes",
        "leaks",
        "before",
        "IoU",
        "wider px",
        "p: holes",
        "leaks",
        "before",
        "IoU",
        "wider px",
        "dots: IoU",
        "known: holes",
        "IoU",
    ]);
    for outcome in outcomes {
        let Some(first) = outcome.of(Method::Ours) else { continue };
        let mut cells = vec![outcome.case.name(), number(first.cover.spacing_px, 2), percent(first.cover.sampled, 1)];
        for measures in [Method::Ours, Method::Paper].into_iter().filter_map(|method| outcome.of(method)) {
            let cover = measures.cover;
            cells.extend([percent(cover.holes, 3), percent(cover.leaks, 3), percent(cover.before, 3)]);
            cells.extend([number(cover.iou, 4), number(cover.wider_px, 2)]);
        }
        cells.push(number(of(outcome, Method::Dots, |measures| measures.cover.iou), 4));
        cells.push(percent(of(outcome, Method::Known, |measures| measures.cover.holes), 3));
        cells.push(number(of(outcome, Method::Known, |measures| measures.cover.iou), 4));
        table.row(&cells);
    }
    table.finish()
}

/// The section about swept points, if there are any.
fn swept(outcomes: &[Outcome]) -> String {
    let methods = [Method::Ours, Method::Paper, Method::Dots];
    let mut table = Table::new(&[
        "case",
        "seen",
        "closed: ours",
        "paper",
        "dots",
        "right: ours",
        "paper",
        "dots",
        "over: ours",
        "paper",
        "dots",
    ]);
    let mut is_any = false;
    for outcome in outcomes {
        let of = |method| outcome.of(method).and_then(|measures| measures.swept);
        let Some(first) = of(Method::Ours) else { continue };
        is_any = true;
        let mut cells = vec![outcome.case.name(), percent(first.seen, 1)];
        let values: [fn(&Swept) -> f64; 3] = [|swept| swept.closed, |swept| swept.right, |swept| swept.over];
        for value in values {
            cells.extend(methods.map(|method| percent(of(method).as_ref().map_or(f64::NAN, value), 2)));
        }
        table.row(&cells);
    }
    if is_any { [SWEPT, &table.finish()].concat() } else { String::new() }
}

fn lit(outcomes: &[Outcome]) -> String {
    let mut table = Table::new(&[
        "case",
        "PSNR: ours",
        "paper",
        "dots",
        "best fit",
        "known",
        "FLIP: ours",
        "paper",
        "dots",
        "best fit",
        "known",
        "depth: ours",
        "paper",
        "dots",
    ]);
    let methods = [Method::Ours, Method::Paper, Method::Dots];
    for outcome in outcomes {
        // The best plane fits are those with the best normals.
        let best = outcome.best_fit(|angles| angles.mean).map(|(k, _)| Method::Fit(k));
        let with_best = || methods.into_iter().chain(best).chain([Method::Known]);
        let mut cells = vec![outcome.case.name()];
        cells.extend(with_best().map(|method| number(of(outcome, method, |measures| measures.psnr), 2)));
        cells.extend(with_best().map(|method| number(of(outcome, method, |measures| measures.flip), 3)));
        cells.extend(methods.map(|method| number(of(outcome, method, |measures| measures.depth_px), 2)));
        table.row(&cells);
    }
    table.finish()
}

fn stills(outcomes: &[Outcome]) -> String {
    let mut table = Table::new(&["case", "truth, one ray", "still", "ours", "paper", "dots", "known", "still - ours"]);
    for outcome in outcomes {
        let Still { one_ray, still, methods } = &outcome.still;
        let of = |method| methods.iter().find(|(other, _)| *other == method).map_or(f64::NAN, |(_, psnr)| *psnr);
        let [ours, paper, dots, known] = [Method::Ours, Method::Paper, Method::Dots, Method::Known].map(of);
        let mut cells = vec![outcome.case.name()];
        cells.extend([*one_ray, *still, ours, paper, dots, known, still - ours].map(|value| number(value, 2)));
        table.row(&cells);
    }
    table.finish()
}

fn motion(outcomes: &[Outcome]) -> String {
    let mut table = Table::new(&[
        "case",
        "normals °: truth",
        "ours",
        "alone",
        "paper",
        "known",
        "lightness: truth",
        "smooth",
        "ours",
        "alone",
        "paper",
        "dots",
        "known",
        "off °: alone",
        "steady",
    ]);
    for outcome in outcomes {
        let Some(motion) = &outcome.motion else { continue };
        let of = |method| motion.methods.iter().find(|(other, _)| *other == method).map(|(_, change)| *change);
        let [ours, paper, dots, known] = [Method::Ours, Method::Paper, Method::Dots, Method::Known].map(of);
        let [truth, alone] = [motion.truth, motion.alone].map(Some);
        let mut cells = vec![outcome.case.name()];
        cells.extend([truth, ours, alone, paper, known].map(|c| number(c.map_or(f64::NAN, |c| c.degrees), 2)));
        let lightness = |change: Option<Change>| number(change.map_or(f64::NAN, |change| change.lightness), 2);
        cells.extend([lightness(truth), number(motion.smooth, 2)]);
        cells.extend([ours, alone, paper, dots, known].map(lightness));
        cells.extend(motion.degrees_off.map(|degrees| number(degrees, 2)));
        table.row(&cells);
    }
    table.finish()
}
