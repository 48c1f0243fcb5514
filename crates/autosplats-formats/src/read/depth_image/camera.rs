//! The camera of a depth image.

use std::{fs::metadata, path::Path};

use autosplats_cloud::read_text;
use serde_json::Value;

use super::Job;
use crate::DepthCamera;

/// Default pixel values per metre: most depth cameras count millimetres.
const PER_METRE: f64 = 1000.0;

/// Names of files that hold a camera, as JSON or as bare numbers.
const FILES: [&str; 7] = [
    "intrinsics.json",
    "camera_intrinsic.json",
    "camera.json",
    "camera.txt",
    "intrinsics.txt",
    "cam_K.txt",
    "camera-intrinsics.txt",
];

/// Largest size of a camera file, in bytes.
const MAX_BYTES: u64 = 1 << 16;

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
        for path in folders.into_iter().flatten().flat_map(|folder| FILES.map(|name| folder.join(name))) {
            if !metadata(&path).is_ok_and(|metadata| metadata.is_file() && metadata.len() <= MAX_BYTES) {
                continue;
            }
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            let Some(camera) = read_text(&path).ok().and_then(|text| parse(&text, width, height)) else {
                notes.push(format!("{name} holds no camera of 3 × 3 or 4 numbers; ignored"));
                continue;
            };
            notes.push(format!("the camera is read from {name}"));
            return Self { camera, source: name, notes };
        }
        notes.push(
            "no camera is known; a Kinect's angle of view and millimetres are assumed; to state it, put a file \
             camera.txt with fx fy cx cy and the values per metre beside the image"
                .into(),
        );
        Self { camera: ordinary(width, height), source: "a guess".into(), notes }
    }
}

/// A camera with a Kinect's angle of view, for images in millimetres.
fn ordinary(width: usize, height: usize) -> DepthCamera {
    let focal = 525.0 * width as f64 / 640.0;
    let middle = |len: usize| (len as f64 - 1.0) / 2.0;
    DepthCamera { fx: focal, fy: focal, cx: middle(width), cy: middle(height), scale: PER_METRE }
}

fn parse(text: &str, width: usize, height: usize) -> Option<DepthCamera> {
    let camera = match serde_json::from_str::<Value>(text) {
        Ok(json) if json.is_object() => from_json(&json, width, height)?,
        _ => from_numbers(text)?,
    };
    let DepthCamera { fx, fy, cx, cy, scale } = camera;
    let usable = [fx, fy, scale].iter().all(|value| value.is_finite() && *value > 0.0);
    (usable && cx.is_finite() && cy.is_finite()).then_some(camera)
}

/// Values per metre; values below 1 are taken as metres per value.
fn scale_of(scale: f64) -> f64 {
    if scale < 1.0 { 1.0 / scale } else { scale }
}

/// Open3D's form: sizes and a matrix column by column; or values by name.
fn from_json(json: &Value, width: usize, height: usize) -> Option<DepthCamera> {
    let inner = json.get("intrinsic").unwrap_or(json);
    let number = |names: &[&str]| names.iter().find_map(|name| inner.get(name).or(json.get(name))?.as_f64());
    let scale = number(&["depth_scale", "scale"]).map_or(PER_METRE, scale_of);
    let matrix = inner.get("intrinsic_matrix").and_then(Value::as_array);
    let mut camera = match matrix {
        Some(matrix) => {
            let k: Vec<f64> = matrix.iter().filter_map(Value::as_f64).collect();
            (k.len() == 9).then(|| DepthCamera { fx: k[0], fy: k[4], cx: k[6], cy: k[7], scale })?
        }
        None => DepthCamera {
            fx: number(&["fx"])?,
            fy: number(&["fy"])?,
            cx: number(&["cx", "ppx"])?,
            cy: number(&["cy", "ppy"])?,
            scale,
        },
    };
    // A camera calibrated at another resolution sees the same angle.
    if let Some(own) = number(&["width"]).filter(|own| *own > 0.0) {
        camera.fx *= width as f64 / own;
        camera.cx *= width as f64 / own;
    }
    if let Some(own) = number(&["height"]).filter(|own| *own > 0.0) {
        camera.fy *= height as f64 / own;
        camera.cy *= height as f64 / own;
    }
    Some(camera)
}

/// A 3 × 3 matrix, a 4 × 4 matrix with it in the upper left, or fx fy cx cy. A scale may follow, except after 4 × 4.
fn from_numbers(text: &str) -> Option<DepthCamera> {
    let lines = text.lines().map(|line| line.split('#').next().unwrap_or_default());
    let words =
        lines.flat_map(|line| line.split([' ', '\t', ',', ';', '[', ']'])).filter(|word| !word.trim().is_empty());
    let k = words.map(|word| word.trim().parse().ok()).collect::<Option<Vec<f64>>>()?;
    let scale = |index: usize| k.get(index).copied().map_or(PER_METRE, scale_of);
    let camera =
        |[fx, fy, cx, cy]: [usize; 4], scale| DepthCamera { fx: k[fx], fy: k[fy], cx: k[cx], cy: k[cy], scale };
    match k.len() {
        4 | 5 => Some(camera([0, 1, 2, 3], scale(4))),
        9 | 10 if k[8] == 1.0 && [3, 6, 7].iter().all(|&index| k[index] == 0.0) => Some(camera([0, 4, 2, 5], scale(9))),
        16 if k[10] == 1.0 && k[15] == 1.0 => Some(camera([0, 5, 2, 6], PER_METRE)),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cameras_of_every_spelling() {
        let expected = DepthCamera { fx: 518.0, fy: 519.0, cx: 325.5, cy: 253.5, scale: 1000.0 };
        for text in [
            r#"{"width": 640, "height": 480, "intrinsic_matrix": [518.0, 0, 0, 0, 519.0, 0, 325.5, 253.5, 1]}"#,
            r#"{"width": 320, "height": 240, "fx": 259.0, "fy": 259.5, "ppx": 162.75, "ppy": 126.75, "depth_scale": 0.001}"#,
            "518 0 325.5\n0 519 253.5\n0 0 1\n",
            "518 0 325.5\n0 519 253.5\n0 0 1\n1000",
            "# fx fy cx cy\n518, 519, 325.5, 253.5",
            "518 0 325.5 0 0 519 253.5 0 0 0 1 0 0 0 0 1",
        ] {
            assert_eq!(parse(text, 640, 480), Some(expected), "{text}");
        }
        assert_eq!(parse("518 519 325.5 253.5 5000", 640, 480).map(|camera| camera.scale), Some(5000.0), "a scale");
        for text in ["", "1 2 3", "518 0 0 0 519 0 325.5 253.5 1", "0 519 1 1", "{}", "[1, 2]", "x 1 2 3", "nan 1 2 3"]
        {
            assert_eq!(parse(text, 640, 480), None, "{text} is no camera");
        }
    }
}
