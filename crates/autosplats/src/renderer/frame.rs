//! A frame as the list of its stages, which both backends follow.

use super::Timings;
use super::rules::Rules;
use crate::project::Round;

/// Part of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stage {
    /// Points go to pixels, and are split into active and passive ones.
    Project,
    /// Screen points are summed in cells, passive points too: balls around active points contain them.
    FillCells,
    /// K-radii and moments of the round's points.
    Search(Round),
    /// Moments, or given planes, become surfels.
    Fit(Round),
    /// The first round measures the noise, before any surfel moves. Surfels then move onto larger fits.
    Adapt(Round),
    /// Surfels seen from behind are marked; `Adapt` has turned their normals.
    Orient(Round),
    /// Surfels are averaged with the last frame, whose layers still exist.
    Average(Round),
    /// The round's splats are added to the depth map.
    Draw(Round),
    /// Passive points that the depth map does not hide are the points of the second round.
    Recover,
    /// K-radii and surfels are kept for the next frame.
    Keep,
    /// Depth refinement, attributes, normalisation and trimming.
    Layers,
    /// Light and colour, and the mean with the last picture.
    Shade,
}

impl Stage {
    /// The stages of a frame in order. The two rounds are grid culling [Paper, §7]: only a depth map tells which
    /// passive points are seen.
    pub(super) fn list(rules: &Rules) -> impl Iterator<Item = Self> + use<> {
        let [searches, adapts, averages] = [rules.search.is_some(), rules.adapt.is_some(), rules.averaged.is_some()];
        let round = move |round| {
            [
                (searches, Self::Search(round)),
                (true, Self::Fit(round)),
                (adapts, Self::Adapt(round)),
                (searches, Self::Orient(round)),
                (averages, Self::Average(round)),
                (true, Self::Draw(round)),
            ]
        };
        let first = [(true, Self::Project), (adapts, Self::FillCells)].into_iter().chain(round(Round::Active));
        let second = [(true, Self::Recover)].into_iter().chain(round(Round::Recovered));
        let last = [(searches, Self::Keep), (true, Self::Layers), (true, Self::Shade)];
        first.chain(second).chain(last).filter_map(|(is_on, stage)| is_on.then_some(stage))
    }

    /// The time that this stage counts to.
    pub(super) fn time(self, timings: &mut Timings) -> &mut f64 {
        match self {
            Self::Project => &mut timings.project,
            Self::Search(_) => &mut timings.search,
            Self::Fit(_) | Self::Orient(_) => &mut timings.fit,
            Self::FillCells | Self::Adapt(_) => &mut timings.adapt,
            Self::Average(_) | Self::Draw(_) | Self::Recover | Self::Keep | Self::Layers => &mut timings.splat,
            Self::Shade => &mut timings.shade,
        }
    }
}
