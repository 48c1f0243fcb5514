//! Hand-made recordings: MCAP files and ROS 1 bags, closed or not, with or without index records.

use std::io::Write as _;

use autosplats_sources::point_cloud2::Encoding;

/// Name, type and encoding of a topic.
pub(crate) type Topic = (&'static str, &'static str, Encoding);

pub(crate) const POINTS: &str = "sensor_msgs/msg/PointCloud2";
pub(crate) const TRANSFORMS: &str = "tf2_msgs/msg/TFMessage";

/// Index of a message's topic, time of recording, and bytes.
pub(crate) type Message = (usize, i64, Vec<u8>);

/// Options of a recording.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Style {
    /// `none`, `lz4`, `zstd` or `bz2`; for MCAP also `loose`, which means no chunks.
    pub(crate) compression: &'static str,
    pub(crate) per_chunk: usize,
    /// Whether index records follow each chunk.
    pub(crate) indexed: bool,
    /// Whether the recording was closed: topics, and for MCAP the footer, are at the end.
    pub(crate) closed: bool,
}

impl Style {
    pub(crate) fn of(compression: &'static str) -> Self {
        Self { compression, per_chunk: 3, indexed: true, closed: true }
    }
}

fn compress(compression: &str, plain: &[u8]) -> Vec<u8> {
    match compression {
        // Two frames, which together form the chunk.
        "zstd" => {
            let halves = <[&[u8]; 2]>::from(plain.split_at(plain.len() / 2));
            let level = || ruzstd::encoding::CompressionLevel::Fastest;
            halves.map(|half| ruzstd::encoding::compress_to_vec(half, level())).concat()
        }
        "lz4" => {
            let mut encoder = lz4_flex::frame::FrameEncoder::new(Vec::new());
            encoder.write_all(plain).unwrap();
            encoder.finish().unwrap()
        }
        "bz2" => {
            let mut encoder = bzip2::write::BzEncoder::new(Vec::new(), bzip2::Compression::fast());
            encoder.write_all(plain).unwrap();
            encoder.finish().unwrap()
        }
        _ => plain.to_vec(),
    }
}

fn text(text: &str) -> Vec<u8> {
    [&(text.len() as u32).to_le_bytes()[..], text.as_bytes()].concat()
}

fn record(kind: u8, parts: &[&[u8]]) -> Vec<u8> {
    let body = parts.concat();
    [&[kind][..], &(body.len() as u64).to_le_bytes(), &body].concat()
}

const MAGIC: &[u8] = b"\x89MCAP0\r\n";

pub(crate) fn mcap(topics: &[Topic], messages: &[Message], style: Style) -> Vec<u8> {
    let number = |value: usize| (value as u16 + 1).to_le_bytes();
    let described = |index: usize| {
        let (name, type_name, encoding) = topics[index];
        let encoding = if encoding == Encoding::Ros1 { "ros1" } else { "cdr" };
        let schema = record(3, &[&number(index), &text(type_name), &text("a"), &text("")]);
        [schema, record(4, &[&number(index), &number(index), &text(name), &text(encoding), &[0; 4]])].concat()
    };
    let mut file = [MAGIC, &record(1, &[&text("a"), &text("b")])].concat();
    let mut known = vec![false; topics.len()];
    for messages in messages.chunks(style.per_chunk) {
        let mut content = Vec::new();
        let mut places = vec![Vec::new(); topics.len()];
        for (topic, time, data) in messages {
            if !std::mem::replace(&mut known[*topic], true) {
                content.extend(described(*topic));
            }
            places[*topic].push((*time, content.len() as u64));
            let time = time.to_le_bytes();
            content.extend(record(5, &[&number(*topic), &[0; 4], &time, &time, data]));
        }
        if style.compression == "loose" {
            file.extend(content);
            continue;
        }
        let (compressed, times) = (compress(style.compression, &content), [0; 16]);
        let name = if style.compression == "none" { "" } else { style.compression };
        let (size, crc) = ((content.len() as u64).to_le_bytes(), crc32fast::hash(&content).to_le_bytes());
        let len = (compressed.len() as u64).to_le_bytes();
        file.extend(record(6, &[&times, &size, &crc, &text(name), &len, &compressed]));
        for (topic, places) in places.iter().enumerate().filter(|(_, places)| style.indexed && !places.is_empty()) {
            let entries = places.iter().flat_map(|(time, at)| [time.to_le_bytes(), at.to_le_bytes()].concat());
            let entries: Vec<u8> = entries.collect();
            file.extend(record(7, &[&number(topic), &(entries.len() as u32).to_le_bytes(), &entries]));
        }
    }
    if style.closed {
        file.extend(record(15, &[&[0; 4]]));
        (0..topics.len()).for_each(|index| file.extend(described(index)));
        file.extend(record(2, &[&[0; 20]]));
        file.extend_from_slice(MAGIC);
    }
    file
}

