//! `sensor_msgs/PointCloud2`, the message in which robots hand points around, of ROS 1 and ROS 2.
//!
//! # How it works
//!
//! The message says itself where each value of a point lies, so that it is a table of columns as PLY and PCD are. All it says
//! is checked against the bytes there are before anything is allocated.

mod layout;

use std::path::Path;

use glam::DMat4;

use self::layout::Layout;
pub use super::wire::Encoding;
use super::wire::{Wire, header};
use crate::{
    Axes, Error, PointCloud, ReadOptions, Scan,
    error::message,
    read::{Job, Table, take_out_no_returns},
};

/// The points of a message, and what it says of them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Message {
    /// The coordinate frame that the points are in.
    pub frame_id: String,
    /// When they were measured, in nanoseconds, mostly since 1970; 0 if nobody said.
    pub stamp: i64,
    /// The points.
    pub cloud: PointCloud,
    /// Points at (0, 0, 0), where nothing came back, which were left out.
    pub no_returns: usize,
}

/// Frames that maps are in: no sensor stands at their origin.
const MAPS: [&str; 5] = ["map", "odom", "world", "earth", "utm"];

/// Makes a cloud of a PointCloud2 message: of any layout, of either byte order, rows of an image one after the other.
///
/// Names of values become those of [`Field`](crate::Field)s as when files are read; of fields of several values each becomes
/// one, `name_0` and so on, and those of more than 16 are left out. The points are in the message's own frame. That the
/// sensor stood at its origin is stated unless the frame is called as maps are. `name` stands in messages: of a file, or of
/// the topic.
///
/// # Errors
/// [`Error::Malformed`] with the byte of the message that is wrong, and [`Error::OutOfMemory`]. What is read and what is
/// allocated is bounded by the message's own length, whatever it claims.
pub fn decode(name: &Path, bytes: &[u8], encoding: Encoding, options: &ReadOptions) -> Result<Message, Error> {
    let job = Job { path: name, progress: &(), bytes, options, triangles: false };
    let layout = Layout::parse(bytes, encoding).map_err(|fault| job.malformed(fault.place(), &*fault.what))?;
    let Layout { stamp, frame_id, count, data_at, big_endian, columns, .. } = &layout;
    let rows = layout.rows();
    let (count, place) = (*count, format!("byte {data_at}"));
    let mut cloud = if count == 0 {
        PointCloud::default()
    } else {
        let columns = columns.clone();
        let table = Table { bytes: &rows, count, big_endian: *big_endian, columns, packed_rgb: true, done: 0.0 };
        table.into_cloud(&job, &place)?
    };
    // Even all of them: a sensor may see nothing for a while.
    let no_returns = take_out_no_returns(&mut cloud, |_| !options.keep_no_returns);
    let axes = if frame_id.contains("optical") { Axes::Camera } else { Axes::ZUp };
    let mut cloud = cloud.with_axes(axes);
    if !MAPS.contains(&&*frame_id.to_lowercase()) && !cloud.is_empty() {
        let points = 0..cloud.len();
        let name = (!frame_id.is_empty()).then(|| frame_id.clone());
        cloud = cloud.with_scans(vec![Scan { name, world_from_sensor: DMat4::IDENTITY, points }]);
    }
    Ok(Message { frame_id: frame_id.clone(), stamp: *stamp, cloud, no_returns })
}

/// Time stamp and frame of a message, without its points.
pub(crate) fn stamp_and_frame(bytes: &[u8], encoding: Encoding) -> Option<(i64, String)> {
    let mut wire = Wire::message(bytes, encoding).ok()?;
    let (stamp, frame) = header(&mut wire, encoding).ok()?;
    Some((stamp, frame_name(&frame)))
}

/// ROS 1 once wrote a slash before the names of frames; they are the same ones.
pub(crate) fn frame_name(name: &str) -> String {
    message(name.strip_prefix('/').unwrap_or(name))
}
