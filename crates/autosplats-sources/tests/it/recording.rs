//! Tests of recordings: whole, cut off, damaged and real ones, with and without transforms.

mod damage;

use std::{path::Path, sync::Mutex, time::Duration};

use crate::common::{
    positions,
    recording::{Message, POINTS, Style, TRANSFORMS, Topic, bag, mcap},
    ros::{Cloud2, transforms},
    shared_data,
};
use autosplats_cloud::{
    Axes, Error, Progress, Random,
    glam::{DMat4, DQuat, DVec3},
};
use autosplats_formats::ReadOptions;
use autosplats_sources::{
    Next, Recording, RecordingOptions, Stream as _, Update, describe_recording, is_recording, point_cloud2::Encoding,
};

const START: i64 = 1_700_000_000_000_000_000;
const SECOND: i64 = 1_000_000_000;

/// Stores the notes.
#[derive(Default)]
struct Notes {
    notes: Mutex<Vec<String>>,
    done: Mutex<f32>,
}

impl Progress for Notes {
    fn report(&self, fraction: f32) {
        let mut done = self.done.lock().unwrap();
        assert!((*done..=1.0).contains(&fraction), "progress of {fraction} after {done}");
        *done = fraction;
    }

    fn note(&self, note: &str) {
        assert!(!note.contains(char::is_control), "one line: {note:?}");
        self.notes.lock().unwrap().push(note.into());
    }
}

impl Notes {
    fn all(self) -> Vec<String> {
        self.notes.into_inner().unwrap()
    }
}

fn open(name: &str, bytes: &[u8], options: &RecordingOptions) -> Result<(Recording, Vec<String>), Error> {
    let notes = Notes::default();
    let recording = Recording::from_bytes(Path::new(name), bytes.to_vec(), options, &notes)?;
    Ok((recording, notes.all()))
}

/// Plays to the end, and returns updates and refusals.
fn play(recording: &mut Recording) -> (Vec<Update>, Vec<String>) {
    let (mut updates, mut refusals) = (Vec::new(), Vec::new());
    loop {
        match recording.next(Duration::ZERO, &()) {
            Ok(Next::Update(update)) => updates.push(update),
            Ok(Next::Nothing) => panic!("a recording waits for nothing"),
            Ok(Next::End) => return (updates, refusals),
            Err(error) => {
                let error = error.to_string();
                assert!(!error.contains(char::is_control), "one line: {error:?}");
                refusals.push(error);
            }
        }
    }
}

/// The points of a frame, different in each frame.
fn points(frame: usize) -> Vec<[f32; 3]> {
    positions(40).iter().map(|[x, y, z]| [x + frame as f32, *y, *z]).collect()
}

fn cloud(frame: usize, sensor: &str, encoding: Encoding) -> Vec<u8> {
    let stamp = START + frame as i64 * SECOND / 10;
    Cloud2 { stamp, frame: sensor.into(), ..Cloud2::xyz(&points(frame), 16) }.message(encoding, false)
}

/// Ten frames of one topic, a tenth of a second apart, with other messages between them.
fn ten(encoding: Encoding) -> (Vec<Topic>, Vec<Message>) {
    let topics = vec![("/points", POINTS, encoding), ("/imu", "sensor_msgs/msg/Imu", encoding)];
    let time = |frame: usize| START + frame as i64 * SECOND / 10 + 5;
    let both = |frame| [(0, time(frame), cloud(frame, "lidar", encoding)), (1, time(frame) + 1, vec![1; 50])];
    (topics, (0..10).flat_map(both).collect())
}

fn all_styles() -> Vec<(String, Vec<u8>)> {
    let mut files = Vec::new();
    for encoding in [Encoding::Ros1, Encoding::Cdr] {
        let (topics, messages) = ten(encoding);
        for compression in ["none", "lz4", "zstd", "loose", "bz2"] {
            for (indexed, closed) in [(true, true), (false, true), (true, false), (false, false)] {
                let style = Style { indexed, closed, ..Style::of(compression) };
                let what = format!("{encoding:?} {style:?}");
                if compression != "bz2" {
                    files.push((format!("{what}.mcap"), mcap(&topics, &messages, style)));
                }
                if compression != "loose" && encoding == Encoding::Ros1 {
                    files.push((format!("{what}.bag"), bag(&topics, &messages, style)));
                }
            }
        }
    }
    files
}