/// A record of a bag: named fields, then data.
fn bag_record(values: &[(&str, &[u8])], data: &[u8]) -> Vec<u8> {
    let field = |(name, value): &(&str, &[u8])| {
        let field = [name.as_bytes(), b"=", value].concat();
        [&(field.len() as u32).to_le_bytes()[..], &field].concat()
    };
    let header: Vec<u8> = values.iter().flat_map(field).collect();
    [&(header.len() as u32).to_le_bytes()[..], &header, &(data.len() as u32).to_le_bytes(), data].concat()
}

pub(crate) fn bag(topics: &[Topic], messages: &[Message], style: Style) -> Vec<u8> {
    let connection = |topic: usize| {
        let (name, type_name, _) = topics[topic];
        let inner =
            bag_record(&[("topic", name.as_bytes()), ("type", type_name.replace("/msg/", "/").as_bytes())], b"");
        let own = &inner[4..inner.len() - 4];
        bag_record(&[("op", &[7]), ("conn", &(topic as u32).to_le_bytes()), ("topic", name.as_bytes())], own)
    };
    let stamp = |time: i64| {
        let [seconds, rest] = [time / 1_000_000_000, time % 1_000_000_000].map(|value| (value as u32).to_le_bytes());
        [seconds, rest].concat()
    };
    let mut file = b"#ROSBAG V2.0\n".to_vec();
    file.extend(bag_record(&[("op", &[3]), ("index_pos", &[0; 8])], &[b' '; 100]));
    let mut known = vec![false; topics.len()];
    for messages in messages.chunks(style.per_chunk) {
        let mut content = Vec::new();
        let mut places = vec![Vec::new(); topics.len()];
        for (topic, time, data) in messages {
            if !std::mem::replace(&mut known[*topic], true) {
                content.extend(connection(*topic));
            }
            places[*topic].extend([stamp(*time), (content.len() as u32).to_le_bytes().to_vec()].concat());
            let number = (*topic as u32).to_le_bytes();
            content.extend(bag_record(&[("op", &[2]), ("conn", &number), ("time", &stamp(*time))], data));
        }
        let size = (content.len() as u32).to_le_bytes();
        let header: [(&str, &[u8]); 3] = [("op", &[5]), ("compression", style.compression.as_bytes()), ("size", &size)];
        file.extend(bag_record(&header, &compress(style.compression, &content)));
        for (topic, places) in places.iter().enumerate().filter(|(_, places)| style.indexed && !places.is_empty()) {
            file.extend(bag_record(
                &[("op", &[4]), ("ver", &[1, 0, 0, 0]), ("conn", &(topic as u32).to_le_bytes())],
                places,
            ));
        }
    }
    if style.closed {
        (0..topics.len()).for_each(|topic| file.extend(connection(topic)));
        file.extend(bag_record(&[("op", &[6])], b""));
    }
    file
}
