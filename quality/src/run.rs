//! Measures one case.

use anyhow::{Context as _, Result};
use autosplats::Reconstruction;

use crate::case::Case;
use crate::exact::Exact;
use crate::light::Lit;
use crate::measure::{Angles, Measures, Truth};
use crate::method::{Method, Painter};
use crate::motion::{Change, Changes, LEAD_IN, STEP_DEGREES, STEPS, same};
use crate::picture::Picture;
use crate::still::{self, Still};
use crate::subject::Subject;
use crate::view::orbit;

/// A case with what was measured.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The case.
    pub case: Case,
    /// For each of [`Method::ALL`].
    pub measures: Vec<(Method, Measures)>,
    /// Lit pictures against a truth of many rays.
    pub still: Still,
    /// What changed while the camera moved, if it did.
    pub motion: Option<Motion>,
}

/// What changed while the camera moved.
#[derive(Clone, Debug)]
pub struct Motion {
    /// In the true pictures: what light and pixels do.
    pub truth: Change,
    /// The lightness in true pictures of many rays a pixel, in which no detail flickers.
    pub smooth: f64,
    /// In those of each method; ours are steady, as the window has them while the view moves.
    pub methods: Vec<(Method, Change)>,
    /// In ours, each made by itself.
    pub alone: Change,
    /// Mean error of normals in ours of the last step, degrees: by itself, and steady.
    pub degrees_off: [f64; 2],
}

/// The pictures of a case.
#[derive(Debug)]
pub struct Pictures {
    /// What is truly there.
    pub truth: Truth,
    /// What each method drew, and that lit.
    pub drawn: Vec<(Method, Picture, Lit)>,
}

/// Draws a case with each of `methods` and measures the pictures.
///
/// # Errors
/// What the renderer refuses.
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
    let motion = if case.motion { Some(movement(case, subject, painter, methods)?) } else { None };
    Ok((Outcome { case: *case, measures, still, motion }, Pictures { truth, drawn }))
}

/// Moves the camera of a case around its subject and follows what changes.
fn movement(case: &Case, subject: &Subject, painter: &mut Painter<'_>, methods: &[Method]) -> Result<Motion> {
    let camera = case.shot.camera(subject, case.size)?;
    let methods: Vec<_> = methods.iter().copied().filter(|method| !matches!(method, Method::Fit(_))).collect();
    // What is steady follows pictures of its own kind.
    let mut follower = Painter::new(subject);
    let steady = Reconstruction { steady: true, ..Reconstruction::default() };
    let mut changes = vec![Changes::default(); 3 + methods.len()];
    for step in (1..=LEAD_IN).rev() {
        follower.render(steady.clone(), &orbit(&camera, step as f64 * -STEP_DEGREES)?, case.size)?;
    }
    let mut before: Option<(Exact, Vec<(Picture, Lit)>)> = None;
    for step in 0..=STEPS {
        let camera = orbit(&camera, step as f64 * STEP_DEGREES)?;
        let exact = Exact::trace_alone(subject, &camera, case.size)?;
        let true_picture = Picture::truth(&exact);
        let lit = |picture: Picture| {
            let lit = Lit::new(&picture, &exact.rays);
            (picture, lit)
        };
        let smooth = still::smooth(subject, &camera, case.size)?;
        let mut pictures = vec![lit(true_picture.clone()), (true_picture, smooth)];
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
    let last = Truth::new(Exact::trace(subject, &orbit(&camera, STEPS as f64 * STEP_DEGREES)?, case.size)?);
    let degrees_off = |picture: Option<&(Picture, Lit)>| {
        let angles = picture.and_then(|(picture, lit)| last.measure(picture, lit, subject).angles);
        angles.map_or(f64::NAN, |angles| angles.mean)
    };
    let ours = 3 + methods.iter().position(|&method| method == Method::Ours).unwrap_or(methods.len());
    let degrees_off = before.map_or([f64::NAN; 2], |(_, shown)| [2, ours].map(|at| degrees_off(shown.get(at))));
    let mut means = changes.iter().map(Changes::mean);
    let (Some(truth), Some(smooth), Some(alone)) = (means.next(), means.next(), means.next()) else {
        unreachable!("there are three and more")
    };
    Ok(Motion {
        truth,
        smooth: smooth.lightness,
        methods: methods.into_iter().zip(means).collect(),
        alone,
        degrees_off,
    })
}

impl Outcome {
    /// What a method measured, if it was asked to.
    pub fn of(&self, method: Method) -> Option<&Measures> {
        self.measures.iter().find(|(other, _)| *other == method).map(|(_, measures)| measures)
    }

    /// The least of a value over the plane fits, and the number of neighbours that has it.
    pub fn best_fit(&self, value: impl Fn(&Angles) -> f64) -> Option<(usize, f64)> {
        let fits = self.measures.iter().filter_map(|(method, measures)| match method {
            Method::Fit(k) => Some((*k, value(measures.angles.as_ref()?))),
            _ => None,
        });
        fits.min_by(|a, b| a.1.total_cmp(&b.1))
    }
}
