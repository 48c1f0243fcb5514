//! Tests of PointCloud2 messages of every layout, valid and invalid.

use std::path::Path;

use crate::common::{
    colors, positions,
    ros::{Cloud2, F32, F64},
};
use autosplats_cloud::{Axes, Error, FieldValues, PointCloud, Random, glam::DVec3};
use autosplats_formats::ReadOptions;
use autosplats_sources::point_cloud2::{self, Encoding, Message};

fn decode(bytes: &[u8], encoding: Encoding) -> Result<Message, Error> {
    point_cloud2::decode(Path::new("/points"), bytes, encoding, &ReadOptions::default())
}

fn cloud(message: &Cloud2) -> PointCloud {
    decode(&message.cdr(), Encoding::Cdr).unwrap().cloud
}

/// The error of a message that must be refused: one line that names the topic.
fn refusal(message: &Cloud2) -> String {
    let error = decode(&message.cdr(), Encoding::Cdr).unwrap_err().to_string();
    assert!(error.starts_with("/points: byte ") && !error.contains(char::is_control), "{error}");
    error
}

#[test]
fn both_serialisations_and_byte_orders_are_the_same_points() {
    let message = Cloud2::xyz(&positions(100), 16);
    for (encoding, big_endian) in [(Encoding::Ros1, false), (Encoding::Cdr, false), (Encoding::Cdr, true)] {
        let decoded = decode(&message.message(encoding, big_endian), encoding).unwrap();
        assert_eq!(decoded.cloud.positions(), positions(100), "{encoding:?}, big-endian: {big_endian}");
        assert_eq!((&*decoded.frame_id, decoded.stamp), ("lidar", message.stamp), "{encoding:?}");
        assert_eq!(decoded.cloud.scans()[0].position(), DVec3::ZERO, "the sensor is at its own origin");
    }
}

#[test]
fn points_of_any_step_are_found() {
    for step in [12, 13, 16, 20, 32, 48, 100] {
        for count in [1, 2, 1000, 300_000] {
            let cloud = cloud(&Cloud2::xyz(&positions(count), step));
            assert_eq!(cloud.positions(), positions(count), "{count} points of {step} bytes");
        }
    }
}

