//! `sensor_msgs/PointCloud2`, the message of points in ROS 1 and ROS 2.
//!
//! ```
//! use autosplats_formats::ReadOptions;
//! use autosplats_cloud::glam::DVec3;
//! use autosplats_sources::point_cloud2::{Encoding, decode};
//!
//! # let bytes = |number: &u32| number.to_le_bytes();
//! # let numbers = |numbers: &[u32]| numbers.iter().flat_map(bytes).collect::<Vec<u8>>();
//! # let text = |text: &str| [numbers(&[text.len() as u32]), text.as_bytes().to_vec()].concat();
//! # let field = |name, offset| [text(name), numbers(&[offset]), vec![7], numbers(&[1])].concat();
//! # let message = [
//! #     [numbers(&[0, 1_700_000_000, 0]), text("lidar"), numbers(&[1, 1, 3])].concat(),
//! #     [field("x", 0), field("y", 4), field("z", 8), vec![0], numbers(&[12, 12, 12])].concat(),
//! #     [1_f32, 2.0, 3.0].map(f32::to_le_bytes).concat(),
//! #     vec![1],
//! # ];
//! # let bytes = message.concat();
//! let options = ReadOptions::default();
//! // The bytes are those of a message with one point.
//! let message = decode("/lidar/points".as_ref(), &bytes, Encoding::Ros1, &options)?;
//! assert_eq!((message.frame_id.as_str(), message.stamp), ("lidar", 1_700_000_000_000_000_000));
//! assert_eq!(message.cloud.world_position(0), DVec3::new(1.0, 2.0, 3.0));
//! # Ok::<(), autosplats_cloud::Error>(())
//! ```
//!
//! # How it works
//!
//! The message describes where each value of a point lies, so it is a table of columns like PLY and PCD. All its claims
//! are checked against its actual length before anything is allocated.

mod layout;

use std::path::Path;

use autosplats_cloud::{Axes, Error, PointCloud, Scan};
use autosplats_formats::{ReadOptions, table::Table};
use glam::DMat4;

use self::layout::Layout;
pub use super::wire::Encoding;
use super::wire::{Wire, frame_name, header};

/// The points of a message, with its header.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Message {
    /// Name of the coordinate frame of the points.
    pub frame_id: String,
    /// Time of measurement in nanoseconds, usually since 1970; 0 if unknown.
    pub stamp: i64,
    /// The points.
    pub cloud: PointCloud,
    /// Number of points at (0, 0, 0), which mean no return, that were removed.
    pub no_returns: usize,
}

/// Names of map frames, whose origin is not the position of a sensor.
const MAP_FRAMES: [&str; 5] = ["map", "odom", "world", "earth", "utm"];

/// Converts a PointCloud2 message of any layout and byte order into a cloud. Rows of an image follow each other.
///
/// Values are named like those of files and become [`Field`](autosplats_cloud::Field)s. A field of several values
/// becomes one per value, `name_0` and so on; fields of more than 16 values are left out. The points stay in the
/// coordinate frame of the message. The cloud gets a scan with the sensor at the origin, unless the coordinate frame
/// has the name of a map. `name` is used in messages: the file or the topic.
///
/// # Errors
/// [`Error::Malformed`] with the offset of the fault, and [`Error::OutOfMemory`]. Memory and time are bounded by the
/// length of the message, whatever it claims.
pub fn decode(name: &Path, bytes: &[u8], encoding: Encoding, options: &ReadOptions) -> Result<Message, Error> {
    let layout = Layout::parse(bytes, encoding).map_err(|fault| Error::malformed(name, fault.place(), fault.what))?;
    let Layout { stamp, frame_id, count, data_at, big_endian, columns, .. } = &layout;
    let rows = layout.rows();
    let (count, place) = (*count, format!("byte {data_at}"));
    let mut cloud = if count == 0 {
        PointCloud::default()
    } else {
        let columns = columns.clone();
        let table = Table { bytes: &rows, count, big_endian: *big_endian, columns, packed_rgb: true, done: 0.0 };
        table.cloud(name, &place, options)?
    };
    // A cloud may end up empty: a sensor may see nothing for a while.
    let no_returns = cloud.drop_no_returns(|_| !options.keep_no_returns);
    // The classes of a robot are not those of LAS, so that the usual filter keeps all.
    if let Some(filter) = options.keep.as_ref().filter(|filter| !filter.is_usual() && !cloud.is_empty()) {
        if let Some(missing) = filter.missing_field(&cloud) {
            return Err(Error::malformed(name, place, format!("--keep {filter}: its points have no field {missing}")));
        }
        cloud.keep(filter);
    }
    let axes = if frame_id.contains("optical") { Axes::Camera } else { Axes::ZUp };
    let mut cloud = cloud.with_axes(axes);
    if !MAP_FRAMES.contains(&&*frame_id.to_lowercase()) && !cloud.is_empty() {
        let points = 0..cloud.len();
        let name = (!frame_id.is_empty()).then(|| frame_id.clone());
        cloud = cloud.with_scans(vec![Scan { name, world_from_sensor: DMat4::IDENTITY, points }]);
    }
    Ok(Message { frame_id: frame_id.clone(), stamp: *stamp, cloud, no_returns })
}

/// Time stamp and coordinate frame of a message, without its points.
pub(crate) fn stamp_and_frame(bytes: &[u8], encoding: Encoding) -> Option<(i64, String)> {
    let mut wire = Wire::message(bytes, encoding).ok()?;
    let (stamp, frame) = header(&mut wire, encoding).ok()?;
    Some((stamp, frame_name(&frame)))
}
