//! Hand-made ROS messages.

use autosplats_sources::point_cloud2::Encoding;

/// Writes the values of a message.
pub(crate) struct Writer {
    encoding: Encoding,
    big_endian: bool,
    pub(crate) bytes: Vec<u8>,
}

impl Writer {
    pub(crate) fn new(encoding: Encoding, big_endian: bool) -> Self {
        let bytes = match encoding {
            Encoding::Ros1 => Vec::new(),
            Encoding::Cdr => vec![0, u8::from(!big_endian), 0, 0],
        };
        Self { encoding, big_endian, bytes }
    }

    pub(crate) fn u8(&mut self, value: u8) {
        self.bytes.push(value);
    }

    pub(crate) fn u32(&mut self, value: u32) {
        self.number(&mut value.to_le_bytes());
    }

    pub(crate) fn f64(&mut self, value: f64) {
        self.number(&mut value.to_le_bytes());
    }

    fn number(&mut self, raw: &mut [u8]) {
        if self.encoding == Encoding::Cdr {
            while !(self.bytes.len() - 4).is_multiple_of(raw.len()) {
                self.bytes.push(0xaa);
            }
        }
        if self.big_endian {
            raw.reverse();
        }
        self.bytes.extend_from_slice(raw);
    }

    pub(crate) fn string(&mut self, text: &str) {
        let zero = self.encoding == Encoding::Cdr;
        self.u32((text.len() + usize::from(zero)) as u32);
        self.bytes.extend_from_slice(text.as_bytes());
        self.bytes.extend(zero.then_some(0));
    }

    pub(crate) fn header(&mut self, stamp: i64, frame: &str) {
        if self.encoding == Encoding::Ros1 {
            self.u32(7);
        }
        self.u32((stamp / 1_000_000_000) as u32);
        self.u32((stamp % 1_000_000_000) as u32);
        self.string(frame);
    }
}

/// A PointCloud2 message, valid or not.
#[derive(Clone)]
pub(crate) struct Cloud2 {
    pub(crate) stamp: i64,
    pub(crate) frame: String,
    pub(crate) height: u32,
    pub(crate) width: u32,
    /// Name, offset, type and count.
    pub(crate) fields: Vec<(&'static str, u32, u8, u32)>,
    pub(crate) big_endian: bool,
    pub(crate) point_step: u32,
    pub(crate) row_step: u32,
    pub(crate) data: Vec<u8>,
}

pub(crate) const F32: u8 = 7;
pub(crate) const F64: u8 = 8;

impl Cloud2 {
    /// Points with x, y and z at the beginning of `step` bytes each.
    pub(crate) fn xyz(positions: &[[f32; 3]], step: u32) -> Self {
        let gap = vec![0xee; step as usize - 12];
        let data = positions.iter().flat_map(|xyz| [xyz.map(f32::to_le_bytes).as_flattened(), &gap].concat()).collect();
        Self {
            stamp: 1_700_000_000_123_456_789,
            frame: "lidar".into(),
            height: 1,
            width: positions.len() as u32,
            fields: vec![("x", 0, F32, 1), ("y", 4, F32, 1), ("z", 8, F32, 1)],
            big_endian: false,
            point_step: step,
            row_step: step * positions.len() as u32,
            data,
        }
    }

    pub(crate) fn message(&self, encoding: Encoding, big_endian: bool) -> Vec<u8> {
        let mut writer = Writer::new(encoding, big_endian);
        writer.header(self.stamp, &self.frame);
        writer.u32(self.height);
        writer.u32(self.width);
        writer.u32(self.fields.len() as u32);
        for &(name, offset, datatype, count) in &self.fields {
            writer.string(name);
            writer.u32(offset);
            writer.u8(datatype);
            writer.u32(count);
        }
        writer.u8(u8::from(self.big_endian));
        writer.u32(self.point_step);
        writer.u32(self.row_step);
        writer.u32(self.data.len() as u32);
        writer.bytes.extend_from_slice(&self.data);
        writer.u8(1);
        writer.bytes
    }

    pub(crate) fn cdr(&self) -> Vec<u8> {
        self.message(Encoding::Cdr, false)
    }
}

/// A message of transforms: time, parent, child, translation and quaternion (x, y, z, w).
pub(crate) type Transform<'a> = (i64, &'a str, &'a str, [f64; 3], [f64; 4]);

pub(crate) fn transforms(encoding: Encoding, transforms: &[Transform<'_>]) -> Vec<u8> {
    let mut writer = Writer::new(encoding, false);
    writer.u32(transforms.len() as u32);
    for (stamp, parent, child, translation, rotation) in transforms {
        writer.header(*stamp, parent);
        writer.string(child);
        translation.iter().chain(rotation).for_each(|&value| writer.f64(value));
    }
    writer.bytes
}
