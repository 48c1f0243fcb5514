//! What a frame does with its points: the settings, resolved once for a cloud, a size and a device.
//!
//! # What adapting changes
//! [`Mode::Adaptive`] differs from [`Mode::Paper`] in ten ways. No stage asks for the mode; each gets its rule.
//!
//! 1. `search`: a point with k neighbours may exceed the outlier radius a little ([`SearchRules::lenient`]).
//! 2. `search`: a gap after a single neighbour has to be wider ([`SearchRules::lenient`]).
//! 3. `fit`: outliers are held against the density around them ([`FitRules::compares_density`]).
//! 4. `fit`: surfels on scan lines keep their full length, for `adapt` to turn ([`FitRules::scan_lines`]).
//! 5. `adapt`: noisy surfels move onto larger fits, and those on scan lines turn to their areas ([`Rules::adapt`]).
//! 6. `adapt`: sparse points that lie on no surface become dots or are dropped ([`Rules::adapt`]).
//! 7. `splat`: where noise blurs a border, the density of points trims it (by the noise that `adapt` measures).
//! 8. A margin around the picture holds points that serve as neighbours ([`Rules::margin_px`]).
//! 9. `project`: points near the eye find their neighbours in space ([`ProjectRules::near`]).
//! 10. A cloud too small for a surface is drawn as dots ([`Mode::Dots`]).

use super::Reconstruction;
use crate::adapt::AdaptRules;
use crate::camera::{PICTURE_SIDE_PER_MARGIN, View};
use crate::fit::{FitRules, LONGEST, MIN_SURFACE_POINTS};
use crate::points::Points;
use crate::project::ProjectRules;
use crate::search::{SearchEngine, SearchRules};
use crate::splat::{STEADY_FRAMES, TrimRules};

/// Splat radius of the points of a very small cloud, as a fraction of the picture's shorter side. The drawn dots are
/// 1.4 times as wide.
const DOT_RADIUS_PER_PICTURE_SIDE: f32 = 0.0045;

/// Points sampled to find out how many pixels the cloud's points hit.
const HIT_SAMPLES: usize = 1 << 12;
/// Points are crowded in few pixels if at least this many hit each, on average.
const MIN_CROWD: usize = 16;

/// How a frame makes a surface of its points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Mode {
    /// As in the paper: k neighbours everywhere.
    Paper,
    /// Adapted to noise, scan lines and outliers.
    Adaptive,
    /// Points are dots of a splat radius in pixels. Dots are neither adapted, trimmed nor averaged.
    // Differs from the paper: a handful of points defines no surface. Discs as wide as their distances would hide each
    // other and hide that the points are few. See docs/decisions/0025-handful-as-dots.md.
    Dots(f32),
    /// The planes of the points are given. They are neither searched for, adapted nor averaged.
    Given,
}

impl Mode {
    /// Mode of points without given planes in a picture.
    pub(super) fn of(settings: &Reconstruction, points: Points<'_>, picture: &View) -> Self {
        let all = placed(points, picture);
        let finite = all.filter(|(position, _)| position.iter().all(|along| along.is_finite()));
        if !settings.adaptive {
            Self::Paper
        } else if finite.take(MIN_SURFACE_POINTS).count() == MIN_SURFACE_POINTS && !are_crowded(points, picture) {
            Self::Adaptive
        } else {
            let [width, height] = picture.picture_size();
            Self::Dots(settings.splat_scale * DOT_RADIUS_PER_PICTURE_SIDE * width.min(height) as f32)
        }
    }
}

/// The positions of all points, with the view about their origins.
fn placed(points: Points<'_>, picture: &View) -> impl Iterator<Item = ([f32; 3], View)> {
    points.runs().into_iter().flat_map(move |run| {
        let view = picture.about(run.origin);
        points.positions()[run.first as usize..][..run.len as usize].iter().map(move |&position| (position, view))
    })
}

