//! Options of reading.

/// Options of reading a file. The default suits the display of points.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReadOptions {
    /// Keep all digits of the file, for writing them again. Adds [residuals](crate::PointCloud::residuals) where `f32`
    /// loses digits of a coordinate, and fields `Red`, `Green` and `Blue` where 8 bits lose some of a colour.
    pub exact: bool,
    /// Keep points at (0, 0, 0), the sensor's own place, which scanners write for missing returns.
    pub keep_no_returns: bool,
    /// Names of the columns of text and headerless binary records, instead of guessed ones: `x`, `y`, `z`, `red`,
    /// `green`, `blue`, `Intensity` … in any order. `-` or `_` leaves a column out.
    pub columns: Option<Vec<String>>,
    /// Camera of depth images; by default taken from a file beside the image, or guessed.
    pub depth_camera: Option<DepthCamera>,
}

/// A pinhole depth camera. The depth `z` of a pixel (u, v) is the pixel's value divided by `scale`.
/// Its point is `((u - cx) z / fx, (v - cy) z / fy, z)`.
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
    /// Pixel values per metre: 1000 for millimetres.
    pub scale: f64,
}
