//! The search on the GPU against that on the CPU.

use autosplats_cloud::PointCloud;
use autosplats_cloud::glam::DVec3;

use super::*;
use crate::camera::{Camera, PlacedView, Projection, Reprojection, View};
use crate::gpu::{FrameUniform, read_back, test_gpu};
use crate::project::gpu::tests::{run_round, upload_screen};
use crate::project::gpu::{COUNTERS, Counter};
use crate::project::{ProjectRules, Projector, ScreenPoints};
use crate::search::past::Past;
use crate::search::{LANES, Lanes, NeighborhoodBlock, Neighborhoods, SearchRules, screen_grid};
use crate::test_clouds::{self, EYE, Random};

const KS: [u32; 6] = [1, 3, 10, 16, 17, 64];

/// The frame uniform for a view and rules.
pub(crate) fn frame_buffer(gpu: &Gpu, view: &View, rules: &SearchRules) -> wgpu::Buffer {
    frame_buffer_with(gpu, &told(view, rules))
}

/// The frame uniform after a frame with the same view.
fn frame_buffer_after(gpu: &Gpu, view: &View, rules: &SearchRules) -> wgpu::Buffer {
    let seen = PlacedView { view: *view, origin: DVec3::ZERO };
    frame_buffer_with(gpu, &told(view, rules).after(&Reprojection::new(&seen, &seen).expect("the same camera")))
}

fn told(view: &View, rules: &SearchRules) -> FrameUniform {
    FrameUniform {
        outlier_growth: rules.outlier_radius(1.0),
        gap_growth: rules.gap_factor.map_or(f32::INFINITY, f32::sqrt),
        lenient: rules.lenient.into(),
        // A screen with one point a pixel has more room than points, which bounds window sizes safely.
        halves: 1,
        ..FrameUniform::new(view, rules.k)
    }
}

fn frame_buffer_with(gpu: &Gpu, told: &FrameUniform) -> wgpu::Buffer {
    let frame = gpu.uniform::<FrameUniform>("frame").expect("room");
    gpu.queue.write_buffer(&frame, 0, bytemuck::bytes_of(told));
    frame
}

/// One neighbourhood, independent of host and device layouts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Moments {
    pub(crate) count: f32,
    pub(crate) k_radius: f32,
    pub(crate) offset: [f32; 3],
    /// Second moments xx, xy, xz, yy, yz, zz.
    pub(crate) second: [f32; 6],
}

/// The first `len` neighbourhoods found by the host.
pub(crate) fn host_moments(neighborhoods: &Neighborhoods, len: usize) -> Vec<Moments> {
    (0..len).map(|index| Moments::of_host(neighborhoods, index)).collect()
}

impl Moments {
    fn of_host(neighborhoods: &Neighborhoods, index: usize) -> Self {
        let NeighborhoodBlock { count, k_radius, offset, second } = &neighborhoods.blocks[index / LANES];
        let lane = |lanes: &Lanes| lanes.0[index % LANES];
        Self {
            count: lane(count),
            k_radius: lane(k_radius),
            offset: offset.each_ref().map(lane),
            second: second.each_ref().map(lane),
        }
    }

    pub(crate) fn of_device([x, y, z, count, xx, xy, xz, k_radius, yy, yz, zz, _]: Neighborhood) -> Self {
        Self { count, k_radius, offset: [x, y, z], second: [xx, xy, xz, yy, yz, zz] }
    }

    pub(crate) fn to_device(self) -> [f32; 12] {
        let Self { count, k_radius, offset: [x, y, z], second: [xx, xy, xz, yy, yz, zz] } = self;
        [x, y, z, count, xx, xy, xz, k_radius, yy, yz, zz, 0.0]
    }

    /// Compares with a neighbourhood found by the host.
    pub(crate) fn compare(&self, host: &Self) -> Result<(), String> {
        let ensure = |ok: bool, what: &str| if ok { Ok(()) } else { Err(format!("{what}: {self:?}, host: {host:?}")) };
        // Rounding of a sum of squares and a root.
        ensure((self.k_radius - host.k_radius).abs() <= 1e-6 * host.k_radius, "k-radius")?;
        ensure(self.count == host.count, "count")?;
        ensure(self.has_sums_near(host, 1.0), "sums")
    }

    /// Whether the sums differ by no more than the rounding, so many `times`, of up to `count` additions of terms up to
    /// the radius, squared.
    pub(crate) fn has_sums_near(&self, other: &Self, times: f32) -> bool {
        let near = |a: &[f32], b: &[f32], unit: f32| {
            a.iter().zip(b).all(|(a, b)| (a - b).abs() <= times * 2e-7 * (other.count + 4.0) * unit)
        };
        near(&self.offset, &other.offset, other.k_radius)
            && near(&self.second, &other.second, other.k_radius * other.k_radius)
    }
}