/// Whether the points are so far away, in clusters, that many of them hit each of a handful of pixels. Such pixels have
/// no neighbours that tell anything of a surface.
fn are_crowded(points: Points<'_>, picture: &View) -> bool {
    let step = points.len().div_ceil(HIT_SAMPLES).max(1);
    let [width, height] = picture.picture_size().map(|side| side as f32);
    let mut seen = 0;
    let mut pixels: Vec<[u32; 2]> = Vec::new();
    for (position, view) in placed(points, picture).step_by(step) {
        let place = view.to_view(position);
        let [x, y] = picture.to_pixel(place);
        if !(place.z > picture.near && (0.0..width).contains(&x) && (0.0..height).contains(&y)) {
            continue;
        }
        seen += 1;
        let pixel = [x as u32, y as u32];
        if !pixels.contains(&pixel) {
            pixels.push(pixel);
            if pixels.len() == MIN_SURFACE_POINTS {
                return false;
            }
        }
    }
    seen >= MIN_CROWD * pixels.len().max(1)
}

/// What each stage of a frame does.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rules {
    /// Width in pixels of the margin around the picture; points in the margin serve as neighbours. Without a margin,
    /// large neighbourhoods would be one-sided along the edges, and noisy surfaces would seem to have borders there.
    /// See docs/decisions/0004-margin.md.
    pub(super) margin_px: u32,
    pub(super) project: ProjectRules,
    /// `None` if planes are given.
    pub(super) search: Option<SearchRules>,
    /// Whether the search starts from the radii of the last frame.
    pub(super) coherent: bool,
    pub(super) fit: FitRules,
    /// `None` leaves surfels as fitted.
    pub(super) adapt: Option<AdaptRules>,
    /// Number of frames over which surfels and pictures are averaged: `[if the points are the same, if they are
    /// others]`. `None` makes each frame by itself.
    pub(super) averaged: Option<[u32; 2]>,
    pub(super) depth_refinement: bool,
    /// `None` leaves silhouettes as wide as their splats.
    pub(super) trim: Option<TrimRules>,
}

