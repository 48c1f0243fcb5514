//! Splat communication against the screen grid on the host, and its two forms against each other.

use autosplats_cloud::glam::DVec3;

use super::gpu::{ITERATIONS, UNCONVERGED};
use super::raster::{GATHERED_BYTES, Textures};
use super::{compute, raster};
use crate::camera::{Camera, Projection, View};
use crate::gpu::{Gpu, read_back, test_gpu};
use crate::project::DeviceCloud;
use crate::project::gpu::tests::{run_round, upload_screen};
use crate::project::gpu::{COUNTERS, Counter, Round};
use crate::project::{ProjectRules, ScreenPoints};
use crate::search::SearchRules;
use crate::search::engine::{EnginePasses, SearchBuffers};
use crate::search::gpu::convergence;
use crate::search::screen_grid::gpu::neighborhood_buffer;
use crate::search::screen_grid::gpu::tests::{Moments, cameras, frame_buffer, on_host, projected};
use crate::test_clouds;

const SIZE: [u32; 2] = [121, 90];

/// The passes of both forms.
struct Forms {
    raster: raster::CommunicationPasses,
    compute: compute::CommunicationPasses,
}

impl Forms {
    fn new(gpu: &Gpu) -> Self {
        Self {
            raster: raster::CommunicationPasses::new(gpu).expect("passes"),
            compute: compute::CommunicationPasses::new(gpu).expect("passes"),
        }
    }
}

/// The result of one frame's search.
#[derive(Clone)]
struct Found {
    /// Neighbourhoods of the active points, then of the passive.
    neighborhoods: Vec<Moments>,
    clamped: usize,
    bounded: usize,
    /// Unconverged points before the first iteration and after each.
    curve: Vec<u32>,
}

/// A screen with one point a pixel, since a texel has room for one.
fn screen(positions: &[[f32; 3]], camera: &Camera, size: [u32; 2], k: u32) -> (ScreenPoints, View) {
    projected(positions, camera, size, &ProjectRules { halves: false, ..ProjectRules::usual(k) })
}

impl Found {
    /// How the search by the compute form differs from that by the raster form: in nothing, to the last bit, apart from
    /// the rounding of sums.
    fn compare(&self, drawn: &Self) -> Result<(), String> {
        let told = |found: &Self| (found.curve.clone(), found.clamped, found.bounded, found.neighborhoods.len());
        if told(self) != told(drawn) {
            return Err(format!("{:?}, drawn: {:?}", told(self), told(drawn)));
        }
        for (computed, drawn) in self.neighborhoods.iter().zip(&drawn.neighborhoods) {
            let bits = |moments: &Moments| [moments.k_radius, moments.count].map(f32::to_bits);
            // Both round their sums.
            if bits(computed) != bits(drawn) || !computed.has_sums_near(drawn, 2.0) {
                return Err(format!("{computed:?}, drawn: {drawn:?}"));
            }
        }
        Ok(())
    }
}

/// Searches by both forms, which have to agree, and returns what the compute form found.
fn on_device(gpu: &Gpu, forms: &Forms, screen: &ScreenPoints, view: &View, rules: &SearchRules) -> Found {
    let computed = by(gpu, &forms.compute, screen, view, rules);
    let drawn = by(gpu, &forms.raster, screen, view, rules);
    if let Err(different) = computed.compare(&drawn) {
        panic!("{} points, {}x{}, {rules:?}: {different}", screen.points.len(), view.width, view.height);
    }
    computed
}

fn by(gpu: &Gpu, passes: &dyn EnginePasses, screen: &ScreenPoints, view: &View, rules: &SearchRules) -> Found {
    let buffers = upload_screen(gpu, screen, view);
    let neighborhoods = neighborhood_buffer(gpu, buffers.capacity).expect("room");
    let frame = frame_buffer(gpu, view, rules);
    let cloud = DeviceCloud::default();
    let searched = SearchBuffers { frame: &frame, cloud: &cloud, screen: &buffers, neighborhoods: &neighborhoods };
    let steps = passes.steps(gpu, searched).expect("steps");
    for (round, steps) in [Round::Active, Round::Recovered].into_iter().zip(&steps.rounds) {
        run_round(gpu, &buffers, round, steps);
    }
    let found: Vec<[f32; 12]> = read_back(gpu, &neighborhoods, screen.points.len()).expect("neighbourhoods");
    let counters: Vec<u32> = read_back(gpu, &buffers.counters, COUNTERS).expect("counters");
    let runs: Vec<u32> = read_back(gpu, &steps.convergence.expect("a curve"), 2 * (ITERATIONS + 1)).expect("a curve");
    Found {
        neighborhoods: found.into_iter().map(Moments::of_device).collect(),
        clamped: counters[Counter::Clamped as usize] as usize,
        bounded: counters[Counter::Bounded as usize] as usize,
        curve: convergence(&runs),
    }
}

