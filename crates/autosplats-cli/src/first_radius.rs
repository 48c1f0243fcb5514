//! `--first-radius`: the first search radius of the kd-tree.

use autosplats::{Camera, Renderer, SearchEngine, Settings, best_first_radius};
use autosplats_cloud::PointCloud;

use crate::console::Console;
use crate::exit::Failure;
use crate::progress::Bar;
use crate::values::FirstRadius;

/// Fraction of the visible points whose k-radius must be exact with the best radius, as in the paper [Paper, §8.1].
pub(crate) const ACCURACY: f64 = 0.999;

/// Sets the best first radius, if `first_radius` asks for it and the engine takes one. A note states the radius.
pub(crate) fn settle_first_radius(
    settings: &mut Settings,
    first_radius: FirstRadius,
    renderer: &mut Renderer,
    cloud: &PointCloud,
    camera: &Camera,
    size: [u32; 2],
    console: &Console,
) -> Result<(), Failure> {
    let takes_one = matches!(settings.reconstruction.engine, SearchEngine::KdTree { .. });
    if first_radius != FirstRadius::Best || !takes_one {
        return Ok(());
    }
    let bar = Bar::spinner("finding the first radius", console);
    let best = best_first_radius(renderer, cloud, camera, size, settings, ACCURACY, &console.goes_on())?;
    drop(bar);
    let [share, asked] = [best.accuracy, ACCURACY].map(|share| 100.0 * share);
    let fails =
        if best.accuracy < ACCURACY { format!("; no tried radius reaches {asked:.1} %") } else { String::new() };
    console.note(format_args!(
        "--first-radius {} finds {share:.2} % of the k-radii in {:.1} ms{fails}",
        best.first_radius, best.search_ms
    ));
    settings.reconstruction.engine = SearchEngine::KdTree { first_radius: best.first_radius };
    Ok(())
}
