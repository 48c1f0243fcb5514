//! The camera of a depth image.

use std::{
    fs::metadata,
    path::{Path, PathBuf},
};

use autosplats_cloud::read_text;

use super::Job;
use crate::{DepthCamera, PinholeCamera};

/// Names of files that hold a camera.
const FILES: [&str; 13] = [
    "intrinsics.json",
    "camera_intrinsic.json",
    "camera_info.json",
    "camera.json",
    "camera_info.yaml",
    "camera_info.yml",
    "camera.yaml",
    "camera.yml",
    "ost.yaml",
    "camera.txt",
    "intrinsics.txt",
    "cam_K.txt",
    "camera-intrinsics.txt",
];

/// Largest size of a camera file, in bytes. Trajectories have a camera per picture.
const MAX_BYTES: u64 = 1 << 22;

/// A camera and its source.
pub(super) struct Camera {
    pub(super) camera: DepthCamera,
    pub(super) source: String,
    pub(super) notes: Vec<String>,
}

impl Camera {
    /// The caller's camera, otherwise that of a file beside the image or beside its folder, otherwise a guess.
    pub(super) fn of(job: &Job<'_>, width: usize, height: usize) -> Self {
        let mut notes = Vec::new();
        if let Some(camera) = job.options.depth_camera {
            return Self { camera, source: "the caller".into(), notes };
        }
        let folder = job.path.parent().unwrap_or(Path::new(""));
        let in_depth_folder =
            folder.file_name().is_some_and(|name| name.to_string_lossy().to_lowercase().contains("depth"));
        let folders = [Some(folder), folder.parent().filter(|_| in_depth_folder)];
        let shared = folders.into_iter().flatten().flat_map(|folder| FILES.map(|name| folder.join(name)));
        for path in own_files(job.path).into_iter().chain(shared) {
            if !metadata(&path).is_ok_and(|metadata| metadata.is_file() && metadata.len() <= MAX_BYTES) {
                continue;
            }
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            let Some(found) = read_text(&path).ok().and_then(|text| PinholeCamera::parse(&text)) else {
                notes.push(format!("{name} holds no camera that is understood; ignored"));
                continue;
            };
            notes.push(format!("the camera is read from {name}"));
            if found.distorted {
                notes.push(format!("{name} states a lens distortion; the image is taken as rectified"));
            }
            return Self { camera: found.depth_camera(width, height), source: name, notes };
        }
        notes.push(
            "no camera is known; a Kinect's angle of view is assumed; to state it, put a file camera.txt with fx fy cx cy \
             and the values per metre beside the image"
                .into(),
        );
        Self { camera: ordinary(width, height), source: "a guess".into(), notes }
    }
}

/// Names of files that hold the camera of this image alone, by its own name. Open3D's window captures
/// `DepthCapture_T.png` and `DepthCamera_T.json`.
fn own_files(path: &Path) -> Vec<PathBuf> {
    let Some(stem) = path.file_stem().and_then(|stem| stem.to_str()) else { return Vec::new() };
    let mut stems = vec![stem.to_owned()];
    stems.extend(stem.contains("Capture").then(|| stem.replace("Capture", "Camera")));
    let named = |stem: &String| ["json", "yaml"].map(|extension| path.with_file_name(format!("{stem}.{extension}")));
    stems.iter().flat_map(named).collect()
}

/// A camera with a Kinect's angle of view.
fn ordinary(width: usize, height: usize) -> DepthCamera {
    let focal = 525.0 * width as f64 / 640.0;
    let middle = |len: usize| (len as f64 - 1.0) / 2.0;
    DepthCamera { fx: focal, fy: focal, cx: middle(width), cy: middle(height), scale: None }
}