#[test]
fn recordings_of_every_kind_play_the_same_points() {
    for (name, bytes) in all_styles() {
        let (mut recording, notes) = open(&name, &bytes, &RecordingOptions::default()).unwrap();
        assert_eq!(notes.is_empty(), name.contains("closed: true"), "{name}: {notes:?}");
        assert_eq!(recording.channels(), ["/points"], "{name}");
        assert_eq!(recording.timeline().unwrap().stamps().len(), 10, "{name}");
        let (updates, refusals) = play(&mut recording);
        assert!(refusals.is_empty(), "{name}: {refusals:?}");
        for (frame, update) in updates.iter().enumerate() {
            assert_eq!(update.cloud.positions(), points(frame), "{name}, frame {frame}");
            assert_eq!((update.channel, update.stamp), (0, START + frame as i64 * SECOND / 10), "{name}");
        }
        assert_eq!((updates.len() as u64, recording.statistics().taken), (10, 10), "{name}");
        let summary = recording.summary();
        let topics: Vec<_> = summary.topics.iter().map(|topic| (&*topic.name, topic.messages, topic.points)).collect();
        assert_eq!(topics, [("/imu", 10, false), ("/points", 10, true)], "{name}");
        assert_eq!(summary.duration, Duration::from_nanos(900_000_001), "{name}");
        assert_eq!(summary.frames, ["lidar"], "{name}");
    }
}

#[test]
fn the_writer_of_the_format_makes_files_that_are_read() {
    let (topics, messages) = ten(Encoding::Cdr);
    for (chunks, indexes) in [(true, true), (true, false), (false, false)] {
        let options = mcap::WriteOptions::new().compression(None).chunk_size(Some(3000)).use_chunks(chunks);
        let options = options.emit_message_indexes(indexes).repeat_channels(indexes).repeat_schemas(indexes);
        let mut writer = mcap::Writer::with_options(std::io::Cursor::new(Vec::new()), options).unwrap();
        let mut ids = Vec::new();
        for (name, type_name, _) in &topics {
            let schema = writer.add_schema(type_name, "ros2msg", b"").unwrap();
            ids.push(writer.add_channel(schema, name, "cdr", &Default::default()).unwrap());
        }
        for (sequence, (topic, time, data)) in (0..).zip(&messages) {
            let time = *time as u64;
            let header =
                mcap::records::MessageHeader { channel_id: ids[*topic], sequence, log_time: time, publish_time: time };
            writer.write_to_known_channel(&header, data).unwrap();
        }
        writer.finish().unwrap();
        let (mut recording, notes) =
            open("a.mcap", &writer.into_inner().into_inner(), &RecordingOptions::default()).unwrap();
        assert!(notes.is_empty(), "{notes:?}");
        let (updates, _) = play(&mut recording);
        let found: Vec<_> = updates.iter().map(|update| update.cloud.positions().to_vec()).collect();
        assert_eq!(found, (0..10).map(points).collect::<Vec<_>>(), "chunks: {chunks}, indexes: {indexes}");
    }
}

