//! The first frame with points, of every kind of source.

use std::{io::Cursor, path::Path, time::Duration};

use crate::common::{
    positions,
    recording::{Message, POINTS, Style, bag, mcap},
    ros::Cloud2,
    shared_data,
};
use autosplats_cloud::{Error, PointCloud, glam::DVec3};
use autosplats_formats::{ReadOptions, write};
use autosplats_sources::{
    LatestOptions, Live, LiveOptions, Player, Recording, RecordingOptions, Source, point_cloud2::Encoding,
};

/// The positions of a frame, by a letter.
fn points(kind: char) -> Vec<[f32; 3]> {
    match kind {
        'e' => Vec::new(),
        'n' => vec![[f32::NAN; 3]; 7],
        'i' => vec![[1.0, f32::INFINITY, 0.0]; 7],
        'z' => vec![[0.0; 3]; 7],
        _ => positions(20),
    }
}

/// The first frame with points and their number, or the reason why there is none.
fn first(mut player: Player) -> Result<(Option<usize>, usize), String> {
    let cloud = player.first(Duration::from_secs(20), &()).map_err(|error| error.to_string())?;
    Ok((player.position(), cloud.len()))
}

/// Sequences of frames, and the first with points of each.
const CASES: [(&str, Option<usize>); 4] = [("zep", Some(2)), ("ezzp", Some(3)), ("enz", None), ("zz", None)];

/// The same of files, in which points at the origin are points if there are no others.
const CASES_OF_FILES: [(&str, Option<usize>); 7] = [
    ("p", Some(0)),
    ("ep", Some(1)),
    ("eeeep", Some(4)),
    ("nip", Some(2)),
    ("pep", Some(0)),
    ("eni", None),
    ("e", None),
];

#[test]
fn recordings_begin_with_the_first_message_that_has_points() {
    for (kinds, expected) in CASES.into_iter().chain(CASES_OF_FILES) {
        let expected_of = |outcome: Result<(Option<usize>, usize), String>, name: &str| match expected {
            Some(frame) => assert_eq!(outcome, Ok((Some(frame), 20)), "{kinds} as {name}"),
            None => assert!(outcome.is_err_and(|why| why.contains("there are no points in")), "{kinds} as {name}"),
        };
        for (encoding, name) in [(Encoding::Ros1, "a.bag"), (Encoding::Ros1, "a.mcap"), (Encoding::Cdr, "b.mcap")] {
            let topic = [("/points", POINTS, encoding)];
            let message = |(time, kind): (usize, char)| -> Message {
                let cloud = Cloud2 { stamp: 1_000_000 * (1 + time as i64), ..Cloud2::xyz(&points(kind), 16) };
                (0, 1_000_000_000 * (1 + time as i64), cloud.message(encoding, false))
            };
            let messages: Vec<Message> = kinds.chars().enumerate().map(message).collect();
            let style = Style::of("none");
            let bytes =
                if name.ends_with("bag") { bag(&topic, &messages, style) } else { mcap(&topic, &messages, style) };
            let folder = tempfile::tempdir().unwrap();
            // A file by itself, and as the part of a folder of ROS 2.
            let path = folder.path().join(name);
            std::fs::write(&path, &bytes).unwrap();
            let play = |path: &Path| {
                let recording = Recording::open(path, &RecordingOptions::default(), &()).unwrap();
                first(Player::new(Box::new(recording), LatestOptions::default()))
            };
            expected_of(play(&path), name);
            if name.ends_with("mcap") {
                std::fs::write(folder.path().join("metadata.yaml"), "relative_file_paths:\n").unwrap();
                expected_of(play(folder.path()), "a folder");
            }
        }
    }
}

#[test]
fn folders_begin_with_the_first_file_that_has_points() {
    for (kinds, expected) in CASES_OF_FILES {
        let folder = tempfile::tempdir().unwrap();
        for (frame, kind) in kinds.chars().enumerate() {
            let cloud = PointCloud::new(DVec3::ZERO, points(kind));
            write(&cloud, &folder.path().join(format!("f_{frame}.ply")), &()).unwrap();
        }
        let source = Source::parse(&folder.path().display().to_string()).unwrap();
        let player = source.play(&Default::default(), &ReadOptions::default(), &());
        match expected {
            Some(frame) => assert_eq!(first(player.unwrap()), Ok((Some(frame), 20)), "{kinds}"),
            None => {
                let outcome = player.map_err(|error| error.to_string()).and_then(first);
                assert!(outcome.as_ref().is_err_and(|why| why.contains("no points")), "{kinds}: {outcome:?}");
            }
        }
    }
}

#[test]
fn pipes_wait_for_the_first_file_that_has_points() {
    let ply = |kind: char| {
        let rows: String = points(kind).iter().map(|[x, y, z]| format!("{x} {y} {z}\n")).collect();
        let count = points(kind).len();
        let head = "property float x\nproperty float y\nproperty float z\nend_header\n";
        format!("ply\nformat ascii 1.0\nelement vertex {count}\n{head}{rows}")
    };
    for (kinds, expected) in CASES_OF_FILES {
        let bytes: String = kinds.chars().map(ply).collect();
        let live = Live::bytes(Cursor::new(bytes), "pipe", &LiveOptions { all: true, ..LiveOptions::default() });
        let outcome = first(Player::new(Box::new(live.unwrap()), LatestOptions::default()));
        match expected {
            Some(_) => assert_eq!(outcome, Ok((None, 20)), "{kinds}"),
            None => assert!(outcome.is_err_and(|why| why.contains("has ended")), "{kinds}"),
        }
    }
}

#[test]
fn a_recording_from_the_field() -> Result<(), Error> {
    let Some(data) = shared_data() else { return Ok(()) };
    let path = data.with_file_name("field").join("bag_b06_empty_then_full.bag");
    let recording = Recording::open(&path, &RecordingOptions::default(), &())?;
    let outcome = first(Player::new(Box::new(recording), LatestOptions::default()));
    assert_eq!(outcome, Ok((Some(1), 4000)), "the first message is empty");
    Ok(())
}
