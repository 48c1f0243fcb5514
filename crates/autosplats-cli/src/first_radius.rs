//! `--first-radius`: the first search radius of the kd-tree.

use std::str::FromStr;

use autosplats::{Camera, Renderer, SearchEngine, Settings, best_first_radius};
use autosplats_cloud::PointCloud;

use crate::exit::Failure;
use crate::progress::Bar;
use crate::render::render_failure;

/// Fraction of the visible points whose k-radius must be exact with the best radius, as in the paper [Paper, §8.1].
const ACCURACY: f64 = 0.999;

/// A radius such as `0.05`, or `best`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum FirstRadius {
    /// The fastest radius of sufficient accuracy, found by trials.
    Best,
    /// A radius in the input's units.
    Radius(f32),
}

impl FromStr for FirstRadius {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.parse() {
            _ if text == "best" => Ok(Self::Best),
            Ok(radius) if radius > 0.0 && f32::is_finite(radius) => Ok(Self::Radius(radius)),
            _ => Err("must be a number above 0, or 'best'".into()),
        }
    }
}

impl FirstRadius {
    /// The radius, or a valid placeholder while the best one is unknown.
    pub(crate) fn unless_best(self) -> f32 {
        match self {
            Self::Best => 1.0,
            Self::Radius(radius) => radius,
        }
    }

    /// Returns the settings with the best first radius, if it was asked for and the engine takes a first radius. A note
    /// states the radius.
    pub(crate) fn settle(
        self,
        renderer: &mut Renderer,
        cloud: &PointCloud,
        camera: &Camera,
        size: [u32; 2],
        settings: &Settings,
        quiet: bool,
    ) -> Result<Settings, Failure> {
        let mut settings = settings.clone();
        let takes_one = matches!(settings.reconstruction.engine, SearchEngine::KdTree { .. });
        if self != Self::Best || !takes_one {
            return Ok(settings);
        }
        let bar = Bar::spinner("finding the first radius", quiet);
        let best = best_first_radius(renderer, cloud, camera, size, &settings, ACCURACY).map_err(render_failure)?;
        drop(bar);
        if !quiet {
            let [share, asked] = [best.accuracy, ACCURACY].map(|share| 100.0 * share);
            let fails = if best.accuracy < ACCURACY {
                format!("; no tried radius reaches {asked:.1} %")
            } else {
                String::new()
            };
            eprintln!(
                "note: --first-radius {} finds {share:.2} % of the k-radii in {:.1} ms{fails}",
                best.first_radius, best.search_ms
            );
        }
        settings.reconstruction.engine = SearchEngine::KdTree { first_radius: best.first_radius };
        Ok(settings)
    }
}
