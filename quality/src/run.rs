//! Measures one case.

use anyhow::{Context as _, Result};

use crate::case::Case;
use crate::exact::Exact;
use crate::light::Lit;
use crate::measure::{Angles, Measures};
use crate::method::{Method, Painter};
use crate::picture::Picture;
use crate::subject::Subject;

/// A case with what was measured.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The case.
    pub case: Case,
    /// For each of [`Method::ALL`].
    pub measures: Vec<(Method, Measures)>,
}

/// The pictures of a case.
#[derive(Debug)]
pub struct Pictures {
    /// What is truly there.
    pub exact: Exact,
    /// That, lit.
    pub truth: Lit,
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
    let exact = Exact::trace(subject, &camera, case.size)?;
    let band = exact.band();
    let truth = Lit::new(&Picture::truth(&exact), &exact.rays);
    let mut measures = Vec::new();
    let mut drawn = Vec::new();
    for &method in methods {
        let picture = painter.paint(method, &camera, case.size).with_context(|| case.name())?;
        let lit = Lit::new(&picture, &exact.rays);
        measures.push((method, Measures::new(&exact, &band, &truth, &picture, &lit, subject)));
        drawn.push((method, picture, lit));
    }
    Ok((Outcome { case: *case, measures }, Pictures { exact, truth, drawn }))
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
