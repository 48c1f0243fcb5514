//! `--first-radius`: what the kd-tree search begins with.

use std::str::FromStr;

use autosplats::{Camera, Renderer, SearchEngine, Settings, best_first_radius};
use autosplats_cloud::PointCloud;

use crate::exit::Failure;
use crate::progress::Bar;
use crate::render::render_failure;

/// Share of the visible points whose k-radius has to be exact with the best one: the paper's 99.9 % [Paper, §8.1].
const ACCURACY: f64 = 0.999;

/// `0.05` or `best`
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum FirstRadius {
    /// The fastest that is accurate, found by trying.
    Best,
    /// In the input's units.
    Radius(f32),
}

impl FromStr for FirstRadius {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.parse() {
            _ if text == "best" => Ok(Self::Best),
            Ok(radius) if radius > 0.0 && f32::is_finite(radius) => Ok(Self::Radius(radius)),
            _ => Err("a radius is a number above 0, or 'best'".into()),
        }
    }
}

impl FirstRadius {
    /// The radius, or any that is allowed for as long as the best one is not known.
    pub(crate) fn unless_best(self) -> f32 {
        match self {
            Self::Best => 1.0,
            Self::Radius(radius) => radius,
        }
    }

    /// The settings with the best first radius, if that is what was asked for and the engine takes one; a note says which.
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
        let bar = Bar::spinner("trying first radii", quiet);
        let best = best_first_radius(renderer, cloud, camera, size, &settings, ACCURACY).map_err(render_failure)?;
        drop(bar);
        if !quiet {
            let [share, asked] = [best.accuracy, ACCURACY].map(|share| 100.0 * share);
            let fails = if best.accuracy < ACCURACY {
                format!("; none of those tried reaches {asked:.1} %")
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