#[test]
fn a_folder_that_lacks_a_part_plays_the_others() {
    let (topics, messages) = ten(Encoding::Cdr);
    let folder = tempfile::tempdir().unwrap();
    let [first, last] = [&messages[..8], &messages[14..]];
    for (name, messages) in [("a_0.mcap", first), ("a_2.mcap", last)] {
        std::fs::write(folder.path().join(name), mcap(&topics, messages, Style::of("zstd"))).unwrap();
    }
    let parts = "    - a_0.mcap\n    - a_1.mcap\n    - a_2.mcap\n    - a_3.mcap\n";
    let metadata = format!("rosbag2_bagfile_information:\n  relative_file_paths:\n{parts}  duration: 1\n");
    std::fs::write(folder.path().join("metadata.yaml"), metadata).unwrap();
    std::fs::write(folder.path().join("a_3.mcap"), "").unwrap();
    let notes = Notes::default();
    let mut recording = Recording::open(folder.path(), &RecordingOptions::default(), &notes).unwrap();
    let (updates, refusals) = play(&mut recording);
    let stamps: Vec<i64> = updates.iter().map(|update| (update.stamp - START) * 10 / SECOND).collect();
    assert_eq!((stamps, refusals.len()), (vec![0, 1, 2, 3, 7, 8, 9], 0), "what is there");
    let notes = notes.all();
    let told =
        |name: &str| notes.iter().filter(|note| note.contains("a part is left out") && note.contains(name)).count();
    assert_eq!([notes.len(), told("a_1.mcap"), told("a_3.mcap")], [2, 1, 1], "each once: {notes:?}");
    assert_eq!((recording.statistics().refused, &recording.summary().notes), (2, &notes), "and counted");
    for name in ["a_0.mcap", "a_2.mcap"] {
        std::fs::remove_file(folder.path().join(name)).unwrap();
    }
    let none = Recording::open(folder.path(), &RecordingOptions::default(), &()).map(drop).unwrap_err().to_string();
    assert!(none.contains("a_0.mcap"), "none is there: {none}");
}

#[test]
fn the_same_frame_is_the_same_points_however_it_is_come_to() {
    let (topics, messages) = ten(Encoding::Cdr);
    let bytes = mcap(&topics, &messages, Style::of("zstd"));
    let (mut recording, _) = open("a.mcap", &bytes, &RecordingOptions::default()).unwrap();
    let (updates, _) = play(&mut recording);
    assert_eq!(recording.next(Duration::ZERO, &()).unwrap(), Next::End, "the end stays the end");
    for frame in [7, 2, 9, 0, 0] {
        recording.seek(frame);
        assert_eq!(recording.next(Duration::ZERO, &()).unwrap(), Next::Update(updates[frame].clone()), "frame {frame}");
    }
    recording.seek(10);
    assert_eq!(recording.next(Duration::ZERO, &()).unwrap(), Next::End, "beyond the last");
    let timeline = recording.timeline().unwrap();
    assert_eq!(timeline.frame_at(Duration::from_millis(450)), 4, "by time");
}

#[test]
fn whoever_has_enough_can_stop_it_and_loses_nothing() {
    struct Stop;
    impl Progress for Stop {
        fn report(&self, _fraction: f32) {}

        fn cancelled(&self) -> bool {
            true
        }
    }
    let (topics, messages) = ten(Encoding::Cdr);
    let bytes = mcap(&topics, &messages, Style::of("zstd"));
    let opened = Recording::from_bytes(Path::new("a.mcap"), bytes.clone(), &RecordingOptions::default(), &Stop);
    assert!(matches!(opened.map(drop), Err(Error::Cancelled)), "while it is opened");
    let (mut recording, _) = open("a.mcap", &bytes, &RecordingOptions::default()).unwrap();
    assert!(matches!(recording.next(Duration::ZERO, &Stop), Err(Error::Cancelled)), "while it is played");
    assert_eq!(play(&mut recording).0.len(), 10, "no frame was passed over");
}

