//! What recordings consist of, in the same form for MCAP files and bags.

use autosplats_cloud::one_line;

use super::chunk::Chunk;
use crate::wire::Encoding;

/// What the messages of a topic are used for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Kind {
    Points,
    /// Transforms between coordinate frames. Fixed transforms hold at all times.
    Transforms {
        fixed: bool,
    },
    Other,
}

/// Messages of one name and type.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) struct Topic {
    pub(super) name: String,
    pub(super) type_name: String,
    pub(super) encoding: Option<Encoding>,
    pub(super) kind: Kind,
}

impl Topic {
    /// Creates a topic. `encoding` is the name used in the recording: `ros1`, `cdr` or another one.
    pub(super) fn new(name: &str, type_name: &str, encoding: &str) -> Self {
        let encoding = match encoding {
            "ros1" => Some(Encoding::Ros1),
            "cdr" => Some(Encoding::Cdr),
            _ => None,
        };
        let kind = match type_name {
            _ if encoding.is_none() => Kind::Other,
            "sensor_msgs/PointCloud2" | "sensor_msgs/msg/PointCloud2" => Kind::Points,
            "tf2_msgs/TFMessage" | "tf2_msgs/msg/TFMessage" | "tf/tfMessage" | "tf/msg/tfMessage" => {
                Kind::Transforms { fixed: name.ends_with("tf_static") }
            }
            _ => Kind::Other,
        };
        Self { name: one_line(name), type_name: one_line(type_name), encoding, kind }
    }
}

/// Position of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct MessagePosition {
    /// Time of recording in nanoseconds since 1970.
    pub(super) time: i64,
    pub(super) file: usize,
    pub(super) topic: usize,
    pub(super) chunk: Option<usize>,
    /// Offset of the message's record, in the unpacked chunk or in the file.
    pub(super) at: usize,
}

/// A record, reduced to what is needed here.
pub(super) enum Record<'a> {
    /// Assigns a topic to a message number.
    Topic(u32, Topic),
    Chunk(Chunk),
    /// Times and offsets, in the preceding chunk, of the messages with a number.
    Index(u32, Vec<(i64, usize)>),
    Message(u32, i64, &'a [u8]),
    /// End of a recording that was closed properly.
    End,
    Other,
}
