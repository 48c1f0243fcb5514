//! Measures one case.

use anyhow::{Context as _, Result};
use autosplats::Reconstruction;

use crate::case::Case;
use crate::exact::Exact;
use crate::light::Lit;
use crate::measure::{Angles, Measures, Truth};
use crate::method::{Method, Painter};
use crate::motion::{Change, Changes, LEAD_IN_STEPS, STEP_DEGREES, STEPS, same};
use crate::picture::Picture;
use crate::still::{self, Still};
use crate::subject::Subject;
use crate::view::orbit;

/// The measures of a case.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The measured case.
    pub case: Case,
    /// Measures of each method's picture.
    pub measures: Vec<(Method, Measures)>,
    /// Lit pictures against the truth of 16 rays per pixel.
    pub still: Still,
    /// Changes while the camera moves, of cases with motion.
    pub motion: Option<Motion>,
}

/// Changes of the pictures while the camera moves.
#[derive(Clone, Debug)]
pub struct Motion {
    /// Change of the true pictures. The light moves with the camera, and details finer than pixels flicker.
    pub truth: Change,
    /// Change of lightness in true pictures of 16 rays per pixel, in 255ths. Their details do not flicker. NaN if only
    /// one ray was traced.
    pub smooth: f64,
    /// Change of each method's pictures. Ours use earlier pictures, as in the window while the view moves. See
    /// docs/decisions/0014-frame-to-frame.md.
    pub methods: Vec<(Method, Change)>,
    /// Change of our pictures if each is rendered by itself.
    pub alone: Change,
    /// Mean error of normals in our picture of the last step, degrees: rendered by itself, and from earlier pictures.
    pub last_normal_errors: [f64; 2],
}

/// The pictures of a case.
#[derive(Debug)]
pub struct Pictures {
    /// The true picture.
    pub truth: Truth,
    /// Each method's picture, also lit.
    pub drawn: Vec<(Method, Picture, Lit)>,
}

/// Draws a case with each of `methods` and measures the pictures.
///
/// # Errors
/// An invalid camera, or an error of the renderer.
pub fn measure(
    case: &Case,
    subject: &Subject,
    painter: &mut Painter<'_>,
    methods: &[Method],
) -> Result<(Outcome, Pictures)> {
    let camera = case.shot.camera(subject, case.size).with_context(|| case.name())?;
    let truth = Truth::new(Exact::trace(subject, &camera, case.size)?);
    let mut measures = Vec::new();
    let mut drawn = Vec::new();
    for &method in methods {
        let picture = painter.paint(method, &camera, case.size).with_context(|| case.name())?;
        let lit = Lit::new(&picture, &truth.exact.rays);
        measures.push((method, truth.measure(&picture, &lit, subject)));
        drawn.push((method, picture, lit));
    }
    let lit = drawn.iter().map(|(method, _, lit)| (*method, lit));
    let still = still::measure(case, subject, painter, &truth, lit)?;
    let motion = if case.motion { Some(movement(case, subject, painter, methods, true)?) } else { None };
    Ok((Outcome { case: *case, measures, still, motion }, Pictures { truth, drawn }))
}

