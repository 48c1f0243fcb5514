//! The fit on the GPU against the fit on the CPU.

use autosplats_cloud::PointCloud;
use autosplats_cloud::glam::{DMat3, DVec3};

use super::*;
use crate::camera::{Camera, Projection, View};
use crate::fit::alone::FEW_NEIGHBORS;
use crate::fit::tests::eigenvalues;
use crate::fit::{FitRules, LONGEST, Surfels, fit};
use crate::gpu::{FrameUniform, read_back, test_gpu};
use crate::project::gpu::tests::{run_round, upload_screen};
use crate::project::gpu::{COUNTERS, Counter};
use crate::project::{ProjectRules, Projector, ScreenPoints};
use crate::search::past::Past;
use crate::search::screen_grid::gpu::tests::{Moments, host_moments};
use crate::search::{Neighborhoods, SearchRules, screen_grid};
use crate::test_clouds::{self, EYE, Random};

const RULES: FitRules = FitRules {
    k: 10,
    splat_scale: 1.0,
    longest: LONGEST,
    scan_lines: false,
    keep_outliers: false,
    compares_density: false,
    dot_px: None,
};

/// Screen points, with the neighbourhoods of the active and of the passive points.
struct Case {
    screen: ScreenPoints,
    view: View,
    neighborhoods: [Neighborhoods; 2],
}

impl Case {
    fn new(positions: &[[f32; 3]], projection: Projection, gap_factor: Option<f32>) -> Self {
        let camera = Camera { eye: EYE, look_at: DVec3::ZERO, up: DVec3::new(0.1, -1.0, 0.0), projection };
        let view = camera.view(DVec3::ZERO, [121, 90]).expect("a view");
        let cloud = PointCloud::new(DVec3::ZERO, positions.to_vec());
        let screen =
            Projector::default().project(&cloud, &view, &ProjectRules::usual(RULES.k), &crate::cancel::NEVER).clone();
        let rules = SearchRules { k: RULES.k, outlier_expansions: Some(1), gap_factor, lenient: true };
        let neighborhoods = [&screen.active, &screen.passive].map(|queries| {
            let mut neighborhoods = Neighborhoods::default();
            screen_grid::search(
                &screen,
                queries,
                &view,
                &rules,
                &Past::default(),
                &mut neighborhoods,
                &crate::cancel::NEVER,
            );
            neighborhoods
        });
        Self { screen, view, neighborhoods }
    }

    fn moments(&self) -> Vec<Moments> {
        let [active, passive] = &self.neighborhoods;
        let mut all = host_moments(active, self.screen.active.len());
        all.extend(host_moments(passive, self.screen.passive.len()));
        all
    }

    fn on_host(&self, rules: &FitRules) -> Surfels {
        let mut surfels = Surfels::new();
        for (queries, neighborhoods) in [&self.screen.active, &self.screen.passive].into_iter().zip(&self.neighborhoods)
        {
            fit(&self.screen, queries, neighborhoods, &self.view, rules, &mut surfels, &crate::cancel::NEVER);
        }
        surfels
    }

    /// The greatest k-radius of each pixel's points that found k neighbours; 0 where none did.
    fn kept(&self, surfels: &[Surfel], moments: &[Moments]) -> Vec<f32> {
        let mut kept = vec![0.0_f32; self.view.width as usize * self.view.height as usize];
        for (surfel, moments) in surfels.iter().zip(moments) {
            let point = &self.screen.points[surfel.screen() as usize];
            if moments.count >= RULES.k as f32 && !point.is_near() {
                let [x, y] = point.pixel_xy();
                let kept = &mut kept[y * self.view.width as usize + x];
                *kept = kept.max(moments.k_radius);
            }
        }
        kept
    }

    /// Surfels of both rounds, the number counted as outliers, and the k-radii kept for each pixel.
    fn on_device(&self, gpu: &Gpu, pass: &FitPass, rules: &FitRules) -> (Surfels, usize, Vec<f32>) {
        let buffers = upload_screen(gpu, &self.screen, &self.view).keeping_past(gpu).expect("room");
        let moments: Vec<_> = self.moments().iter().map(|moments| moments.to_device()).collect();
        let neighborhoods = gpu.storage_with("neighbourhoods", &moments).expect("room");
        let surfels = surfel_buffer(gpu, buffers.capacity).expect("room");
        let told = FrameUniform {
            splat_scale: rules.splat_scale,
            longest: rules.longest,
            keep_outliers: rules.keep_outliers.into(),
            scan_lines: rules.scan_lines.into(),
            compares_density: rules.compares_density.into(),
            dot_px: rules.dot_px.unwrap_or(0.0),
            ..FrameUniform::new(&self.view, rules.k)
        };
        let frame = gpu.uniform::<FrameUniform>("frame").expect("room");
        gpu.queue.write_buffer(&frame, 0, bytemuck::bytes_of(&told));
        for round in [Round::Active, Round::Recovered] {
            let step = pass.step(gpu, &frame, &buffers, &neighborhoods, &surfels, round);
            run_round(gpu, &buffers, round, &[step]);
        }
        let counters: Vec<u32> = read_back(gpu, &buffers.counters, COUNTERS).expect("counters");
        let surfels = read_back(gpu, &surfels, moments.len()).expect("surfels");
        let pixels = self.view.width as usize * self.view.height as usize;
        let mut kept: Vec<f32> = read_back(gpu, &buffers.past, 2 * pixels).expect("k-radii");
        (surfels, counters[Counter::Outliers as usize] as usize, kept.split_off(pixels))
    }
}