fn rules(k: u32) -> SearchRules {
    SearchRules { k, outlier_expansions: Some(1), gap_factor: Some(4.0), lenient: true }
}

/// Number of points whose neighbourhood differs from the host's, which is exact.
fn different(device: &[Moments], host: &[Moments], case: &str) -> usize {
    assert_eq!(device.len(), host.len(), "{case}: every point is a query");
    let errors = device.iter().zip(host).filter_map(|(device, host)| device.compare(host).err());
    errors.inspect(|error| eprintln!("{case}: {error}")).count()
}

/// A thousandth of each round's points may be unfinished at the end; one more for rounding at a rule's threshold.
fn allowed(screen: &ScreenPoints) -> usize {
    [&screen.active, &screen.passive].map(|queries| queries.len() / 1000).iter().sum::<usize>() + 1
}

#[test]
fn all_but_a_thousandth_is_what_the_host_finds() {
    let Some(gpu) = test_gpu() else { return };
    let forms = Forms::new(&gpu);
    let (mut compared, mut wrong) = (0, 0);
    for k in [1, 3, 10, 17, 64] {
        for camera in cameras() {
            for (name, positions) in test_clouds::all(2000) {
                let (screen, view) = screen(&positions, &camera, SIZE, k);
                for (e0, lambda) in [(Some(1), Some(4.0)), (Some(3), Some(4.0)), (Some(3), None), (None, Some(2.0))] {
                    let rules = SearchRules { k, outlier_expansions: e0, gap_factor: lambda, lenient: e0 == Some(3) };
                    let case = format!("{name}, {:?}, {rules:?}", camera.projection);
                    let (host, [clamped, _]) = on_host(&screen, &view, &rules);
                    let found = on_device(&gpu, &forms, &screen, &view, &rules);
                    let different = different(&found.neighborhoods, &host, &case);
                    assert!(different <= allowed(&screen), "{case}: {different} of {} differ", host.len());
                    assert!(
                        found.clamped.abs_diff(clamped) <= allowed(&screen),
                        "{case}: {} clamped, {clamped}",
                        found.clamped
                    );
                    assert!(found.bounded <= allowed(&screen), "{case}: {} ended unfinished", found.bounded);
                    compared += host.len();
                    wrong += different;
                }
            }
        }
    }
    assert!(compared > 100_000, "there is something to compare: {compared}");
    assert!(wrong * 1000 <= compared, "{wrong} of {compared} differ");
}

/// Points that the iterations cannot finish count as bounded, not as points without neighbours.
#[test]
fn short_steps_and_far_outliers() {
    let Some(gpu) = test_gpu() else { return };
    let forms = Forms::new(&gpu);
    let mut unfinished = 0;
    for (e0, lambda) in [(Some(1), 1.1), (Some(8), 1.1), (None, 1.1), (Some(8), 4.0), (None, 4.0)] {
        for (name, positions) in test_clouds::all(2000) {
            let (screen, view) = screen(&positions, &cameras()[0], SIZE, 10);
            let rules = SearchRules { k: 10, outlier_expansions: e0, gap_factor: Some(lambda), lenient: true };
            let case = format!("{name}, {rules:?}");
            let host = on_host(&screen, &view, &rules).0;
            let found = on_device(&gpu, &forms, &screen, &view, &rules);
            let different = different(&found.neighborhoods, &host, &case);
            let allowed = found.bounded + allowed(&screen);
            assert!(different <= allowed, "{case}: {different} differ, {} unfinished", found.bounded);
            unfinished += found.bounded;
        }
    }
    assert!(unfinished > 0, "iterations end too early for some");
}

#[test]
fn pictures_of_any_shape() {
    let Some(gpu) = test_gpu() else { return };
    let forms = Forms::new(&gpu);
    for size in [[1, 1], [2, 300], [301, 3], [64, 64]] {
        for camera in cameras() {
            let (screen, view) = screen(&test_clouds::sphere(2000), &camera, size, 10);
            let host = on_host(&screen, &view, &rules(10)).0;
            let found = on_device(&gpu, &forms, &screen, &view, &rules(10));
            let different = different(&found.neighborhoods, &host, "sphere");
            assert!(different <= allowed(&screen), "{size:?}: {different} of {} differ", host.len());
        }
    }
}