/// rerun's issue 12598: all points equalled the last one if x, y and z were not at the beginning.
#[test]
fn fields_lie_in_any_order_and_anywhere() {
    let mut random = Random::from_state(5);
    for round in 0..200 {
        // Each field at its own offset in a point with gaps, in any order of the list and either byte order.
        let sizes = [1, 1, 2, 2, 4, 4, 4, 8];
        let names = ["x", "y", "z", "a", "b", "c", "d", "e", "f", "g", "h"];
        let mut fields = Vec::new();
        let mut offset = random.modulo(5) as u32;
        let mut places: Vec<usize> = (0..names.len()).collect();
        places.sort_by_key(|_| random.bits());
        for place in places {
            let datatype = if place < 3 { 7 + random.modulo(2) as u8 } else { place as u8 - 2 };
            let count = if place < 3 { 1 } else { 1 + random.modulo(3) as u32 };
            fields.push((names[place], offset, datatype, count));
            offset += sizes[usize::from(datatype) - 1] * count + random.modulo(4) as u32;
        }
        fields.sort_by_key(|_| random.bits());
        let (width, height, big_endian) = (1 + random.modulo(9) as u32, 1 + random.modulo(4) as u32, round % 2 == 0);
        let point_step = offset + random.modulo(9) as u32;
        let row_step = point_step * width + random.modulo(2) as u32 * random.modulo(40) as u32;
        let mut data: Vec<u8> = (0..row_step * height).map(|_| random.bits() as u8).collect();
        // Writes the expected values into the message.
        let mut expected = Vec::new();
        for row in 0..height {
            for column in 0..width {
                let start = (row * row_step + column * point_step) as usize;
                let mut values = Vec::new();
                for &(name, offset, datatype, count) in &fields {
                    for index in 0..count {
                        let size = sizes[usize::from(datatype) - 1] as usize;
                        let at = start + offset as usize + index as usize * size;
                        let value = random.modulo(100) as f64;
                        let mut raw = match datatype {
                            1 => (value as i8).to_le_bytes().to_vec(),
                            2 => (value as u8).to_le_bytes().to_vec(),
                            3 => (-value as i16).to_le_bytes().to_vec(),
                            4 => (value as u16 * 600).to_le_bytes().to_vec(),
                            5 => (-value as i32 * 70_000).to_le_bytes().to_vec(),
                            6 => (value as u32 * 40_000_000).to_le_bytes().to_vec(),
                            7 => (value as f32 + 0.5).to_le_bytes().to_vec(),
                            _ => (value - 0.25).to_le_bytes().to_vec(),
                        };
                        if big_endian {
                            raw.reverse();
                        }
                        data[at..at + size].copy_from_slice(&raw);
                        let value = match datatype {
                            3 => -value,
                            4 => value * 600.0,
                            5 => -value * 70_000.0,
                            6 => value * 40_000_000.0,
                            7 => value + 0.5,
                            8 => value - 0.25,
                            _ => value,
                        };
                        let name = if count == 1 { name.to_owned() } else { format!("{name}_{index}") };
                        values.push((name, value));
                    }
                }
                expected.push(values);
            }
        }
        let message = Cloud2 { height, width, fields, big_endian, point_step, row_step, data, ..Cloud2::xyz(&[], 12) };
        let cloud = cloud(&message);
        assert_eq!(cloud.len(), expected.len(), "round {round}");
        for (index, values) in expected.iter().enumerate() {
            for (name, value) in values {
                let found = match &**name {
                    "x" => cloud.world_position(index).x,
                    "y" => cloud.world_position(index).y,
                    "z" => cloud.world_position(index).z,
                    // The library's name for a field called `a` in files.
                    "a" => cloud.field("Alpha").unwrap().values.get(index),
                    name => cloud.field(name).unwrap_or_else(|| panic!("{name}, round {round}")).values.get(index),
                };
                assert_eq!(found, *value, "{name} of point {index}, round {round}");
            }
        }
    }
}

/// rerun's issue 12797: every further field had the value of x.
#[test]
fn every_field_has_its_own_offset() {
    let mut message = Cloud2::xyz(&positions(50), 32);
    message.fields.extend([("intensity", 16, F32, 1), ("ring", 20, 4, 1), ("t", 24, F64, 1)]);
    for (i, point) in message.data.chunks_mut(32).enumerate() {
        point[16..20].copy_from_slice(&(i as f32 * 2.0).to_le_bytes());
        point[20..22].copy_from_slice(&(i as u16 * 3).to_le_bytes());
        point[24..32].copy_from_slice(&(i as f64 * 0.1).to_le_bytes());
    }
    let cloud = cloud(&message);
    let field = |name| &cloud.field(name).unwrap().values;
    assert_eq!(*field("Intensity"), FieldValues::F32((0..50).map(|i| i as f32 * 2.0).collect()), "as files call it");
    assert_eq!(*field("Ring"), FieldValues::U16((0..50).map(|i| i * 3).collect()), "between gaps");
    assert_eq!(*field("t"), FieldValues::F64((0..50).map(|i| f64::from(i) * 0.1).collect()), "the last");
}