/// Measures changes while the camera of a case moves around its subject. `smooth`: also those of true pictures of 16
/// rays per pixel, which take most of the time.
///
/// # Errors
/// An invalid camera, or an error of the renderer.
pub fn movement(
    case: &Case,
    subject: &Subject,
    painter: &mut Painter<'_>,
    methods: &[Method],
    smooth: bool,
) -> Result<Motion> {
    let camera = case.shot.camera(subject, case.size)?;
    let methods: Vec<_> = methods.iter().copied().filter(|method| !matches!(method, Method::Fit(_))).collect();
    // A renderer of its own: what it keeps of earlier pictures must be of the same settings.
    let mut follower = Painter::new(subject);
    let steady = Reconstruction { steady: true, ..Reconstruction::default() };
    let mut changes = vec![Changes::default(); 3 + methods.len()];
    for step in (1..=LEAD_IN_STEPS).rev() {
        follower.render(steady.clone(), &orbit(&camera, step as f64 * -STEP_DEGREES), case.size)?;
    }
    let mut before: Option<(Exact, Vec<(Picture, Lit)>)> = None;
    for step in 0..=STEPS {
        let camera = orbit(&camera, step as f64 * STEP_DEGREES);
        let exact = Exact::trace_surface(subject, &camera, case.size)?;
        let true_picture = Picture::truth(&exact);
        let lit = |picture: Picture| {
            let lit = Lit::new(&picture, &exact.rays);
            (picture, lit)
        };
        let truth = lit(true_picture.clone());
        let fine = if smooth { (true_picture, still::smooth(subject, &camera, case.size)?) } else { truth.clone() };
        let mut pictures = vec![truth, fine];
        pictures.push(lit(painter.paint(Method::Ours, &camera, case.size)?));
        for &method in &methods {
            pictures.push(match method {
                Method::Ours => follower.render_lit(steady.clone(), &camera, case.size)?,
                _ => lit(painter.paint(method, &camera, case.size)?),
            });
        }
        if let Some((exact_before, before)) = &before {
            let same = same(exact_before, &exact);
            let both = before.iter().zip(&pictures).map(|(one, other)| [(&one.0, &one.1), (&other.0, &other.1)]);
            changes.iter_mut().zip(both).for_each(|(sums, both)| sums.add(&same, both));
        }
        before = Some((exact, pictures));
    }
    let last = Truth::new(Exact::trace(subject, &orbit(&camera, STEPS as f64 * STEP_DEGREES), case.size)?);
    let last_normal_errors = |picture: Option<&(Picture, Lit)>| {
        let angles = picture.and_then(|(picture, lit)| last.measure(picture, lit, subject).angles);
        angles.map_or(f64::NAN, |angles| angles.mean)
    };
    let ours = 3 + methods.iter().position(|&method| method == Method::Ours).unwrap_or(methods.len());
    let last_normal_errors =
        before.map_or([f64::NAN; 2], |(_, shown)| [2, ours].map(|at| last_normal_errors(shown.get(at))));
    let mut means = changes.iter().map(Changes::mean);
    let (Some(truth), Some(fine), Some(alone)) = (means.next(), means.next(), means.next()) else {
        unreachable!("there are at least three changes")
    };
    Ok(Motion {
        truth,
        smooth: if smooth { fine.lightness } else { f64::NAN },
        methods: methods.into_iter().zip(means).collect(),
        alone,
        last_normal_errors,
    })
}

impl Outcome {
    /// The measures of a method's picture, if the method was measured.
    pub fn of(&self, method: Method) -> Option<&Measures> {
        self.measures.iter().find(|(other, _)| *other == method).map(|(_, measures)| measures)
    }

    /// The lowest value of the plane fits, after the number of neighbours that has it.
    pub fn best_fit(&self, value: impl Fn(&Angles) -> f64) -> Option<(usize, f64)> {
        let fits = self.measures.iter().filter_map(|(method, measures)| match method {
            Method::Fit(k) => Some((*k, value(measures.angles.as_ref()?))),
            _ => None,
        });
        fits.min_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// An error of a method's normals over the lowest of the plane fits.
    pub fn over_best_fit(&self, method: Method, value: fn(&Angles) -> f64) -> Option<f64> {
        Some(value(self.of(method)?.angles.as_ref()?) / self.best_fit(value)?.1)
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::case::quick;
    use crate::verdict::Cover;

    /// An outcome in which ours has this error of normals in degrees and this PSNR, and the best plane fits this error.
    /// The paper's picture and dots are worse.
    pub(crate) fn outcome(ours: f64, fit: f64, psnr: f64) -> Outcome {
        let cover =
            Cover { spacing_px: 1.0, sampled: 1.0, iou: 0.999, wider_px: 0.0, holes: 0.0, leaks: 0.0, before: 0.0 };
        let measures = |mean: f64, psnr| {
            let angles = Angles {
                mean,
                median: mean,
                rms: mean,
                below_5: 1.0,
                below_10: 1.0,
                above_90: 0.0,
                flipped: 0.0,
                band: mean,
            };
            Measures { cover, swept: None, angles: Some(angles), depth_px: 0.1, psnr, flip: 0.1 }
        };
        let dots = Measures { angles: None, ..measures(0.0, 20.0) };
        let methods = vec![
            (Method::Ours, measures(ours, psnr)),
            (Method::Paper, measures(9.0, 28.0)),
            (Method::Dots, dots),
            (Method::Fit(10), measures(2.0 * fit, 28.0)),
            (Method::Fit(40), measures(fit, 28.0)),
        ];
        let change = |degrees| Change { degrees, lightness: 1.0 };
        let motion = Motion {
            truth: change(1.0),
            smooth: 1.0,
            methods: vec![(Method::Ours, change(ours))],
            alone: change(ours),
            last_normal_errors: [1.0; 2],
        };
        let still = Still { one_ray: 40.0, still: 33.0, methods: vec![(Method::Ours, psnr)] };
        Outcome { case: quick()[0], measures: methods, still, motion: Some(motion) }
    }
}