/// Covariance in squared k-radii.
fn covariance(moments: &Moments) -> DMat3 {
    let share = 1.0 / (f64::from(moments.count) + 1.0);
    let unit = 1.0 / f64::from(moments.k_radius).max(1e-38);
    let mean = DVec3::from(moments.offset.map(f64::from)) * (unit * share);
    let [xx, xy, xz, yy, yz, zz] = moments.second.map(|term| f64::from(term) * unit * unit * share);
    let second = DMat3::from_cols(DVec3::new(xx, xy, xz), DVec3::new(xy, yy, yz), DVec3::new(xz, yz, zz));
    second - DMat3::from_cols(mean * mean.x, mean * mean.y, mean * mean.z)
}

fn compare(device: &Surfel, host: &Surfel, moments: &Moments) -> Result<(), String> {
    let ensure = |ok: bool, what: &str| if ok { Ok(()) } else { Err(format!("{what}: {device:?}, host: {host:?}")) };
    let of_point = |surfel: &Surfel| (surfel.center, surfel.k_radius, surfel.pixel, surfel.source, surfel.screen());
    ensure(of_point(device) == of_point(host), "what is only copied")?;
    // Rounding of a quotient and a root.
    ensure((device.radius - host.radius).abs() <= 1e-6 * host.radius, "radius")?;
    let vector = |v: [f32; 3]| DVec3::from(v.map(f64::from));
    let [normal, major] = [device.normal, device.major_axis].map(vector);
    ensure((normal.length() - 1.0).abs() < 1e-5 && (major.length() - 1.0).abs() < 1e-5, "lengths of axes")?;
    ensure(normal.dot(major).abs() < 1e-5, "the major axis is not in the disc's plane")?;
    // Eigenvectors of nearly equal eigenvalues are arbitrary, but the variance along them is not. The tolerance is f32
    // rounding of moments with the mean subtracted, and of some hundred operations.
    const TOLERANCE: f64 = 4e-6;
    let covariance = covariance(moments);
    let variance = |direction: DVec3| direction.dot(covariance * direction);
    let like_host = |a: [f32; 3], b: [f32; 3]| (variance(vector(a)) - variance(vector(b))).abs() < TOLERANCE;
    ensure(like_host(device.normal, host.normal), "variance along the normal")?;
    let [least, middle, largest] = eigenvalues(covariance);
    let is_plane = middle > 1.5e-5 * largest;
    ensure(!is_plane || like_host(device.major_axis, host.major_axis), "variance along the major axis")?;
    let is_line = middle < 0.5e-5 * largest;
    let angle = (normal - vector(host.normal)).length();
    // The tolerance above, divided by the distance to the next eigenvalue.
    ensure(!(is_line || middle - least > 2e-3 * largest) || angle < 4e-3, "normal")?;
    let near = |a: f32, b: f32, tolerance: f64| f64::from((a - b).abs()) <= tolerance;
    ensure(near(device.curvature, host.curvature, TOLERANCE / largest.max(TOLERANCE)), "curvature")?;
    let tolerance = if is_plane { 4.0 * TOLERANCE / middle } else { f64::from(LONGEST) };
    ensure(near(device.major_ratio, host.major_ratio, tolerance), "ratio of axes")
}

#[test]
fn the_device_fits_what_the_host_fits() {
    let Some(gpu) = test_gpu() else { return };
    let pass = FitPass::new(&gpu).expect("a pass");
    let (mut compared, mut outliers, mut different) = (0, 0, 0);
    for (name, positions) in test_clouds::all(4000) {
        for projection in [Projection::PerspectiveFovDeg(30.0), Projection::OrthographicHeight(2.1)] {
            for gap_factor in [Some(4.0), None] {
                let case = Case::new(&positions, projection, gap_factor);
                let moments = case.moments();
                for (longest, keep_outliers, splat_scale) in [(LONGEST, false, 1.0), (1.0, true, 0.7)] {
                    let rules = FitRules { longest, keep_outliers, splat_scale, ..RULES };
                    let host = case.on_host(&rules);
                    let (device, counted, kept) = case.on_device(&gpu, &pass, &rules);
                    assert_eq!(device.len(), host.len(), "{name}: every query gives a surfel");
                    assert!(kept == case.kept(&host, &moments), "{name}, {projection:?}: other k-radii are kept");
                    for ((device, host), moments) in device.iter().zip(&host).zip(&moments) {
                        let outcome = compare(device, host, moments);
                        different += usize::from(outcome.is_err());
                        outcome.unwrap_or_else(|error| eprintln!("{name}, {projection:?}, {rules:?}: {error}"));
                    }
                    let expected = device.iter().filter(|surfel| surfel.is_dropped()).count();
                    assert_eq!(counted, expected, "{name}: outliers of both rounds are counted");
                    compared += host.len();
                    outliers += counted;
                }
            }
        }
    }
    assert!(compared > 50_000 && outliers > 50, "there is something to compare: {compared}, {outliers} outliers");
    // Rounding decides whether a few neighbourhoods are lopsided, or a line.
    assert!(different * 10_000 <= compared, "{different} of {compared} differ");
}

