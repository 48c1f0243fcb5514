//! Files that hold a pinhole camera, in the forms that cameras and programs write.

mod json;
mod numbers;
mod yaml;

use glam::DMat4;

/// A pinhole depth camera. The depth `z` of a pixel (u, v) is the pixel's value divided by `scale`.
/// Its point is `((u - cx) z / fx, (v - cy) z / fy, z)`.
///
/// # Examples
///
/// ```
/// use autosplats_formats::{DepthCamera, ReadOptions, read_bytes};
/// use autosplats_cloud::glam::DVec3;
///
/// // A PGM image of 2x2 pixels, each of them 1000 mm.
/// let image = [b"P5 2 2 65535\n".to_vec(), 1000_u16.to_be_bytes().repeat(4)].concat();
/// let camera = DepthCamera { fx: 1.0, fy: 1.0, cx: 0.5, cy: 0.5, scale: Some(1000.0) };
/// let options = ReadOptions { depth_camera: Some(camera), ..ReadOptions::default() };
/// let cloud = read_bytes("depth.pgm".as_ref(), &image, &options, &())?;
/// assert_eq!(cloud.world_position(0), DVec3::new(-0.5, -0.5, 1.0));
/// # Ok::<(), autosplats_cloud::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct DepthCamera {
    /// Focal length along the image's rows, in pixels.
    pub fx: f64,
    /// Focal length along the image's columns, in pixels.
    pub fy: f64,
    /// Principal point along a row, in pixels from the centre of the first pixel.
    pub cx: f64,
    /// Principal point along a column, in pixels from the centre of the first pixel.
    pub cy: f64,
    /// Pixel values per metre: 1000 for millimetres. `None` takes whole numbers as millimetres, and floats as metres
    /// unless all are whole and large.
    pub scale: Option<f64>,
}

/// A pinhole camera as a file states it: intrinsics, and perhaps a size, a depth scale and a pose.
///
/// # Examples
///
/// ```
/// use autosplats_formats::PinholeCamera;
///
/// let open3d = r#"{"extrinsic": [1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,2,1], "intrinsic":
///     {"width": 640, "height": 480, "intrinsic_matrix": [525,0,0, 0,525,0, 319.5,239.5,1]}}"#;
/// let camera = PinholeCamera::parse(open3d).expect("a camera");
/// assert_eq!((camera.fx, camera.size), (525.0, Some([640.0, 480.0])));
/// // The extrinsic moves the world two units away from the camera.
/// assert_eq!(camera.world_from_camera.map(|pose| pose.w_axis.z), Some(-2.0));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct PinholeCamera {
    /// Focal length along rows, in pixels.
    pub fx: f64,
    /// Focal length along columns, in pixels.
    pub fy: f64,
    /// Principal point along a row, in pixels from the centre of the first pixel.
    pub cx: f64,
    /// Principal point along a column, in pixels from the centre of the first pixel.
    pub cy: f64,
    /// Width and height of the calibrated image in pixels.
    pub size: Option<[f64; 2]>,
    /// Values of a depth image per metre.
    pub scale: Option<f64>,
    /// Pose: camera coordinates have x right, y down and z forward.
    pub world_from_camera: Option<DMat4>,
    /// Whether the file states a lens distortion, which is not applied.
    pub distorted: bool,
    /// Number of cameras in the file, of which this is the first.
    pub cameras: usize,
}

impl PinholeCamera {
    /// Reads a camera from the text of a file:
    ///
    /// - JSON: Open3D's intrinsics, parameters and trajectories; values by name, such as `fx` or `ppx`.
    /// - YAML: ROS's `camera_info`, files of `camera_calibration` and OpenCV, values by name. Images are taken as
    ///   rectified, so a projection matrix precedes the camera's own.
    /// - Bare numbers: a 3 × 3 or 4 × 4 matrix row by row, or fx fy cx cy, perhaps with a scale.
    ///
    /// Returns `None` if there is no camera in it, or an unusable one.
    pub fn parse(text: &str) -> Option<Self> {
        let camera = match serde_json::from_str(text) {
            Ok(serde_json::Value::Object(_)) => json::parse(text),
            _ => numbers::parse(text).or_else(|| yaml::parse(text)),
        }?;
        let Self { fx, fy, cx, cy, size, scale, world_from_camera, .. } = &camera;
        let above_zero = [Some(*fx), Some(*fy), *scale, size.map(|size| size[0]), size.map(|size| size[1])];
        let usable = above_zero.into_iter().flatten().all(|value| value.is_finite() && value > 0.0);
        let posed = world_from_camera.is_none_or(|pose| pose.is_finite());
        (usable && posed && cx.is_finite() && cy.is_finite()).then_some(camera)
    }

    fn new([fx, fy, cx, cy]: [f64; 4]) -> Self {
        let (size, scale, world_from_camera) = (None, None, None);
        Self { fx, fy, cx, cy, size, scale, world_from_camera, distorted: false, cameras: 1 }
    }

    /// From a 3 × 3 matrix row by row, whose last row must be 0 0 1.
    fn from_rows(k: &[f64]) -> Option<Self> {
        let whole = k.len() == 9 && k[8] == 1.0 && [3, 6, 7].iter().all(|&index| k[index] == 0.0);
        whole.then(|| Self::new([k[0], k[4], k[2], k[5]]))
    }

    /// The camera of a depth image of this size. A camera calibrated at another resolution sees the same angle.
    #[must_use]
    pub fn depth_camera(&self, width: usize, height: usize) -> DepthCamera {
        let Self { fx, fy, cx, cy, scale, .. } = *self;
        let [across, down] = self.size.map_or([1.0; 2], |[w, h]| [width as f64 / w, height as f64 / h]);
        DepthCamera { fx: fx * across, fy: fy * down, cx: cx * across, cy: cy * down, scale }
    }
}

/// Values per metre; values below 1 are taken as metres per value.
fn scale_of(scale: f64) -> f64 {
    if scale < 1.0 { 1.0 / scale } else { scale }
}

#[cfg(test)]
mod tests;