/// The paper's Figure 11: most points are found within seven iterations, 99.9 % within ten.
#[test]
fn the_search_converges_as_in_the_paper() {
    let Some(gpu) = test_gpu() else { return };
    let forms = Forms::new(&gpu);
    for (name, positions) in [("sphere", test_clouds::sphere(9000)), ("edge", test_clouds::edge(6000))] {
        let (screen, view) = screen(&positions, &cameras()[0], [240, 180], 10);
        let Found { curve, .. } = on_device(&gpu, &forms, &screen, &view, &rules(10));
        let queries = screen.points.len() as f64;
        let left: Vec<_> = curve.iter().map(|&left| f64::from(left) / queries).collect();
        assert_eq!(left[0], 1.0, "{name}: every point is searched for");
        assert!(left.is_sorted_by(|before, after| before >= after), "{name}: none gets lost: {left:?}");
        assert!(left.len() - 1 <= 10, "{name}: {} iterations", left.len() - 1);
        assert!(left[left.len() - 1] <= UNCONVERGED, "{name}: t_conv is reached: {left:?}");
        assert!(left.get(7).is_none_or(|&left| left <= 0.02), "{name}: after seven iterations: {left:?}");
    }
}

/// No bracket separates equal distances: all points at the k-th distance belong.
#[test]
fn ties_belong() {
    let Some(gpu) = test_gpu() else { return };
    let forms = Forms::new(&gpu);
    let lattice: Vec<_> = (0..400).map(|i| [(i % 20) as f32, (i / 20) as f32, 64.0]).collect();
    let camera = Camera {
        eye: DVec3::new(10.0, 10.0, 0.0),
        look_at: DVec3::new(10.0, 10.0, 1.0),
        up: DVec3::NEG_Y,
        projection: Projection::OrthographicHeight(32.0),
    };
    for k in [1, 3, 4, 5, 10, 16] {
        let (screen, view) = screen(&lattice, &camera, [64, 64], k);
        let host = on_host(&screen, &view, &rules(k)).0;
        let found = on_device(&gpu, &forms, &screen, &view, &rules(k));
        assert_eq!(different(&found.neighborhoods, &host, "lattice"), 0, "k = {k}: {:?}", found.curve);
        assert_eq!(found.curve.last(), Some(&0), "k = {k}: all converge: {:?}", found.curve);
    }
}

/// Of coincident points one is visible; points nearly there have distances at the limit of precision.
#[test]
fn coincident_points() {
    let Some(gpu) = test_gpu() else { return };
    let forms = Forms::new(&gpu);
    let mut positions = vec![[0.25, 0.125, 0.0]; 5000];
    positions.extend(test_clouds::plane(500));
    // A crowd so dense that rounding makes many distances equal.
    positions.extend((0..900).map(|i| [0.5 + 1e-6 * (i % 30) as f32, 0.5 + 1e-6 * (i / 30) as f32, 0.0]));
    let near = Camera {
        eye: DVec3::new(0.5, 0.5, -1e-4),
        look_at: DVec3::new(0.5, 0.5, 0.0),
        up: DVec3::NEG_Y,
        projection: Projection::PerspectiveFovDeg(30.0),
    };
    for camera in [cameras()[0], cameras()[1], near] {
        for k in [1, 10] {
            let (screen, view) = screen(&positions, &camera, SIZE, k);
            let host = on_host(&screen, &view, &rules(k)).0;
            let found = on_device(&gpu, &forms, &screen, &view, &rules(k));
            let different = different(&found.neighborhoods, &host, "crowd");
            assert!(different <= allowed(&screen), "k = {k}: {different} of {} differ, {:?}", host.len(), found.curve);
        }
    }
}

/// Points whose squared distances overflow are nobody's neighbours.
#[test]
fn huge_coordinates_reach_no_sum() {
    let Some(gpu) = test_gpu() else { return };
    let forms = Forms::new(&gpu);
    for (near, huge) in [(1, 0), (1, 40), (200, 40)] {
        let mut positions = test_clouds::sphere(near);
        let forward = (test_clouds::EYE / test_clouds::EYE.z).as_vec3();
        positions.extend((0..huge).map(|i| (forward * (1e38 * (1.0 + 0.01 * i as f32))).to_array()));
        let (screen, view) = screen(&positions, &cameras()[1], [90, 70], 10);
        let host = on_host(&screen, &view, &rules(10)).0;
        let found = on_device(&gpu, &forms, &screen, &view, &rules(10));
        let different = different(&found.neighborhoods, &host, "huge");
        assert!(different <= allowed(&screen), "{near} + {huge}: {different} of {} differ", host.len());
    }
}