#[test]
fn colours_are_packed_in_either_type_or_channels() {
    let expected = colors(20);
    for (name, datatype) in [("rgb", F32), ("rgba", 6), ("rgb", 6), ("rgba", F32)] {
        let mut message = Cloud2::xyz(&positions(20), 32);
        message.fields.push((name, 16, datatype, 1));
        for (point, [red, green, blue]) in message.data.chunks_mut(32).zip(&expected) {
            point[16..20].copy_from_slice(&[*blue, *green, *red, 255]);
        }
        assert_eq!(cloud(&message).colors(), Some(&*expected), "{name} of type {datatype}");
    }
    let mut message = Cloud2::xyz(&positions(20), 16);
    message.fields.extend([("r", 13, 2, 1), ("g", 12, 2, 1), ("b", 15, 2, 1)]);
    for (point, [red, green, blue]) in message.data.chunks_mut(16).zip(&expected) {
        (point[13], point[12], point[15]) = (*red, *green, *blue);
    }
    assert_eq!(cloud(&message).colors(), Some(&*expected), "channels");
}

#[test]
fn no_returns_are_left_out_and_what_is_no_number_stays() {
    let mut points = positions(10);
    points[3] = [0.0; 3];
    points[7] = [f32::NAN; 3];
    let message = Cloud2::xyz(&points, 16);
    let decoded = decode(&message.cdr(), Encoding::Cdr).unwrap();
    assert_eq!((decoded.cloud.len(), decoded.no_returns), (9, 1), "whatever is_dense says");
    assert!(decoded.cloud.positions()[6][0].is_nan(), "NaN stays");
    assert_eq!(decoded.cloud.scans()[0].points, 0..9, "all that are left were seen from there");
    let options = ReadOptions { keep_no_returns: true, ..ReadOptions::default() };
    let kept = point_cloud2::decode(Path::new("a"), &message.cdr(), Encoding::Cdr, &options).unwrap();
    assert_eq!(kept.cloud.len(), 10, "unless they are wanted");
    let nothing = decode(&Cloud2::xyz(&[[0.0; 3]; 5], 12).cdr(), Encoding::Cdr).unwrap();
    assert_eq!((nothing.cloud.len(), nothing.no_returns), (0, 5), "the sky");
}

#[test]
fn doubles_far_from_the_origin_keep_their_digits() {
    let places: Vec<[f64; 3]> =
        positions(30).iter().map(|[x, y, z]| [5e5 + f64::from(*x), 5e6 + f64::from(*y), f64::from(*z)]).collect();
    let mut message = Cloud2::xyz(&[], 12);
    message.fields = vec![("x", 0, F64, 1), ("y", 8, F64, 1), ("z", 16, F64, 1)];
    (message.width, message.point_step) = (30, 24);
    message.data = places.as_flattened().iter().flat_map(|value| value.to_le_bytes()).collect();
    let cloud = cloud(&message);
    for (i, place) in places.iter().enumerate() {
        assert!((cloud.world_position(i) - DVec3::from(*place)).length() < 1e-5, "point {i}");
    }
}

#[test]
fn the_step_of_a_row_is_believed_only_if_it_fits() {
    let points = positions(12);
    for row_step in [0, 1, 47, 49, 1000, u32::MAX] {
        let mut message = Cloud2::xyz(&points, 12);
        (message.height, message.width, message.row_step) = (3, 4, row_step);
        assert_eq!(cloud(&message).positions(), points, "a row of {row_step} bytes");
    }
}

#[test]
fn messages_without_points_are_clouds_without_points() {
    let mut placeholder = Cloud2::xyz(&[], 12);
    (placeholder.point_step, placeholder.width, placeholder.height) = (0, 1, 1);
    placeholder.fields.clear();
    let mut wide = Cloud2::xyz(&[], 12);
    (wide.width, wide.height) = (u32::MAX, 0);
    for message in [Cloud2::xyz(&[], 12), placeholder, wide] {
        assert!(cloud(&message).is_empty(), "no points");
    }
}

#[test]
fn points_of_no_height_or_width_are_one_row() {
    let mut message = Cloud2::xyz(&positions(12), 16);
    for (width, height) in [(12, 0), (0, 12), (1, 12), (12, 1), (3, 4)] {
        (message.width, message.height) = (width, height);
        assert_eq!(cloud(&message).positions(), positions(12), "{width} × {height}");
    }
    (message.width, message.height) = (11, 0);
    assert!(cloud(&message).is_empty(), "a buffer that is not cleared");
}