#[test]
fn several_topics_are_channels_and_may_be_chosen() {
    let topics =
        vec![("/rear", POINTS, Encoding::Cdr), ("/front", POINTS, Encoding::Cdr), ("/third", POINTS, Encoding::Cdr)];
    let time = |frame: usize| START + frame as i64 * SECOND;
    let messages: Vec<Message> = [0, 1, 1, 2, 0]
        .iter()
        .enumerate()
        .map(|(i, &topic)| (topic, time(i), cloud(i, "lidar", Encoding::Cdr)))
        .collect();
    let bytes = mcap(&topics, &messages, Style::of("lz4"));
    let (mut recording, _) = open("a.mcap", &bytes, &RecordingOptions::default()).unwrap();
    assert_eq!(recording.channels(), ["/front", "/rear", "/third"], "by name");
    let channels: Vec<usize> = play(&mut recording).0.iter().map(|update| update.channel).collect();
    assert_eq!(channels, [1, 0, 0, 2, 1], "by time");
    assert_eq!(recording.seen_at(2), [0, 2], "the last of each until then");
    assert_eq!(recording.seen_at(99), [2, 3, 4], "at the end");
    let options = RecordingOptions { topics: vec!["/third".into(), "/rear".into()], ..Default::default() };
    let (mut recording, _) = open("a.mcap", &bytes, &options).unwrap();
    let channels: Vec<usize> = play(&mut recording).0.iter().map(|update| update.channel).collect();
    assert_eq!(channels, [1, 0, 1], "those wanted, in the order wanted");
    let options = RecordingOptions { topics: vec!["/lidar".into()], ..Default::default() };
    let error = open("a.mcap", &bytes, &options).map(drop).unwrap_err().to_string();
    assert!(error.contains("'/lidar'") && error.contains("/front, /rear, /third"), "{error}");
}

#[test]
fn transforms_bring_the_points_into_one_frame() {
    let half = std::f64::consts::FRAC_1_SQRT_2;
    for encoding in [Encoding::Ros1, Encoding::Cdr] {
        let topics =
            vec![("/points", POINTS, encoding), ("/tf", TRANSFORMS, encoding), ("/tf_static", TRANSFORMS, encoding)];
        let fixed = transforms(encoding, &[(0, "/base", "lidar", [1.0, 0.0, 0.5], [0.0, 0.0, half, half])]);
        // The robot moves along x at 10 m/s and turns by 90° per second. Poses come once a second.
        let moving = |second: i64| {
            let angle = second as f64 * std::f64::consts::FRAC_PI_2;
            let [x, y, z, w] = DQuat::from_rotation_z(angle).to_array();
            let stamp = START + second * SECOND;
            (1, stamp, transforms(encoding, &[(stamp, "map", "base", [10.0 * second as f64, 0.0, 0.0], [x, y, z, w])]))
        };
        let mut messages = vec![(2, START, fixed)];
        messages.extend((0..3).map(moving));
        messages
            .extend((0..10).map(|frame| (0, START + frame as i64 * SECOND / 10 + 7, cloud(frame, "lidar", encoding))));
        for bytes in [mcap(&topics, &messages, Style::of("zstd")), bag(&topics, &messages, Style::of("lz4"))] {
            if encoding == Encoding::Cdr && bytes.starts_with(b"#") {
                continue;
            }
            let (mut recording, notes) = open("a", &bytes, &RecordingOptions::default()).unwrap();
            assert!(notes.is_empty(), "{notes:?}");
            assert_eq!(recording.summary().frame.as_deref(), Some("map"), "the topmost");
            assert_eq!(recording.summary().frames, ["base", "lidar", "map"], "all of them");
            let base_from_lidar = DMat4::from_rotation_translation(
                DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2),
                DVec3::new(1.0, 0.0, 0.5),
            );
            for (frame, update) in play(&mut recording).0.iter().enumerate() {
                let share = frame as f64 / 10.0;
                let map_from_base = DMat4::from_translation(DVec3::new(10.0 * share, 0.0, 0.0))
                    * DMat4::from_rotation_z(share * std::f64::consts::FRAC_PI_2);
                let pose = map_from_base * base_from_lidar;
                for (i, point) in points(frame).iter().enumerate() {
                    let expected = pose.transform_point3(DVec3::from(point.map(f64::from)));
                    // Positions of some tens of metres in f32.
                    assert!(update.cloud.world_position(i).abs_diff_eq(expected, 1e-5), "point {i} of frame {frame}");
                }
                let scan = &update.cloud.scans()[0];
                assert!(scan.world_from_sensor.abs_diff_eq(pose, 1e-12), "where the sensor stood in frame {frame}");
            }
            for (wanted, moves) in [("lidar", false), ("base", true)] {
                let options = RecordingOptions { frame: Some(wanted.into()), ..Default::default() };
                let (mut recording, _) = open("a", &bytes, &options).unwrap();
                for (frame, update) in play(&mut recording).0.iter().enumerate() {
                    assert_eq!(update.cloud.positions() != points(frame), moves, "in the frame {wanted}");
                }
            }
            let options = RecordingOptions { frame: Some("moon".into()), ..Default::default() };
            let error = open("a", &bytes, &options).map(drop).unwrap_err().to_string();
            assert!(error.contains("'moon'") && error.contains("base, lidar, map"), "{error}");
        }
    }
}