#[test]
fn the_same_again() {
    let Some(gpu) = test_gpu() else { return };
    let forms = Forms::new(&gpu);
    let (screen, view) = screen(&test_clouds::edge(4000), &cameras()[0], SIZE, 17);
    let [first, second] = [(); 2].map(|()| on_device(&gpu, &forms, &screen, &view, &rules(17)));
    assert_eq!(first.neighborhoods, second.neighborhoods, "to the last bit");
    assert_eq!(first.curve, second.curve, "and the way there");
}

#[test]
fn comparison_sees_a_wrong_neighbourhood() {
    let (screen, view) = screen(&test_clouds::sphere(500), &cameras()[0], SIZE, 10);
    let right = on_host(&screen, &view, &rules(10)).0;
    let other = on_host(&screen, &view, &rules(9)).0;
    assert_eq!(different(&right, &right, "same"), 0, "nothing is wrong yet");
    assert!(different(&other, &right, "another k") > allowed(&screen), "another k is another question");
}

#[test]
fn comparison_sees_a_single_bit() {
    let Some(gpu) = test_gpu() else { return };
    let forms = Forms::new(&gpu);
    let (screen, view) = screen(&test_clouds::clumps(500), &cameras()[0], SIZE, 10);
    let right = on_device(&gpu, &forms, &screen, &view, &rules(10));
    assert!(right.compare(&right).is_ok(), "nothing is wrong yet");
    let wrong = |change: &dyn Fn(&mut Found)| {
        let mut found = right.clone();
        change(&mut found);
        found.compare(&right).is_err()
    };
    assert!(right.neighborhoods[7].k_radius > 0.0 && right.curve.len() > 4, "there is something to change");
    assert!(wrong(&|found| found.neighborhoods[7].k_radius = found.neighborhoods[7].k_radius.next_up()), "a radius");
    assert!(wrong(&|found| found.neighborhoods[7].count += 1.0), "a neighbour");
    assert!(wrong(&|found| found.curve[3] += 1), "a point of an iteration");
    assert!(wrong(&|found| found.clamped += 1), "a clamped point");
    let other = by(&gpu, &forms.compute, &screen, &view, &rules(9));
    assert!(other.compare(&right).is_err(), "another k is another question");
}

/// A device with a limit of `bytes` per pixel of colour attachments.
fn own_device(required_features: wgpu::Features, bytes: u32) -> Gpu {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let adapter = pollster::block_on(instance.request_adapter(&wgpu::RequestAdapterOptions::default()));
    let required_limits = wgpu::Limits { max_color_attachment_bytes_per_sample: bytes, ..wgpu::Limits::default() };
    let descriptor = wgpu::DeviceDescriptor { required_features, required_limits, ..Default::default() };
    let device = adapter.expect("a device").request_device(&descriptor);
    let (device, queue) = pollster::block_on(device).expect("a device within WebGPU's default limits");
    Gpu::from_parts(device, queue)
}

#[test]
fn devices_that_cannot_draw_are_refused_and_compute() {
    if test_gpu().is_none() {
        return;
    }
    let blends = wgpu::Features::FLOAT32_BLENDABLE;
    let cases = [(wgpu::Features::empty(), GATHERED_BYTES, "FLOAT32_BLENDABLE"), (blends, 16, "the device allows 16")];
    let (screen, view) = screen(&test_clouds::sphere(500), &cameras()[0], SIZE, 10);
    let host = on_host(&screen, &view, &rules(10)).0;
    for (features, bytes, why) in cases {
        let gpu = own_device(features, bytes);
        let refused = raster::CommunicationPasses::new(&gpu).expect_err("refused").to_string();
        assert!(refused.contains(why), "the message says why: {refused}");
        assert!(refused.contains("--engine splat-communication)"), "and what to do: {refused}");
        let passes = compute::CommunicationPasses::new(&gpu).expect("WebGPU's default limits are enough");
        let found = by(&gpu, &passes, &screen, &view, &rules(10));
        let different = different(&found.neighborhoods, &host, "sphere");
        assert!(different <= allowed(&screen), "{different} of {} differ", host.len());
    }
    let gpu = own_device(blends, GATHERED_BYTES);
    assert!(raster::CommunicationPasses::new(&gpu).is_ok(), "WebGPU's default limits are enough");
    let most = gpu.device.limits().max_texture_dimension_2d;
    let refused = Textures::new(&gpu, [most + 1, 1]).err().expect("refused").to_string();
    assert!(refused.contains("smaller picture") && refused.contains(&most.to_string()), "{refused}");
}
