//! Tests of animations: sequences of files, glTF, scenes, and points sampled on them.

use std::{
    sync::{Arc, Mutex},
    time::Duration,
};

use crate::common::{positions, shared_data};
use autosplats_cloud::{Error, PointCloud, Progress, glam::DVec3};
use autosplats_formats::{ReadOptions, read, write};
use autosplats_scenes::Scene;
use autosplats_sources::{Animation, Next, Stream, Update};

fn sequence(name: &str) -> Result<Animation, Error> {
    Animation::sequence(name, 10.0, &ReadOptions::default(), &())
}

fn update(stream: &mut impl Stream) -> Update {
    match stream.next(Duration::ZERO, &()).unwrap() {
        Next::Update(update) => update,
        other => panic!("no update: {other:?}"),
    }
}

fn frame(animation: &Animation, frame: usize) -> Arc<PointCloud> {
    let mut stream = animation.play();
    stream.seek(frame);
    update(&mut stream).cloud
}

/// Stores the notes.
#[derive(Default)]
struct Notes(Mutex<Vec<String>>);

impl Progress for Notes {
    fn report(&self, _: f32) {}

    fn note(&self, note: &str) {
        self.0.lock().unwrap().push(note.into());
    }
}

#[test]
fn a_folder_plays_in_the_order_of_its_numbers_and_ends() {
    let Some(folder) = shared_data().map(|data| data.join("animation/horse_gallop")) else { return };
    let horse = sequence(folder.to_str().unwrap()).unwrap();
    assert_eq!(horse.timeline().len(), 48, "frames");
    assert_eq!(horse.timeline().duration(), Duration::from_millis(4800), "at 10 a second");
    let mut stream = horse.play();
    for number in 0..48 {
        let update = update(&mut stream);
        let file = read(&folder.join(format!("frame_{number:03}.ply")), &()).unwrap();
        assert_eq!((update.channel, update.stamp), (0, number * 100_000_000), "frame {number}");
        assert_eq!(*update.cloud, file, "frame {number}, read ahead or not");
    }
    assert_eq!(stream.next(Duration::ZERO, &()).unwrap(), Next::End, "after the last");
    assert_eq!(stream.statistics().taken, 48, "taken");
    stream.seek(3);
    assert_eq!(update(&mut stream).stamp, 300_000_000, "sought after the end");
}

#[test]
fn names_of_mixed_formats_are_in_natural_order() {
    let folder = tempfile::tempdir().unwrap();
    for (count, name) in [(2, "frame_10.pcd"), (1, "frame_2.ply"), (3, "frame_011.las"), (4, "readme.txt")] {
        let cloud = PointCloud::new(DVec3::ZERO, positions(count));
        if name.ends_with("txt") {
            std::fs::write(folder.path().join(name), "what this is\n").unwrap();
        } else {
            write(&cloud, &folder.path().join(name), &()).unwrap();
        }
    }
    std::fs::create_dir(folder.path().join("frame_1.ply")).unwrap();
    let notes = Notes::default();
    let name = folder.path().to_str().unwrap();
    let animation = Animation::sequence(name, 10.0, &ReadOptions::default(), &notes).unwrap();
    let counts: Vec<usize> = (0..3).map(|index| frame(&animation, index).len()).collect();
    assert_eq!((animation.timeline().len(), &*counts), (3, &[1, 2, 3][..]), "points by frame");
    assert_eq!(notes.0.lock().unwrap().len(), 1, "one note: {:?}", notes.0.lock().unwrap());
    let pattern = folder.path().join("frame_1?.*");
    assert_eq!(sequence(pattern.to_str().unwrap()).unwrap().timeline().len(), 1, "a pattern");
}

#[test]
fn depth_images_are_frames_and_what_lies_beside_them_is_not() {
    let Some(data) = shared_data() else { return };
    let animation = sequence(data.join("sequences/rgbd_kinect").to_str().unwrap()).unwrap();
    assert_eq!(animation.timeline().len(), 4, "four depth images, their colours and poses apart");
    assert!(frame(&animation, 3).colors().is_some(), "the colours are of the pictures beside them");
}