#[test]
fn the_device_makes_the_dots_that_the_host_makes() {
    let Some(gpu) = test_gpu() else { return };
    let pass = FitPass::new(&gpu).expect("a pass");
    for projection in [Projection::PerspectiveFovDeg(30.0), Projection::OrthographicHeight(2.1)] {
        let case = Case::new(&test_clouds::sphere(40), projection, Some(4.0));
        let rules = FitRules { dot_px: Some(7.0), ..RULES };
        let host = case.on_host(&rules);
        let (device, dropped, _) = case.on_device(&gpu, &pass, &rules);
        assert!(host.len() > 10 && dropped == 0, "{dropped} of {} are dropped", host.len());
        for (device, host) in device.iter().zip(&host) {
            let px = host.radius / case.view.pixel_size(host.center[2]);
            assert!((px - 7.0).abs() < 1e-3 && host.major_ratio == 1.0, "{px} pixels, {host:?}");
            let [a, b] =
                [device, host].map(|surfel| [surfel.normal, [surfel.radius, surfel.major_ratio, 0.0]].concat());
            assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 1e-5), "{a:?}, on the host {b:?}");
            let to_eye = case.view.to_eye(host.center.into()).normalize();
            assert!(to_eye.dot(host.normal.into()) > 0.9999, "faces the eye");
        }
    }
}

/// Comparing with the density around drops more points, with few neighbours and with many.
#[test]
fn the_device_drops_what_the_host_drops() {
    let Some(gpu) = test_gpu() else { return };
    let pass = FitPass::new(&gpu).expect("a pass");
    let mut random = Random::new(3);
    let mut positions = test_clouds::sphere(4000);
    positions.extend((0..3000).map(|_| random.direction().map(|c| c * (1.0 + 0.5 * random.unit()))));
    let case = Case::new(&positions, Projection::PerspectiveFovDeg(30.0), Some(4.0));
    let plain = case.on_host(&RULES);
    let rules = FitRules { scan_lines: true, compares_density: true, ..RULES };
    let host = case.on_host(&rules);
    let (device, counted, _) = case.on_device(&gpu, &pass, &rules);
    let is_dropped = |surfel: &Surfel| surfel.is_dropped();
    let same = host.iter().zip(&device).filter(|(host, device)| is_dropped(host) == is_dropped(device)).count();
    assert!(host.len() - same <= 1, "{same} of {} are dropped alike", host.len());
    assert_eq!(counted, device.iter().filter(|surfel| is_dropped(surfel)).count(), "outliers are counted");
    let more = host.iter().zip(&plain).zip(case.moments()).filter(|((host, plain), _)| host.radius < plain.radius);
    let (few, many): (Vec<_>, Vec<_>) = more.partition(|(_, moments)| moments.count < FEW_NEIGHBORS);
    assert!(few.len() >= 5 && many.len() > 20, "{} with few, {} with many neighbours", few.len(), many.len());
}

#[test]
fn comparison_sees_each_kind_of_error() {
    let case = Case::new(&test_clouds::edge(4000), Projection::PerspectiveFovDeg(30.0), Some(4.0));
    let moments = case.moments();
    let surfels = case.on_host(&RULES);
    let right = surfels[5];
    let wrong = [
        Surfel { normal: right.normal.map(|c| -c), ..right },
        Surfel { normal: right.major_axis, major_axis: right.normal, ..right },
        Surfel { major_axis: surfels[6].major_axis, ..right },
        Surfel { normal: right.normal.map(|c| 1.001 * c), ..right },
        Surfel { radius: 1.001 * right.radius, ..right },
        Surfel { k_radius: 1.001 * right.k_radius, ..right },
        Surfel { curvature: right.curvature + 1e-3, ..right },
        Surfel { major_ratio: 1.01 * right.major_ratio, ..right },
        Surfel { pixel: 0, ..right },
        Surfel { screen_and_flags: right.screen_and_flags + 1, ..right },
    ];
    assert_eq!(compare(&right, &right, &moments[5]), Ok(()), "nothing is wrong yet");
    for surfel in wrong {
        assert!(compare(&surfel, &right, &moments[5]).is_err(), "not noticed: {surfel:?}");
    }
}
