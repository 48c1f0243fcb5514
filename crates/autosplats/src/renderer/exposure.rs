//! Exposure: the brightness at which the points' colours are shown.

use autosplats_cloud::PointCloud;

use crate::shade::{Shading, linear_steps};

/// Number of points in the sample.
const COLOR_SAMPLES: usize = 1 << 12;
/// Target of the brightest channel of the brightest colours, in linear light. Well exposed scans reach at least this
/// without help.
const TARGET_BRIGHTNESS: f32 = 0.4;
/// Quantile of the colours that counts as brightest. Brighter colours, such as lamps and highlights, are ignored.
const BRIGHT_QUANTILE: f32 = 0.95;
/// Largest exposure. Still darker colours are noise.
const MAX_EXPOSURE: f32 = 8.0;

/// Factor on a cloud's own colours if [`Shading::exposure`] is `None`. The factor is 1, or up to 8 if all colours are
/// dark, as in a cellar scanned without a flash. Black points and clouds without colours are ignored.
///
/// # Examples
///
/// ```
/// use autosplats::{cloud::{PointCloud, glam::DVec3}, usual_exposure};
///
/// let of_grey = |grey| {
///     let cloud = PointCloud::new(DVec3::ZERO, vec![[0.0; 3]; 100]);
///     Ok::<_, autosplats::cloud::Error>(usual_exposure(&cloud.with_colors(vec![[grey; 3]; 100])?))
/// };
/// assert_eq!(of_grey(220)?, 1.0);
/// assert!(of_grey(60)? > 4.0);
/// # Ok::<(), autosplats::cloud::Error>(())
/// ```
#[must_use]
pub fn usual_exposure(cloud: &PointCloud) -> f32 {
    let Some(colors) = cloud.colors() else { return 1.0 };
    let step = colors.len().div_ceil(COLOR_SAMPLES).max(1);
    let sample = colors.iter().step_by(step).map(|color| color.iter().copied().max().unwrap_or(0));
    let mut brightest: Vec<u8> = sample.filter(|&channel| channel > 0).collect();
    if brightest.is_empty() {
        return 1.0;
    }
    let at = (brightest.len() as f32 * BRIGHT_QUANTILE) as usize;
    let (_, &mut channel, _) = brightest.select_nth_unstable(at);
    (TARGET_BRIGHTNESS / linear_steps()[usize::from(channel)]).clamp(1.0, MAX_EXPOSURE)
}

/// Cache of the last cloud's exposure, because estimation reads thousands of points.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Exposure {
    found: Option<(u64, f32)>,
}

impl Exposure {
    /// Exposure of a cloud's colours: the setting, or else the estimate.
    pub(super) fn of(&mut self, cloud: &PointCloud, shading: &Shading) -> f32 {
        let identity = cloud.identity();
        shading.exposure.unwrap_or_else(|| match self.found {
            Some((known, exposure)) if known == identity => exposure,
            _ => {
                let exposure = usual_exposure(cloud);
                self.found = Some((identity, exposure));
                exposure
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use autosplats_cloud::glam::DVec3;

    use super::*;

    fn cloud(colors: Vec<[u8; 3]>) -> PointCloud {
        PointCloud::new(DVec3::ZERO, vec![[0.0; 3]; colors.len()]).with_colors(colors).expect("as many")
    }

    #[test]
    fn dark_colours_are_lifted_and_others_left() {
        let gray = |level| cloud(vec![[level; 3]; 500]);
        assert_eq!(usual_exposure(&PointCloud::new(DVec3::ZERO, vec![[0.0; 3]])), 1.0, "no colours");
        assert_eq!(usual_exposure(&gray(0)), 1.0, "black");
        assert_eq!(usual_exposure(&gray(200)), 1.0, "bright");
        assert_eq!(usual_exposure(&cloud(vec![[0, 0, 255]; 500])), 1.0, "blue is dark, and as bright as it gets");
        assert_eq!(usual_exposure(&gray(1)), MAX_EXPOSURE, "next to nothing");
        let dark = usual_exposure(&gray(80));
        assert!((4.0..6.0).contains(&dark), "{dark}");
        let lamps = [vec![[80; 3]; 480], vec![[255; 3]; 20]].concat();
        assert_eq!(usual_exposure(&cloud(lamps)), dark, "lamps tell nothing");
        let unknown = [vec![[80; 3]; 100], vec![[0; 3]; 9900]].concat();
        assert_eq!(usual_exposure(&cloud(unknown)), dark, "nor do points without a colour");
    }

    #[test]
    fn what_is_asked_for_counts_more() {
        let dark = cloud(vec![[80; 3]; 500]);
        let by = |exposure| Shading { exposure, ..Shading::default() };
        let mut known = Exposure::default();
        assert_eq!(known.of(&dark, &by(None)), usual_exposure(&dark));
        assert_eq!(known.of(&cloud(vec![[250; 3]; 500]), &by(None)), 1.0, "of another cloud");
        assert_eq!(known.of(&dark, &by(Some(2.5))), 2.5, "as asked for");
    }
}