#[test]
fn which_way_is_up_is_the_common_frame_s() {
    let encoding = Encoding::Cdr;
    let topics = vec![("/points", POINTS, encoding), ("/tf_static", TRANSFORMS, encoding)];
    let points = (0, START, cloud(0, "camera_optical", encoding));
    let pose = (1, START, transforms(encoding, &[(0, "base", "camera_optical", [1.0; 3], [0.5, -0.5, 0.5, -0.5])]));
    for (messages, axes) in [(vec![points.clone()], Axes::Camera), (vec![pose, points], Axes::ZUp)] {
        let bytes = mcap(&topics, &messages, Style::of("none"));
        let (mut recording, _) = open("a.mcap", &bytes, &RecordingOptions::default()).unwrap();
        assert_eq!(play(&mut recording).0[0].cloud.axes(), Some(axes), "{} messages", messages.len());
    }
}

#[test]
fn transforms_that_make_no_sense_do_no_harm() {
    let encoding = Encoding::Cdr;
    let topics = vec![("/points", POINTS, encoding), ("/tf", TRANSFORMS, encoding), ("/other", POINTS, encoding)];
    let turn = [0.0, 0.0, 0.0, 1.0];
    let bad = transforms(
        encoding,
        &[
            // A cycle, frames that are their own parent, invalid rotations and translations.
            (START, "b", "a", [1.0; 3], turn),
            (START, "a", "b", [1.0; 3], turn),
            (START, "lidar", "lidar", [1.0; 3], turn),
            (START, "map", "lidar", [f64::NAN; 3], turn),
            (START, "map", "lidar", [1.0; 3], [0.0; 4]),
            (START, "map", "lidar", [1e300; 3], turn),
            (START, "map", "lidar", [1.0, 2.0, 3.0], [0.0, 0.0, 0.0, 2.0]),
            (i64::from(u32::MAX) * SECOND, "map", "lidar", [1.0, 2.0, 3.0], turn),
        ],
    );
    let messages = vec![
        (1, START, bad),
        (1, START, vec![0, 1, 0, 0, 255, 255, 255, 255, 1]),
        (0, START, cloud(0, "lidar", encoding)),
        (2, START, cloud(1, "a", encoding)),
    ];
    let bytes = mcap(&topics, &messages, Style { per_chunk: 1, ..Style::of("none") });
    let (mut recording, notes) = open("a.mcap", &bytes, &RecordingOptions::default()).unwrap();
    assert!(notes.iter().any(|note| note.contains("transforms cannot be read")), "{notes:?}");
    let (updates, _) = play(&mut recording);
    let moved = points(0)[0].map(f64::from);
    assert_eq!(
        updates[0].cloud.world_position(0),
        (DVec3::from(moved) + DVec3::new(1.0, 2.0, 3.0)).as_vec3().as_dvec3()
    );
    assert_eq!(updates[1].cloud.positions(), points(1), "what is in a circle stays where it is");
}

#[test]
fn what_is_no_recording_says_what_it_is() {
    let refusal =
        |name: &str, bytes: &[u8]| open(name, bytes, &RecordingOptions::default()).map(drop).unwrap_err().to_string();
    assert!(refusal("a.mcap", b"").contains("is empty"), "nothing");
    assert!(refusal("a.mcap", b"version https://git-lfs.github.com/spec/v1\n").contains("git lfs pull"), "a pointer");
    assert!(refusal("a.db3", b"SQLite format 3\0....").contains("ros2 bag convert"), "a database");
    assert!(refusal("a.mcap", b"hello").contains("neither"), "something else");
    let none = mcap(&[("/imu", "sensor_msgs/msg/Imu", Encoding::Cdr)], &[(0, 1, vec![1])], Style::of("zstd"));
    assert!(refusal("a.mcap", &none).contains("/imu (sensor_msgs/msg/Imu)"), "no points");
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    std::fs::write(&path, &none).unwrap();
    assert_eq!(describe_recording(&path, &()).unwrap().topics.len(), 1, "but it can be described");
    assert!(is_recording(&path) && !is_recording(folder.path()), "by name");
}