impl Rules {
    /// Rules for a picture of `size` pixels. `has_room` states whether the device has memory for a margin of this width
    /// and for a point per half of a pixel.
    pub(super) fn new(
        settings: &Reconstruction,
        mode: Mode,
        size: [u32; 2],
        has_room: impl Fn(u32, bool) -> bool,
    ) -> Self {
        let &Reconstruction { k, engine, outlier_expansions, gap_factor, splat_scale, .. } = settings;
        let is_adaptive = mode == Mode::Adaptive;
        // The paper's engine has one point a pixel and no margin: it leaves one point in a thousand unfinished, and
        // such points beside a picture hide much of it.
        let is_exact = engine.is_exact();
        let halves = is_exact && settings.points_per_pixel == 2;
        let margin_px =
            if is_exact && is_adaptive { size[0].min(size[1]).div_ceil(PICTURE_SIDE_PER_MARGIN) } else { 0 };
        // If memory is short, the margin goes before the halves: it matters along the edges only, halves everywhere.
        let (margin_px, halves) = [(margin_px, halves), (0, halves), (margin_px, false)]
            .into_iter()
            .find(|&(margin_px, halves)| has_room(margin_px, halves))
            .unwrap_or((0, false));
        let keep_outliers = outlier_expansions.is_none();
        let longest = if settings.ellipses { LONGEST } else { 1.0 };
        let of_same = settings.frames_averaged.max(if settings.steady { STEADY_FRAMES } else { 1 });
        let averaged = [of_same, settings.frames_averaged];
        Self {
            margin_px,
            project: ProjectRules { k, halves, grid_culling: settings.grid_culling, near: is_exact && is_adaptive },
            search: (mode != Mode::Given).then_some(SearchRules {
                k,
                outlier_expansions,
                gap_factor,
                lenient: is_adaptive,
            }),
            coherent: settings.coherent && engine == SearchEngine::ScreenGrid && mode != Mode::Given,
            fit: FitRules {
                k,
                splat_scale,
                longest,
                scan_lines: is_adaptive,
                keep_outliers,
                compares_density: is_adaptive,
                dot_px: if let Mode::Dots(radius_px) = mode { Some(radius_px) } else { None },
            },
            adapt: is_adaptive.then_some(AdaptRules { k, longest, keep_outliers }),
            averaged: Some(averaged)
                .filter(|&averaged| averaged != [1; 2] && matches!(mode, Mode::Paper | Mode::Adaptive)),
            depth_refinement: settings.depth_refinement,
            trim: (settings.trim && !matches!(mode, Mode::Dots(_))).then_some(TrimRules {
                // The splat radius is 2/√k k-radii.
                k_radius_per_radius: 0.5 * (k as f32).sqrt() / splat_scale,
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use autosplats_cloud::PointCloud;
    use autosplats_cloud::glam::DVec3;

    use super::*;
    use crate::{Camera, Projection, Renderer, Settings, test_clouds};

    #[test]
    fn memory_that_is_short_costs_the_margin_first() {
        let settings = Reconstruction::default();
        let rules = |room: &dyn Fn(u32, bool) -> bool| {
            let rules = Rules::new(&settings, Mode::Adaptive, [120, 240], room);
            (rules.margin_px, rules.project.halves)
        };
        assert_eq!(rules(&|_, _| true), (10, true));
        assert_eq!(rules(&|margin_px, _| margin_px == 0), (0, true));
        assert_eq!(rules(&|_, halves| !halves), (10, false));
        assert_eq!(rules(&|_, _| false), (0, false), "the device then says what is missing");
    }

    #[test]
    fn a_mode_switches_what_it_says() {
        let settings = Reconstruction { steady: true, ..Reconstruction::default() };
        let rules = |mode| Rules::new(&settings, mode, [100, 100], |_, _| true);
        let [paper, adaptive, dots, given] = [Mode::Paper, Mode::Adaptive, Mode::Dots(3.0), Mode::Given].map(rules);
        assert!(adaptive.adapt.is_some() && adaptive.margin_px > 0 && adaptive.project.near && adaptive.fit.scan_lines);
        for other in [paper, dots, given] {
            assert!(other.adapt.is_none() && other.margin_px == 0 && !other.project.near, "{other:?}");
            assert!(!other.fit.scan_lines, "{other:?}");
        }
        let is_averaged = [paper, adaptive, dots, given].map(|rules| rules.averaged.is_some());
        assert_eq!(is_averaged, [true, true, false, false], "averaged");
        let is_trimmed = [paper, adaptive, dots, given].map(|rules| rules.trim.is_some());
        assert_eq!(is_trimmed, [true, true, false, true], "trimmed");
        assert!(given.search.is_none() && !given.coherent && dots.fit.dot_px == Some(3.0));
    }

    #[test]
    fn k_radii_come_back_from_splat_radii() {
        let cloud = PointCloud::new(DVec3::ZERO, test_clouds::plane(2000));
        let camera = Camera {
            eye: DVec3::new(0.0, 0.0, 3.0),
            look_at: DVec3::ZERO,
            up: DVec3::Y,
            projection: Projection::PerspectiveFovDeg(50.0),
        };
        for (k, splat_scale) in [(10, 1.0), (16, 0.7)] {
            let reconstruction = Reconstruction { k, splat_scale, trim: true, ..Reconstruction::paper() };
            let rules = Rules::new(&reconstruction, Mode::Paper, [300, 200], |_, _| true);
            let per_radius = rules.trim.expect("rules").k_radius_per_radius;
            let mut renderer = Renderer::new();
            let settings = Settings { reconstruction, ..Settings::default() };
            renderer.render(&cloud, &camera, [300, 200], &settings).expect("a picture");
            let surfels = renderer.surfels().expect("surfels");
            let drawn: Vec<_> = surfels.iter().filter(|surfel| surfel.radius > 0.0).collect();
            let is_right =
                |surfel: &&&crate::PointSurfel| (per_radius * surfel.radius / surfel.k_radius - 1.0).abs() < 1e-4;
            let right = drawn.iter().filter(is_right).count();
            // The others have fewer than k neighbours, or several at the k-radius.
            assert!(10 * right > 9 * drawn.len() && right > 500, "k {k}: {right} of {}", drawn.len());
        }
    }
}
