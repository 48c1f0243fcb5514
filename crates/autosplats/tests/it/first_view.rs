//! The first look at a cloud that states nothing: the right way up, and as large as it fits.
//!
//! Each case is a generated body or a file, turned to all six sides unless the format says which way is up. The files
//! lie beside the repository in `../shared/data`, or where `AUTOSPLATS_DATA` points; without them only generated cases
//! are judged.

mod bodies;

use std::path::{Path, PathBuf};

use autosplats::cloud::glam::{DVec2, DVec3};
use autosplats::cloud::{Axes, PointCloud};
use autosplats::{Camera, Projection, ViewDirection, guess_axes};

use self::bodies::Body;

/// Least share of the cases with a good first view.
const WANTED_SHARE: f64 = 0.95;
const SIZE: [u32; 2] = [300, 200];
/// Least share of the main points within the picture.
const MIN_SEEN: f64 = 0.98;
/// Least share of the picture's width or height that the main points reach across.
const MIN_FILLED: f64 = 0.6;
/// Least share of the points within the picture for an eye among them.
const MIN_SEEN_AMONG: f64 = 0.4;

/// Files that state nothing, and their up axis.
const FILES: [(&str, Axes); 17] = [
    ("models/bunny.ply", Axes::YUp),
    ("models/camelhead.off", Axes::YUp),
    ("models/guanyin_color.ply", Axes::YUp),
    ("animation/horse_gallop/frame_000.ply", Axes::YUp),
    ("animation/samba/frame_000.ply", Axes::YUp),
    ("animation/samba/frame_010.ply", Axes::YUp),
    ("animation/samba/frame_020.ply", Axes::YUp),
    ("multiview/bunny_scans/bun000.ply", Axes::YUp),
    ("multiview/bunny_scans/bun045.ply", Axes::YUp),
    ("multiview/bunny_scans/bun090.ply", Axes::YUp),
    ("multiview/bunny_scans/bun180.ply", Axes::YUp),
    ("multiview/bunny_scans/bun270.ply", Axes::YUp),
    ("multiview/bunny_scans/bun315.ply", Axes::YUp),
    ("scans/bunny.pts", Axes::YUp),
    ("scans/bunny_float.e57", Axes::YUp),
    ("sequences/kitti_drive_pcd/000000.pcd", Axes::ZUp),
    ("sequences/kitti_drive_pcd/000003.pcd", Axes::ZUp),
];

/// Files whose format or coordinates say it, and four without a flat end, of which only custom tells which way is up.
const STATED: [(&str, Axes); 19] = [
    ("animation/horse_gallop/frame_005.ply", Axes::YUp),
    ("models/armadillo_normals.ply", Axes::YUp),
    ("models/igea.ply", Axes::YUp),
    ("scans/rops_ascii.pcd", Axes::YUp),
    ("scans/autzen_thin.las", Axes::ZUp),
    ("scans/autzen_trim.laz", Axes::ZUp),
    ("scans/autzen_utm_f64.pcd", Axes::ZUp),
    ("scans/color.ptx", Axes::ZUp),
    ("scans/five_people.pcd", Axes::Camera),
    ("scans/isprs_samp11_utm_f32.pcd", Axes::ZUp),
    ("scans/kitti_000008_fov.bin", Axes::ZUp),
    ("scans/latlon_degrees.las", Axes::ZUp),
    ("scans/lion_takanawa.copc.laz", Axes::ZUp),
    ("scans/livingroom_fragment.pcd", Axes::Camera),
    ("scans/lone_star.copc.laz", Axes::ZUp),
    ("scans/nuscenes_n015.pcd.bin", Axes::ZUp),
    ("scans/pump_room.e57", Axes::ZUp),
    ("scans/rgb_float.e57", Axes::ZUp),
    ("scans/simple_1065.las", Axes::ZUp),
];

/// Places with Z up, turned so that the up direction of `axes` is up.
fn turned(places: &[DVec3], axes: Axes) -> PointCloud {
    let [right, front, up] = axes.frame();
    let turn = |p: &DVec3| (right * p.x - front * p.y + up * p.z).as_vec3().to_array();
    PointCloud::new(DVec3::ZERO, places.iter().map(turn).collect())
}