#[test]
fn the_parts_of_a_folder_are_one_recording() {
    let (topics, messages) = ten(Encoding::Cdr);
    let folder = tempfile::tempdir().unwrap();
    let (first, second) = messages.split_at(9);
    let write = |name: &str, bytes: &[u8]| std::fs::write(folder.path().join(name), bytes).unwrap();
    write("z.mcap", &mcap(&topics, first, Style::of("zstd")));
    write("a.mcap", &mcap(&topics, second, Style::of("none")));
    let play_folder = || {
        let mut recording = Recording::open(folder.path(), &RecordingOptions::default(), &()).unwrap();
        assert_eq!(recording.summary().topics[1].messages, 10, "counted together");
        let (updates, _) = play(&mut recording);
        let found: Vec<_> = updates.iter().map(|update| update.cloud.positions().to_vec()).collect();
        assert_eq!(found, (0..10).map(points).collect::<Vec<_>>(), "in order");
    };
    play_folder();
    write("metadata.yaml", b"a:\n  relative_file_paths:\n    - z.mcap\n    - a.mcap\n  duration: 1\n");
    assert!(is_recording(folder.path()), "by what is in it");
    play_folder();
    write("metadata.yaml", b"a:\n  relative_file_paths:\n  - b.db3\n");
    write("b.db3", b"SQLite format 3\0");
    let error = Recording::open(folder.path(), &RecordingOptions::default(), &()).map(drop).unwrap_err().to_string();
    assert!(error.contains("ros2 bag convert"), "{error}");
}

#[test]
fn real_recordings_of_both_kinds_are_the_same_points() {
    let Some(folder) = shared_data() else { return };
    let options = RecordingOptions { frame: Some("os1_lidar".into()), ..Default::default() };
    let mut of_kind = Vec::new();
    // Only one of the files has transforms.
    for (name, frame) in [("ouster_ros1.mcap", Some("os1_sensor")), ("ouster_ros2_cdr.mcap", None)] {
        let path = folder.join("sequences").join(name);
        assert_eq!(describe_recording(&path, &()).unwrap().frame.as_deref(), frame, "{name}: the common frame");
        let (notes, mut recording) = (Notes::default(), Recording::open(&path, &options, &()).unwrap());
        let mut total = 0;
        let mut updates = Vec::new();
        while let Next::Update(update) = recording.next(Duration::ZERO, &notes).unwrap() {
            total += update.cloud.len();
            updates.push(update);
        }
        assert_eq!((updates.len(), total), (2, 2 * 131_072 - 170_619), "{name}: without what never came back");
        assert_eq!(notes.all().len(), 1, "{name}: which is told once");
        let fields: Vec<_> = updates[0].cloud.fields().iter().map(|field| &*field.name).collect();
        assert_eq!(fields, ["Intensity", "t", "reflectivity", "Ring", "noise", "range"], "{name}");
        let points = updates.iter().flat_map(|update| (0..update.cloud.len()).map(|i| update.cloud.world_position(i)));
        let [low, high] =
            points.fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], p| [low.min(p), high.max(p)]);
        assert!(low.abs_diff_eq(DVec3::new(-10.70307, -2.414919, -1.792242), 1e-5), "{name}: {low}");
        assert!(high.abs_diff_eq(DVec3::new(13.74436, 14.15186, 2.698482), 1e-5), "{name}: {high}");
        of_kind.push(updates);
    }
    assert_eq!(of_kind[0], of_kind[1], "the same points, fields and times");
    let pointer = folder.join("malformed/mcap_lfs_pointer.mcap");
    let error = Recording::open(&pointer, &options, &()).map(drop).unwrap_err().to_string();
    assert!(error.contains("git lfs pull"), "{error}");
}
