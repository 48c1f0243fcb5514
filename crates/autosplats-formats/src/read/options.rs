//! Options of reading.

use autosplats_cloud::PointFilter;

/// Options of reading a file. The default suits the display of points.
///
/// # Examples
///
/// ```
/// use autosplats_formats::{ReadOptions, read_bytes};
///
/// let columns = ["x", "y", "z", "Intensity"].map(String::from).to_vec();
/// let options = ReadOptions { exact: true, columns: Some(columns), ..ReadOptions::default() };
/// let cloud = read_bytes("scan.txt".as_ref(), b"0.123456789 2 3 40\n", &options, &())?;
/// assert!((cloud.world_position(0).x - 0.123456789).abs() < 1e-12, "all digits are kept");
/// assert_eq!(cloud.field("Intensity").map(|field| field.values.get(0)), Some(40.0));
/// # Ok::<(), autosplats_cloud::Error>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReadOptions {
    /// Keep all digits of the file, for writing them again. Adds [residuals](autosplats_cloud::PointCloud::residuals)
    /// where `f32` loses digits of a coordinate, and fields `Red`, `Green` and `Blue` where 8 bits lose some of a
    /// colour.
    pub exact: bool,
    /// Keep points at (0, 0, 0), the sensor's own place, which scanners write for missing returns.
    pub keep_no_returns: bool,
    /// Names of the columns of text and headerless binary records, instead of guessed ones: `x`, `y`, `z`, `red`,
    /// `green`, `blue`, `Intensity` … in any order. `-` or `_` leaves a column out.
    pub columns: Option<Vec<String>>,
    /// Which points to keep, by class, flag and return; `None` keeps all. The usual filter acts on LAS, and in other
    /// formats if the file calls its classes `Classification`. Any other filter fails if the file lacks a field that
    /// the filter needs. Previews are filtered too; triangles with a corner that is left out go.
    pub keep: Option<PointFilter>,
    /// Camera of depth images; by default taken from a file beside the image, or guessed.
    pub depth_camera: Option<DepthCamera>,
}

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