#[test]
fn depth_images_beside_clouds_are_no_frames() {
    let folder = tempfile::tempdir().unwrap();
    let pfm = [b"Pf\n2 2\n-1.0\n".to_vec(), [1.0_f32; 4].map(f32::to_le_bytes).concat()].concat();
    for index in 0..3 {
        let path = |end: &str| folder.path().join(format!("{index}.{end}"));
        write(&PointCloud::new(DVec3::ZERO, positions(10)), &path("ply"), &()).unwrap();
        std::fs::write(path("pfm"), &pfm).unwrap();
    }
    let name = folder.path().to_str().unwrap();
    assert_eq!(sequence(name).unwrap().timeline().len(), 3, "the clouds");
    (0..3).for_each(|index| std::fs::remove_file(folder.path().join(format!("{index}.ply"))).unwrap());
    assert_eq!(sequence(name).unwrap().timeline().len(), 3, "the images, alone");
}

#[test]
fn folders_without_a_readable_frame_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let name = folder.path().to_str().unwrap();
    let refused = |what: &str, says: &str| {
        let message = sequence(name).unwrap_err().to_string();
        assert!(message.contains(says) && !message.contains('\n'), "{what}: {message}");
    };
    refused("an empty folder", "no files");
    std::fs::write(folder.path().join("notes.md"), "nothing").unwrap();
    refused("no clouds", "none of its files is a cloud");
    for empty in ["a1.ply", "a2.pcd", "a3.las", "a4.glb"] {
        std::fs::write(folder.path().join(empty), "").unwrap();
    }
    refused("empty files", "none of its files can be read");
    let nowhere = folder.path().join("none_*.ply");
    assert!(sequence(nowhere.to_str().unwrap()).is_err(), "a pattern without files");
    assert!(sequence("***").is_err(), "no pattern");
}

#[test]
fn a_broken_frame_is_said_once_and_playing_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    for index in 0..5 {
        let path = folder.path().join(format!("{index}.ply"));
        write(&PointCloud::new(DVec3::ZERO, positions(10 + index)), &path, &()).unwrap();
        if index == 2 {
            let bytes = std::fs::read(&path).unwrap();
            std::fs::write(&path, &bytes[..bytes.len() - 7]).unwrap();
        }
    }
    let animation = sequence(folder.path().to_str().unwrap()).unwrap();
    let mut stream = animation.play();
    for round in 0..3 {
        stream.seek(0);
        for index in 0..5 {
            let next = stream.next(Duration::ZERO, &());
            match (index, round) {
                (2, 0) => {
                    let message = next.unwrap_err().to_string();
                    assert!(message.contains("2.ply: byte "), "with its place: {message}");
                }
                (2, _) => assert_eq!(next.unwrap(), Next::Nothing, "not again"),
                _ => assert!(matches!(next.unwrap(), Next::Update(u) if u.cloud.len() == 10 + index), "frame {index}"),
            }
        }
    }
    let statistics = stream.statistics();
    assert_eq!((statistics.taken, statistics.refused), (12, 3), "of fifteen");
    assert!(statistics.last_refusal.unwrap().contains("2.ply"), "why");
}

#[test]
fn a_cancelled_frame_is_still_the_next_one() {
    struct Stop;
    impl Progress for Stop {
        fn report(&self, _: f32) {}
        fn cancelled(&self) -> bool {
            true
        }
    }
    let Some(data) = shared_data() else { return };
    let mut stream = sequence(data.join("animation/samba").to_str().unwrap()).unwrap().play();
    for index in 0..4 {
        assert!(matches!(stream.next(Duration::ZERO, &Stop), Err(Error::Cancelled)), "stopped at {index}");
        assert_eq!(update(&mut stream).stamp, index * 100_000_000, "and then read");
    }
}

#[test]
fn samples_stay_at_their_places_on_a_moving_mesh() {
    let Some(data) = shared_data() else { return };
    let horse = sequence(data.join("animation/horse_gallop").to_str().unwrap()).unwrap().sampled(20_000, &()).unwrap();
    let [first, second, again] = [0, 1, 24].map(|index| frame(&horse, index));
    assert!([&first, &second, &again].iter().all(|cloud| cloud.len() == 20_000), "as many as wanted");
    let steps = |to: &PointCloud| -> Vec<f64> {
        (0..20_000).map(|i| first.world_position(i).distance(to.world_position(i))).collect()
    };
    let largest = steps(&second).into_iter().fold(0.0, f64::max);
    // A hoof moves by a tenth of the horse's 2.2 m. Different samples would be up to 2.2 m apart.
    assert!(largest > 0.01 && largest < 0.4, "from frame to frame: {largest}");
    assert!(steps(&again).iter().all(|&step| step < 1e-3), "the gallop repeats after 24 frames");
}

