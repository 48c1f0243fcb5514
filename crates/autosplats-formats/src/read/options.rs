//! Options of reading.

use autosplats_cloud::PointFilter;

use crate::DepthCamera;

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
    /// Take only whole files: one that is cut off or damaged is an error. By default what is left of it is read, and
    /// the [loss](autosplats_cloud::Progress::loss) is told.
    pub whole: bool,
    /// Headers to send with requests to an address, as `NAME: VALUE`. Files ignore them.
    pub headers: Vec<String>,
    /// Camera of depth images; by default taken from a file beside the image, or guessed.
    pub depth_camera: Option<DepthCamera>,
}