/// What is wrong with the first view of a cloud; `main` are the points that it has to show.
fn fault(cloud: &PointCloud, axes: Axes, main: usize, [among, symmetric]: [bool; 2]) -> Option<String> {
    let guessed = guess_axes(cloud);
    if guessed.up() != axes.up() && !(symmetric && guessed.up() == -axes.up()) {
        return Some(format!("{} is taken for {}", axes.name(), guessed.name()));
    }
    let aspect = f64::from(SIZE[0]) / f64::from(SIZE[1]);
    let projection = Projection::PerspectiveFovDeg(Projection::USUAL_FOV_DEG);
    let camera = Camera::fit(cloud, guessed, ViewDirection::Auto, aspect, projection).expect("a camera");
    let lens = camera.lens(SIZE).expect("a lens");
    let [width, height] = SIZE.map(f64::from);
    let places = (0..main).map(|index| cloud.world_position(index)).filter(|place| place.is_finite());
    let pixels: Vec<Option<DVec2>> = places.map(|place| lens.to_pixel(place).map(|(pixel, _)| pixel)).collect();
    let is_seen = |pixel: &&DVec2| (0.0..width).contains(&pixel.x) && (0.0..height).contains(&pixel.y);
    let seen = pixels.iter().flatten().filter(is_seen).count() as f64 / pixels.len() as f64;
    if seen < if among { MIN_SEEN_AMONG } else { MIN_SEEN } {
        return Some(format!("{seen:.2} of the points are in the picture"));
    }
    let filled = [0, 1].map(|axis| {
        let mut along: Vec<f64> = pixels.iter().flatten().map(|pixel| pixel[axis] / [width, height][axis]).collect();
        along.sort_unstable_by(f64::total_cmp);
        along[along.len() - 1 - along.len() / 100] - along[along.len() / 100]
    });
    let is_large = among || filled[0].max(filled[1]) > MIN_FILLED;
    (!is_large).then(|| format!("{filled:.2?} of the picture is filled"))
}

fn judge_turned(
    name: &str,
    places: &[DVec3],
    main: usize,
    kind: [bool; 2],
    results: &mut Vec<(String, Option<String>)>,
) {
    for axes in Axes::ALL.into_iter().filter(|&axes| axes != Axes::Camera) {
        let fault = fault(&turned(places, axes), axes, main, kind);
        results.push((format!("{name}, {}", axes.name()), fault));
    }
}

fn judge_files(folder: &Path, results: &mut Vec<(String, Option<String>)>) {
    for (name, axes) in FILES {
        let cloud = autosplats_formats::read(&folder.join(name), &()).expect(name);
        let [right, front, up] = axes.frame();
        let places = (0..cloud.len()).map(|index| cloud.world_position(index)).filter(|place| place.is_finite());
        let upright: Vec<DVec3> =
            places.map(|place| DVec3::new(place.dot(right), -place.dot(front), place.dot(up))).collect();
        judge_turned(name, &upright, upright.len(), [name.starts_with("sequences"), false], results);
    }
    for (name, axes) in STATED {
        let cloud = autosplats_formats::read(&folder.join(name), &()).expect(name);
        let among = name.ends_with(".bin") || axes == Axes::Camera;
        results.push((name.into(), fault(&cloud, axes, cloud.len(), [among, false])));
    }
}

#[test]
fn nearly_every_cloud_opens_the_right_way_up_and_well_framed() {
    let mut results = Vec::new();
    for Body { name, points, main, among, symmetric } in bodies::all() {
        judge_turned(name, &points, main, [among, symmetric], &mut results);
    }
    let beside = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let folder = std::env::var_os("AUTOSPLATS_DATA").map_or_else(beside, PathBuf::from);
    if folder.is_dir() {
        judge_files(&folder, &mut results);
    } else {
        println!("{} is absent: only generated cases are judged", folder.display());
    }
    let good = results.iter().filter(|(_, fault)| fault.is_none()).count();
    for (name, fault) in &results {
        if let Some(fault) = fault {
            println!("{name}: {fault}");
        }
    }
    let share = good as f64 / results.len() as f64;
    println!("{good} of {} cases open well", results.len());
    assert!(share >= WANTED_SHARE, "{share:.3} of the cases open well; above are the others");
}