#[test]
fn points_without_a_mesh_cannot_be_sampled() {
    let Some(data) = shared_data() else { return };
    let drive = sequence(data.join("sequences/kitti_drive_pcd").to_str().unwrap()).unwrap();
    assert!(matches!(drive.sampled(100, &()), Err(Error::NoSurface)), "sweeps of a lidar");
}

/// A GLB of a triangle. Within one second, its first target raises a corner, and its node rotates by 180°.
fn moving_triangle(weights: &[f32]) -> Vec<u8> {
    let corners = [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    let raised = [0.0_f32, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 2.0];
    let (times, turns) = ([0.0_f32, 0.5, 1.0], [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0]);
    let runs: [(&[f32], &str, usize); 5] = [
        (&corners, "VEC3", 3),
        (&raised, "VEC3", 3),
        (&times, "SCALAR", 1),
        (weights, "SCALAR", 1),
        (&turns, "VEC4", 4),
    ];
    let (mut bytes, mut views, mut accessors) = (Vec::new(), Vec::new(), Vec::new());
    for (index, (values, kind, width)) in runs.into_iter().enumerate() {
        let (start, len) = (bytes.len(), 4 * values.len());
        views.push(format!(r#"{{"buffer":0,"byteOffset":{start},"byteLength":{len}}}"#));
        let count = values.len() / width;
        accessors.push(format!(r#"{{"bufferView":{index},"componentType":5126,"count":{count},"type":"{kind}"}}"#));
        values.iter().for_each(|value| bytes.extend(value.to_le_bytes()));
    }
    let json = format!(
        r#"{{"asset":{{"version":"2.0"}},"nodes":[{{"mesh":0,"translation":[5,0,0]}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"targets":[{{"POSITION":1}}]}}]}}],
        "animations":[{{"channels":[{{"sampler":0,"target":{{"node":0,"path":"weights"}}}},
        {{"sampler":1,"target":{{"node":0,"path":"rotation"}}}}],
        "samplers":[{{"input":2,"output":3}},{{"input":2,"output":4}}]}}],
        "buffers":[{{"byteLength":{}}}],"bufferViews":[{}],"accessors":[{}]}}"#,
        bytes.len(),
        views.join(","),
        accessors.join(",")
    );
    glb(json, &bytes)
}

/// A binary glTF.
fn glb(mut json: String, bytes: &[u8]) -> Vec<u8> {
    json.extend(std::iter::repeat_n(' ', json.len().next_multiple_of(4) - json.len()));
    let chunk = |kind: &[u8], content: &[u8]| [&(content.len() as u32).to_le_bytes()[..], kind, content].concat();
    let chunks = [chunk(b"JSON", json.as_bytes()), chunk(b"BIN\0", bytes)].concat();
    [&b"glTF"[..], &2_u32.to_le_bytes(), &(chunks.len() as u32 + 12).to_le_bytes(), &chunks].concat()
}

#[test]
fn a_gltf_changes_shape_and_turns() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("moving.glb");
    std::fs::write(&path, moving_triangle(&[0.0, 0.5, 1.0])).unwrap();
    let moving = Animation::gltf(&path, 4.0, &()).unwrap();
    assert_eq!(moving.timeline().len(), 4, "a second of four frames");
    let corner = |index: usize, corner: usize| frame(&moving, index).world_position(corner);
    let near = |is: DVec3, wanted: [f64; 3]| assert!(is.abs_diff_eq(DVec3::from(wanted), 1e-6), "{is}, not {wanted:?}");
    near(corner(0, 2), [5.0, 1.0, 0.0]);
    // A quarter of the weight, stored between two times, and no rotation yet.
    near(corner(1, 2), [5.0, 1.0, 0.5]);
    near(corner(2, 2), [5.0, 1.0, 1.0]);
    // Half of the rotation by 180° about the z axis.
    near(corner(3, 2), [4.0, 0.0, 1.5]);
    near(corner(3, 1), [5.0, 1.0, 0.0]);
    assert_eq!(
        read(&path, &()).unwrap().world_position(2),
        DVec3::new(5.0, 1.0, 0.0),
        "as a cloud it has its base shape"
    );
    let sampled_mesh = moving.sampled(500, &()).unwrap();
    assert_eq!((frame(&sampled_mesh, 0).len(), frame(&sampled_mesh, 3).len()), (500, 500), "strewn over it");
}

#[test]
fn broken_animations_of_gltf_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("moving.glb");
    let whole = moving_triangle(&[0.0, 0.5, 1.0]);
    let play = |bytes: &[u8]| {
        std::fs::write(&path, bytes).unwrap();
        let animation = Animation::gltf(&path, 10.0, &())?;
        let frames = animation.timeline().len();
        let mut stream = animation.play();
        (0..frames).try_for_each(|_| stream.next(Duration::ZERO, &()).map(|_| ()))
    };
    play(&whole).unwrap();
    for end in 0..whole.len() {
        assert!(play(&whole[..end]).is_err(), "the first {end} bytes");
    }
    let said = |bytes: &[u8]| play(bytes).unwrap_err().to_string();
    let text = |from: &str, to: &str| {
        assert_eq!(from.len(), to.len(), "lengths in the header");
        let at = whole.windows(from.len()).position(|piece| piece == from.as_bytes()).unwrap();
        [&whole[..at], to.as_bytes(), &whole[at + from.len()..]].concat()
    };
    assert!(said(&moving_triangle(&[0.0])).contains("do not fit 3 times"), "too few weights");
    assert!(said(&text("\"animations\"", "\"animationz\"")).contains("no animation"), "none at all");
    assert!(said(&text("\"sampler\":1", "\"sampler\":9")).contains("no such sampler"), "a sampler that is not there");
    assert!(said(&text("\"input\":2", "\"input\":1")).contains("type does not fit"), "vectors for times");
    let longest = f32::MAX.to_le_bytes();
    let at = whole.windows(4).rposition(|piece| piece == 1.0_f32.to_le_bytes()).unwrap();
    let ends: Vec<usize> = (0..=at).filter(|&i| whole[i..i + 4] == 1.0_f32.to_le_bytes()).collect();
    for end in ends {
        // One of the changed values is the end time. No value may ask for more than the available memory.
        let _ = play(&[&whole[..end], &longest, &whole[end + 4..]].concat());
    }
}

#[test]
fn a_small_gltf_cannot_keep_anyone_busy() {
    // A thousand channels share numbers that take no bytes, and a thousand targets share the vertices.
    let channels = [r#"{"sampler":0,"target":{"node":0,"path":"weights"}}"#; 1000].join(",");
    let targets = [r#"{"POSITION":0}"#; 1000].join(",");
    let count = 100_000;
    let accessor = |kind: &str| format!(r#"{{"componentType":5126,"count":{count},"type":"{kind}"}}"#);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("small.glb");
    for (channels, weights) in [(&*channels, "0"), ("", "1,1,1,1,1,1,1,1,1,1,1,1,1,1,1,1,1,1,1,1")] {
        let json = format!(
            r#"{{"asset":{{"version":"2.0"}},"nodes":[{{"mesh":0}}],"buffers":[],"bufferViews":[],
            "meshes":[{{"weights":[{weights}],"primitives":[{{"attributes":{{"POSITION":0}},"targets":[{targets}]}}]}}],
            "animations":[{{"channels":[{channels}],"samplers":[{{"input":1,"output":1}}]}}],
            "accessors":[{},{}]}}"#,
            accessor("VEC3"),
            accessor("SCALAR")
        );
        std::fs::write(&path, glb(json, &[])).unwrap();
        let played = Animation::gltf(&path, 10.0, &()).and_then(|moving| moving.play().next(Duration::ZERO, &()));
        let message = played.unwrap_err().to_string();
        assert!(message.contains("too often") || message.contains("too many"), "{message}");
    }
}

#[test]
fn scenes_play_their_round() {
    let (scene, count) = Scene::parse("scene:figure:3000").unwrap();
    let figure = Animation::scene(&scene, count, 12.0).unwrap();
    assert_eq!((figure.timeline().len(), figure.timeline().duration()), (24, Duration::from_secs(2)), "one round");
    let expected = scene.at(0.5).sample(count, &()).unwrap();
    assert_eq!(*frame(&figure, 6), expected, "half a second in");
    let (scene, count) = Scene::parse("scene:two-scales:1000").unwrap();
    let mut still = Animation::scene(&scene, count, 2.0).unwrap().play();
    let all: Vec<_> = (0..20).map(|_| update(&mut still).cloud.identity()).collect();
    assert!(all.iter().all(|&identity| identity == all[0]), "what does not move is made once");
    for fps in [0.0, -1.0, f64::NAN, 1e300] {
        assert!(Animation::scene(&scene, count, fps).is_err(), "{fps} frames a second");
    }
}
