//! How to read what files leave open.

/// How to read a file. The default is right for showing points.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReadOptions {
    /// Keep all the digits there are, for writing them again: [residuals](crate::PointCloud::residuals) where `f32`
    /// loses some of a coordinate, and fields `Red`, `Green` and `Blue` where 8 bits lose some of a colour.
    pub exact: bool,
    /// Keep points at the sensor's own place, (0, 0, 0), which scanners write where nothing came back.
    pub keep_no_returns: bool,
    /// Names of the columns of text and of bare binary records, instead of what is guessed: `x`, `y`, `z`, `red`,
    /// `green`, `blue`, `Intensity` … in any order; `-` or `_` for one to leave out.
    pub columns: Option<Vec<String>>,
    /// The camera of depth images, where no file beside them tells.
    pub depth_camera: Option<DepthCamera>,
}

/// A pinhole depth camera: the point of pixel (u, v) is `((u - cx) z / fx, (v - cy) z / fy, z)` with `z` the pixel's value
/// divided by `scale`.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct DepthCamera {
    /// Focal length along a row, in pixels.
    pub fx: f64,
    /// Focal length along a column, in pixels.
    pub fy: f64,
    /// Principal point along a row, in pixels from the middle of the first one.
    pub cx: f64,
    /// Principal point along a column, in pixels from the middle of the first one.
    pub cy: f64,
    /// Values per metre, 1000 for millimetres.
    pub scale: f64,
}