#[test]
fn frames_tell_who_saw_the_points_and_which_way_is_up() {
    let with = |frame: &str| {
        let message = Cloud2 { frame: frame.into(), ..Cloud2::xyz(&positions(3), 12) };
        decode(&message.cdr(), Encoding::Cdr).unwrap()
    };
    assert_eq!(with("/os_sensor").frame_id, "os_sensor", "the slash of old");
    assert!(with("map").cloud.scans().is_empty(), "nobody stood at the origin of the map");
    assert_eq!(with("camera_depth_optical_frame").cloud.axes(), Some(Axes::Camera), "a camera's frame");
    assert_eq!(with("base_link").cloud.axes(), Some(Axes::ZUp), "any other");
}

#[test]
fn messages_that_lie_are_refused_in_a_line() {
    let good = Cloud2::xyz(&positions(10), 16);
    type Lie = fn(&mut Cloud2);
    let lies: [(&str, Lie); 12] = [
        ("do not fit into a point", |message| message.fields[2].1 = 14),
        ("do not fit into a point", |message| message.fields[2].1 = u32::MAX),
        ("do not fit into a point", |message| message.fields[2].3 = u32::MAX),
        ("unknown type", |message| message.fields[0].2 = 99),
        ("unknown type", |message| message.fields[0].2 = 0),
        ("no x, y and z", |message| message.fields[0].0 = "u"),
        ("0 bytes", |message| message.point_step = 0),
        ("do not fit into 160 bytes", |message| message.point_step = 17),
        ("do not fit into 160 bytes", |message| message.width = 11),
        ("do not fit into 160 bytes", |message| message.height = u32::MAX),
        ("more than any memory", |message| {
            (message.width, message.height, message.point_step) = (u32::MAX, u32::MAX, u32::MAX);
        }),
        ("over one another", |message| message.fields.extend([("a", 8, F64, 1); 3])),
    ];
    for (what, lie) in lies {
        let mut message = good.clone();
        lie(&mut message);
        assert!(refusal(&message).contains(what), "{what}: {}", refusal(&message));
    }
}

#[test]
fn messages_cut_or_changed_anywhere_do_no_harm() {
    let mut message = Cloud2::xyz(&positions(20), 32);
    message.fields.extend([("intensity", 16, F32, 1), ("normal", 20, F32, 3)]);
    for encoding in [Encoding::Ros1, Encoding::Cdr] {
        let bytes = message.message(encoding, false);
        for len in 0..bytes.len() {
            // The last byte states whether all points are valid, and is ignored.
            assert_eq!(decode(&bytes[..len], encoding).is_ok(), len == bytes.len() - 1, "cut after {len} bytes");
        }
        let mut random = Random::from_state(9);
        for _ in 0..20_000 {
            let mut bytes = bytes.clone();
            for _ in 0..1 + random.modulo(4) {
                let at = random.modulo(bytes.len().min(200));
                bytes[at] = if random.modulo(2) == 0 { 255 } else { random.bits() as u8 };
            }
            if let Ok(message) = decode(&bytes, encoding) {
                assert!(message.cloud.byte_len() <= 20 * bytes.len(), "memory in proportion to the message");
            }
        }
    }
    let packed = decode(b"\x28\xb5\x2f\xfd....", Encoding::Cdr).unwrap_err().to_string();
    assert!(packed.contains("ros2 bag convert"), "messages that are compressed by themselves: {packed}");
    let mut claims = Cloud2::xyz(&[], 12).cdr();
    let fields = 4 + 8 + 8 + 8 + 8;
    claims[fields..fields + 4].copy_from_slice(&5_000_000_u32.to_le_bytes());
    assert!(decode(&claims, Encoding::Cdr).is_err(), "millions of fields");
}