pub(crate) fn cameras() -> [Camera; 2] {
    let camera = |projection| Camera { eye: EYE, look_at: DVec3::ZERO, up: DVec3::new(0.1, -1.0, 0.0), projection };
    [camera(Projection::PerspectiveFovDeg(30.0)), camera(Projection::OrthographicHeight(2.1))]
}

/// All forms of the passes, whichever suits this k.
fn forms(gpu: &Gpu, k: u32) -> [(&'static str, SearchPasses); 3] {
    [("one by one", Form::One), ("by many", Form::OneOrMany), ("four at a time", Form::Four)]
        .map(|(name, form)| (name, SearchPasses::with_form(gpu, k, form).expect("passes")))
}

fn screen(positions: &[[f32; 3]], camera: &Camera, size: [u32; 2], k: u32) -> (ScreenPoints, View) {
    projected(positions, camera, size, &ProjectRules::usual(k))
}

pub(crate) fn projected(
    positions: &[[f32; 3]],
    camera: &Camera,
    size: [u32; 2],
    rules: &ProjectRules,
) -> (ScreenPoints, View) {
    let cloud = PointCloud::new(DVec3::ZERO, positions.to_vec());
    let view = camera.view(DVec3::ZERO, size).expect("a view");
    (Projector::default().project(&cloud, &view, rules, &crate::cancel::NEVER).clone(), view)
}

/// Searches both rounds on the device. Returns the neighbourhoods, and the numbers of clamped and bounded points.
fn on_device(
    gpu: &Gpu,
    passes: &SearchPasses,
    screen: &ScreenPoints,
    view: &View,
    rules: &SearchRules,
    radii: Option<&[f32]>,
) -> (Vec<Moments>, [usize; 2]) {
    let (found, counters) = counted_on_device(gpu, passes, screen, view, rules, radii);
    (found, [Counter::Clamped, Counter::Bounded].map(|counter| counters[counter as usize] as usize))
}

/// Searches both rounds on the device. Returns the neighbourhoods and all counters.
fn counted_on_device(
    gpu: &Gpu,
    passes: &SearchPasses,
    screen: &ScreenPoints,
    view: &View,
    rules: &SearchRules,
    radii: Option<&[f32]>,
) -> (Vec<Moments>, Vec<u32>) {
    let mut buffers = upload_screen(gpu, screen, view);
    let neighborhoods = neighborhood_buffer(gpu, buffers.capacity).expect("room");
    let mut frame = frame_buffer(gpu, view, rules);
    if let Some(radii) = radii {
        frame = frame_buffer_after(gpu, view, rules);
        buffers.past = gpu.storage_with("past", radii).expect("room");
    }
    for round in [Round::Active, Round::Recovered] {
        run_round(gpu, &buffers, round, &passes.steps(gpu, &frame, &buffers, &neighborhoods, round));
    }
    let found: Vec<Neighborhood> = read_back(gpu, &neighborhoods, screen.points.len()).expect("neighbourhoods");
    let counters = read_back(gpu, &buffers.counters, COUNTERS).expect("counters");
    (found.into_iter().map(Moments::of_device).collect(), counters)
}

pub(crate) fn on_host(screen: &ScreenPoints, view: &View, rules: &SearchRules) -> (Vec<Moments>, [usize; 2]) {
    let mut all = Vec::new();
    let mut counted = [0; 2];
    for queries in [&screen.active, &screen.passive] {
        let mut neighborhoods = Neighborhoods::default();
        screen_grid::search(screen, queries, view, rules, &Past::default(), &mut neighborhoods, &crate::cancel::NEVER);
        all.extend(host_moments(&neighborhoods, queries.len()));
        counted[0] += neighborhoods.counts.clamped;
        counted[1] += neighborhoods.counts.bounded;
    }
    (all, counted)
}

#[test]
fn the_device_finds_what_the_host_finds() {
    let Some(gpu) = test_gpu() else { return };
    let (mut compared, mut different) = (0, 0);
    for k in KS {
        let forms = forms(&gpu, k);
        for camera in cameras() {
            let sized = |size| test_clouds::all(4000).into_iter().map(move |(name, cloud)| (name, cloud, size));
            for (name, positions, size) in [[121, 90], [300, 2], [1, 1]].into_iter().flat_map(sized) {
                let (screen, view) = screen(&positions, &camera, size, k);
                for (e0, lambda, lenient) in [
                    (Some(3), Some(4.0), true),
                    (Some(0), Some(4.0), true),
                    (Some(1), Some(4.0), false),
                    (Some(1), None, false),
                    (None, Some(2.0), false),
                    (None, None, false),
                ] {
                    let rules = SearchRules { k, outlier_expansions: e0, gap_factor: lambda, lenient };
                    let case = format!("{name}, {size:?}, {:?}, {rules:?}", camera.projection);
                    let (host, counted_by_host) = on_host(&screen, &view, &rules);
                    for (form, passes) in &forms {
                        let case = format!("{form}, {case}");
                        let (device, counted) = on_device(&gpu, passes, &screen, &view, &rules, None);
                        assert_eq!(device.len(), host.len(), "{case}: every point is a query");
                        for (device, host) in device.iter().zip(&host) {
                            if let Err(error) = device.compare(host) {
                                eprintln!("{case}: {error}");
                                different += 1;
                            }
                        }
                        compared += host.len();
                        for (device, host) in counted.iter().zip(counted_by_host) {
                            let apart = device.abs_diff(host);
                            assert!(apart <= 1, "{case}: counted {counted:?}, host: {counted_by_host:?}");
                        }
                    }
                }
            }
        }
    }
    // Rounding decides a rule's threshold or a tie for few points only.
    assert!(compared > 100_000, "there is something to compare: {compared}");
    assert!(different * 10_000 <= compared, "{different} of {compared} differ");
}

#[test]
fn comparison_sees_each_kind_of_error() {
    let (screen, view) = screen(&test_clouds::edge(4000), &cameras()[0], [121, 90], 10);
    let rules = SearchRules { k: 10, outlier_expansions: Some(1), gap_factor: Some(4.0), lenient: true };
    let right = on_host(&screen, &view, &rules).0[5];
    let [mut offset, mut second] = [right; 2];
    offset.offset[1] += 1e-4 * right.k_radius;
    second.second[3] *= 1.001;
    let wrong = [
        offset,
        second,
        Moments { count: right.count - 1.0, ..right },
        Moments { k_radius: 1.00001 * right.k_radius, ..right },
    ];
    assert_eq!(right.compare(&right), Ok(()), "nothing is wrong yet");
    for moments in wrong {
        assert!(moments.compare(&right).is_err(), "not noticed: {moments:?}");
    }
}

/// A bounded search keeps fewer neighbours, but all points up to its k-radius.
#[test]
fn bounded_searches_stay_exact_as_far_as_they_go() {
    let Some(gpu) = test_gpu() else { return };
    for (k, count) in [(10, 60_000), (64, 30_000)] {
        let (screen, view) = screen(&test_clouds::outliers(count), &cameras()[1], [400, 400], k);
        let rules = SearchRules { k, outlier_expansions: None, gap_factor: None, lenient: true };
        let passes = SearchPasses::new(&gpu, k).expect("passes");
        let (found, [clamped, bounded]) = on_device(&gpu, &passes, &screen, &view, &rules, None);
        let queries = [&screen.active[..], &screen.passive].concat();
        let fewer = found.iter().filter(|found| found.count < k as f32).count();
        assert!(bounded > 0 && clamped <= bounded, "k = {k}: {clamped} clamped, {bounded} bounded");
        assert_eq!(fewer, bounded, "k = {k}: fewer than k neighbours are counted as bounded");
        for (found, &query) in found.iter().zip(&queries).step_by(101) {
            let at = |q: usize| screen.points[q].position_view;
            let squared = |q: usize| (0..3).map(|axis| (at(q)[axis] - at(query as usize)[axis]).powi(2)).sum::<f32>();
            let within = |radius: f32| (0..screen.points.len()).filter(|&q| squared(q).sqrt() <= radius).count() - 1;
            // Rounding decides about the last neighbour.
            let [least, most] = [1.0 - 1e-6, 1.0 + 1e-6].map(|part| within(part * found.k_radius));
            let is_exact = (least..=most).contains(&(found.count as usize)) && most <= least + 1;
            assert!(is_exact, "k = {k}, point {query}: {} of {least} to {most} neighbours", found.count);
        }
    }
}

/// Small pictures can have more screen points than the bound on search work, and than pixels. Searches there end, and
/// at the same radius as on the host.
#[test]
fn crowded_small_pictures_are_bounded_alike() {
    let Some(gpu) = test_gpu() else { return };
    for (size, count) in [([64, 64], 60_000), ([128, 128], 200_000)] {
        let mut positions = test_clouds::plane(count);
        // Outliers in front of the plane, whose neighbours are all far away.
        let to_eye = EYE.as_vec3() * 0.3;
        positions.extend((0..20).map(|i| (to_eye + 0.02 * glam::Vec3::splat(i as f32)).to_array()));
        for k in [10, 64] {
            let (screen, view) = screen(&positions, &cameras()[1], size, k);
            assert!(screen.points.len() > 4096, "{size:?}: {} screen points", screen.points.len());
            let rules = SearchRules { k, outlier_expansions: None, gap_factor: None, lenient: true };
            let counted = on_host(&screen, &view, &rules).1;
            for (form, passes) in forms(&gpu, k) {
                let found = on_device(&gpu, &passes, &screen, &view, &rules, None).1;
                assert_eq!(found, counted, "{size:?}, k = {k}, {form}: clamped and bounded");
            }
        }
    }
}

/// Points whose squared distances overflow are nobody's neighbours, even where every point is asked for.
#[test]
fn huge_coordinates_reach_no_sum() {
    let Some(gpu) = test_gpu() else { return };
    for k in [1, 10, 64] {
        let passes = SearchPasses::new(&gpu, k).expect("passes");
        for (near, huge) in [(1, 0), (1, 40), (5, 1), (200, 40)] {
            let mut positions = test_clouds::sphere(near);
            let forward = (EYE / EYE.z).as_vec3();
            positions.extend((0..huge).map(|i| (forward * (1e38 * (1.0 + 0.01 * i as f32))).to_array()));
            let (screen, view) = screen(&positions, &cameras()[1], [90, 70], k);
            let rules = SearchRules { k, outlier_expansions: None, gap_factor: None, lenient: true };
            let (host, counted) = on_host(&screen, &view, &rules);
            assert_eq!(on_device(&gpu, &passes, &screen, &view, &rules, None).1, counted, "{near} + {huge}, k = {k}");
            for (device, host) in on_device(&gpu, &passes, &screen, &view, &rules, None).0.iter().zip(&host) {
                assert_eq!(device.compare(host), Ok(()), "{near} + {huge} points, k = {k}");
            }
        }
    }
}

/// Windows of tall pictures have many strips, and software devices limit the loop rounds of an invocation.
#[test]
fn tall_pictures_are_searched_to_the_end() {
    let Some(gpu) = test_gpu() else { return };
    let up = DVec3::Y;
    let camera =
        Camera { eye: -4.0 * DVec3::Z, look_at: DVec3::ZERO, up, projection: Projection::OrthographicHeight(2.1) };
    // A column of points at all heights and several depths, dense in the middle.
    let height = |i: usize| (i as f32 / 10_000.0 - 1.0).powi(3);
    let column: Vec<_> = (0..20_000).map(|i| [0.0, height(i), 0.1 * (i % 7) as f32]).collect();
    let sparse = column.iter().step_by(499).copied().collect();
    for (name, positions, size) in [
        ("column", column, [1, 16384]),
        ("sparse column", sparse, [1, 16384]),
        ("outliers", test_clouds::outliers(6000), [1024, 8192]),
        ("edge", test_clouds::edge(30_000), [1024, 8192]),
    ] {
        for k in [10, 64] {
            let (screen, view) = screen(&positions, &camera, size, k);
            for (e0, lambda) in [(Some(1), Some(4.0)), (None, None)] {
                let rules = SearchRules { k, outlier_expansions: e0, gap_factor: lambda, lenient: e0 == Some(3) };
                let (host, counted_by_host) = on_host(&screen, &view, &rules);
                for (form, passes) in forms(&gpu, k) {
                    let case = format!("{form}, {name}, {rules:?}");
                    let (device, counted) = on_device(&gpu, &passes, &screen, &view, &rules, None);
                    let different = device.iter().zip(&host).filter(|(device, host)| device.compare(host).is_err());
                    let different = different.count();
                    assert!(different * 1000 <= host.len(), "{case}: {different} of {} differ", host.len());
                    assert!(
                        counted[1].abs_diff(counted_by_host[1]) <= 1,
                        "{case}: {counted:?}, host: {counted_by_host:?}"
                    );
                }
            }
        }
    }
}

/// More points at exactly the same distance than fit between two final thresholds: all of them belong.
#[test]
fn all_at_the_same_distance_are_neighbours() {
    let Some(gpu) = test_gpu() else { return };
    // The centre of a circle and the 108 points with whole coordinates on it: squares are exact.
    let radius = 1105i32;
    let half = |x: i32| f64::from(radius * radius - x * x).sqrt();
    let whole = (-radius..=radius).filter(|&x| half(x).fract() == 0.0);
    let mut points: Vec<_> = whole.flat_map(|x| [[x as f32, half(x) as f32], [x as f32, -half(x) as f32]]).collect();
    points.push([0.0, 0.0]);
    let positions: Vec<_> = points.iter().map(|[x, y]| [x / 1024.0, y / 1024.0, 0.0]).collect();
    let projection = Projection::OrthographicHeight(2.5);
    let camera = Camera { eye: -4.0 * DVec3::Z, look_at: DVec3::ZERO, up: DVec3::Y, projection };
    for k in [16, 17, 40, 64] {
        let (screen, view) = screen(&positions, &camera, [700, 700], k);
        let queries = [&screen.active[..], &screen.passive].concat();
        let is_middle = |&query: &u32| screen.points[query as usize].position_view[..2] == [0.0, 0.0];
        let middle = queries.iter().position(is_middle).expect("the middle");
        for (e0, lambda) in [(Some(1), Some(4.0)), (None, None)] {
            let rules = SearchRules { k, outlier_expansions: e0, gap_factor: lambda, lenient: e0 == Some(3) };
            let (host, _) = on_host(&screen, &view, &rules);
            assert!(lambda.is_some() || host[middle].count > 100.0, "{rules:?}: {:?}", host[middle]);
            for (form, passes) in forms(&gpu, k) {
                let (device, _) = on_device(&gpu, &passes, &screen, &view, &rules, None);
                for (device, host) in device.iter().zip(&host) {
                    assert_eq!(device.compare(host), Ok(()), "{form}, {rules:?}");
                }
            }
        }
    }
}

/// The radii of the last frame do not change the result by a single bit.
#[test]
fn the_past_changes_nothing() {
    let Some(gpu) = test_gpu() else { return };
    let mut random = Random::new(5);
    for k in [1, 10, 17] {
        let forms = forms(&gpu, k);
        for (name, positions) in test_clouds::all(4000) {
            let (screen, view) = screen(&positions, &cameras()[0], [121, 90], k);
            let pasts = [past::tests::found(&screen, &view, k), past::tests::garbage(&screen, &view, k, &mut random)];
            for (e0, lambda) in [(Some(1), Some(4.0)), (None, None)] {
                let rules = SearchRules { k, outlier_expansions: e0, gap_factor: lambda, lenient: e0 == Some(3) };
                for (form, passes) in &forms {
                    let without = on_device(&gpu, passes, &screen, &view, &rules, None);
                    for radii in &pasts {
                        let with = on_device(&gpu, passes, &screen, &view, &rules, Some(radii));
                        assert!(with == without, "{form}, {name}, {rules:?}");
                    }
                }
            }
        }
    }
}

/// Workgroups sum in the order of single invocations. Some queries are left to them, most are not.
#[test]
fn one_and_many_give_the_same_bits() {
    let Some(gpu) = test_gpu() else { return };
    let (mut searched, mut left) = (0, 0);
    for k in [1, 10] {
        let forms = [Form::One, Form::OneOrMany].map(|form| SearchPasses::with_form(&gpu, k, form).expect("passes"));
        for camera in cameras() {
            let sized = |size| test_clouds::all(10_000).into_iter().map(move |(name, cloud)| (name, cloud, size));
            for (name, positions, size) in [[121, 90], [40, 300]].into_iter().flat_map(sized) {
                let (screen, view) = screen(&positions, &camera, size, k);
                for (e0, lambda) in [(Some(1), Some(4.0)), (None, None)] {
                    let rules = SearchRules { k, outlier_expansions: e0, gap_factor: lambda, lenient: true };
                    let [one, many] = forms.each_ref().map(|form| {
                        let (found, mut counters) = counted_on_device(&gpu, form, &screen, &view, &rules, None);
                        let given = [Counter::LeftActive, Counter::LeftRecovered]
                            .map(|counter| std::mem::take(&mut counters[counter as usize]));
                        let bits = |moments: Moments| moments.to_device().map(f32::to_bits);
                        (found.into_iter().map(bits).collect::<Vec<_>>(), counters, given)
                    });
                    let case = format!("{name}, {size:?}, {:?}, {rules:?}", camera.projection);
                    assert!(one.0 == many.0, "{case}: neighbourhoods");
                    assert_eq!(one.1, many.1, "{case}: counters");
                    searched += many.0.len() as u32;
                    left += many.2.iter().sum::<u32>();
                }
            }
        }
    }
    assert!(100 < left && left < searched / 2, "{left} of {searched} queries are left to workgroups");
}
