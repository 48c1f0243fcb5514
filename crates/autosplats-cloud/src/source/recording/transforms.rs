//! Where the frames of a robot are to each other, at any time.

use std::collections::{BTreeMap, BTreeSet};

use glam::{DMat4, DQuat, DVec3, DVec4};
use rayon::prelude::*;

use super::{
    chunk::unpack,
    files::File,
    index::{Container, Kind, Place, Record},
};
use crate::{
    Error, Progress,
    progress::tick,
    source::{
        point_cloud2::frame_name,
        wire::{Encoding, Fault, Wire, header},
    },
};

/// A tree of frames, each within its parent as that was measured at some times.
#[derive(Debug, Default)]
pub(super) struct Transforms {
    edges: BTreeMap<String, Edge>,
    /// The frame that all points are brought into.
    target: Option<String>,
}

/// A frame within its parent.
#[derive(Debug)]
struct Edge {
    parent: String,
    /// The same at all times.
    fixed: bool,
    /// By time.
    poses: Vec<(i64, Pose)>,
}

/// Maps a frame to its parent.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Pose {
    rotation: DQuat,
    translation: DVec3,
}

/// One pose as a message has it.
struct Sample {
    stamp: i64,
    parent: String,
    child: String,
    pose: Pose,
}

/// Bytes that a transform takes at least: times, lengths of names, seven numbers.
const LEAST_TRANSFORM: usize = 72;

/// Chunks that are read at the same time.
const BATCH: usize = 16;

/// No place on Earth, nor around it, is further from another than this, in metres.
const FARTHEST: f64 = 1e12;

impl Transforms {
    /// All transforms of a recording.
    pub(super) fn read(files: &[File], progress: &dyn Progress) -> Result<Self, Error> {
        // Messages of one chunk after the other, so that each is unpacked once.
        let mut runs: Vec<Vec<Place>> = Vec::new();
        for (number, File { index, .. }) in files.iter().enumerate() {
            let own = index.messages.iter().filter(|place| index.topics[place.topic].kind != Kind::Points);
            for place in own.map(|place| Place { file: number, ..*place }) {
                match runs.last_mut() {
                    Some(run) if run[0].file == number && run[0].chunk == place.chunk => run.push(place),
                    _ => runs.push(vec![place]),
                }
            }
        }
        let mut transforms = Self::default();
        let mut lost: Option<String> = None;
        for (number, batch) in runs.chunks(BATCH).enumerate() {
            tick(progress, (number * BATCH) as f32 / runs.len() as f32)?;
            let samples: Vec<_> = batch.par_iter().map(|run| samples(&files[run[0].file], run)).collect();
            for outcome in samples {
                match outcome {
                    Ok(samples) => samples.into_iter().for_each(|(fixed, sample)| transforms.insert(fixed, sample)),
                    Err(what) => lost = lost.or(Some(what)),
                }
            }
        }
        if let Some(what) = lost {
            progress.note(&crate::error::message(&format!("some transforms cannot be read: {what}")));
        }
        for Edge { poses, .. } in transforms.edges.values_mut() {
            poses.sort_by_key(|(stamp, _)| *stamp);
            poses.dedup_by_key(|(stamp, _)| *stamp);
        }
        Ok(transforms)
    }

    fn insert(&mut self, fixed: bool, Sample { stamp, parent, child, pose }: Sample) {
        let edge = self.edges.entry(child).or_insert_with(|| Edge { parent, fixed, poses: Vec::new() });
        // One that is said to be fixed and moves nevertheless, moves; of several fixed ones the last is meant.
        match (edge.fixed, fixed) {
            (false, true) => return,
            (true, _) => edge.poses.clear(),
            (false, false) => {}
        }
        edge.fixed = fixed;
        edge.poses.push((stamp, pose));
    }

    /// Chooses the frame that points of these sensors' frames are brought into: the wanted one, or the topmost.
    pub(super) fn choose(&mut self, sensors: &[String], wanted: Option<String>) -> Result<(), String> {
        if let Some(wanted) = wanted {
            let known = self.frames(sensors);
            if !known.contains(&wanted) {
                return Err(format!("no frame is called '{wanted}'; there are: {}", known.join(", ")));
            }
            self.target = Some(wanted);
            return Ok(());
        }
        // Without any transforms there is nothing to bring into one frame, nor of a sensor outside of the tree.
        let parents: BTreeSet<&String> = self.edges.values().map(|edge| &edge.parent).collect();
        let mut inside = sensors.iter().filter(|&sensor| self.edges.contains_key(sensor) || parents.contains(sensor));
        self.target = inside.find_map(|sensor| Some(self.to_root(sensor, 0)?.1.to_owned()));
        Ok(())
    }

    pub(super) fn target(&self) -> Option<&str> {
        self.target.as_deref()
    }

    /// All frames, those of sensors included.
    pub(super) fn frames(&self, sensors: &[String]) -> Vec<String> {
        let parents = self.edges.values().map(|edge| &edge.parent);
        let all: BTreeSet<&String> = self.edges.keys().chain(parents).chain(sensors).collect();
        all.into_iter().filter(|name| !name.is_empty()).cloned().collect()
    }

    /// Maps a frame to the common one as it was at a time; nothing if they do not hang together.
    pub(super) fn pose(&self, frame: &str, stamp: i64) -> Option<DMat4> {
        let Some(target) = self.target().filter(|target| *target != frame) else { return Some(DMat4::IDENTITY) };
        let (up, root) = self.to_root(frame, stamp)?;
        let (down, other) = self.to_root(target, stamp)?;
        (root == other).then(|| down.inverse() * up)
    }

    /// Maps a frame to the topmost one above it, and its name; nothing if frames go round in a circle.
    fn to_root<'a>(&'a self, frame: &'a str, stamp: i64) -> Option<(DMat4, &'a str)> {
        let (mut pose, mut frame) = (DMat4::IDENTITY, frame);
        for _ in 0..=self.edges.len() {
            let Some(edge) = self.edges.get(frame) else { return Some((pose, frame)) };
            pose = edge.at(stamp).matrix() * pose;
            frame = &edge.parent;
        }
        None
    }
}

impl Edge {
    /// The pose at a time, between those before and after it; the first before all, the last after.
    fn at(&self, stamp: i64) -> Pose {
        let after = self.poses.partition_point(|(time, _)| *time <= stamp);
        match (after.checked_sub(1).map(|before| self.poses[before]), self.poses.get(after)) {
            (Some((from, a)), Some((to, b))) => {
                let share = stamp.abs_diff(from) as f64 / to.abs_diff(from) as f64;
                Pose {
                    rotation: a.rotation.slerp(b.rotation, share),
                    translation: a.translation.lerp(b.translation, share),
                }
            }
            (Some((_, pose)), None) | (None, Some(&(_, pose))) => pose,
            (None, None) => Pose { rotation: DQuat::IDENTITY, translation: DVec3::ZERO },
        }
    }
}

impl Pose {
    fn matrix(&self) -> DMat4 {
        DMat4::from_rotation_translation(self.rotation, self.translation)
    }
}

/// The transforms of messages of one chunk, and whether each is fixed.
fn samples(file: &File, run: &[Place]) -> Result<Vec<(bool, Sample)>, String> {
    let File { bytes, index, .. } = file;
    let content = run[0].chunk.map(|chunk| unpack(bytes, &index.chunks[chunk])).transpose()?;
    let records = content.as_deref().unwrap_or(bytes);
    let Some((mut container, _)) = Container::of(bytes) else { return Ok(Vec::new()) };
    let mut samples = Vec::new();
    for place in run {
        let topic = &index.topics[place.topic];
        let (record, _) = container.record(records, place.at).map_err(|fault| fault.what)?;
        let (Record::Message(_, _, message), Some(encoding)) = (record, topic.encoding) else { continue };
        let fixed = topic.kind == Kind::Transforms { fixed: true };
        let own = parse(message, encoding, place.time).map_err(|fault| fault.what)?;
        samples.extend(own.into_iter().map(|sample| (fixed, sample)));
    }
    Ok(samples)
}

/// The transforms of a message; poses that are none are left out.
fn parse(message: &[u8], encoding: Encoding, recorded: i64) -> Result<Vec<Sample>, Fault> {
    let mut wire = Wire::message(message, encoding)?;
    let mut samples = Vec::new();
    for _ in 0..wire.list(LEAST_TRANSFORM, "transforms")? {
        let (stamp, parent) = header(&mut wire, encoding)?;
        let (parent, child) = (frame_name(&parent), frame_name(&wire.string("a frame's name")?));
        let mut numbers = [0.0; 7];
        for number in &mut numbers {
            *number = wire.f64("a transform")?;
        }
        let [x, y, z, qx, qy, qz, qw] = numbers;
        let (translation, turn) = (DVec3::new(x, y, z), DVec4::new(qx, qy, qz, qw));
        let length = turn.length();
        if translation.abs().max_element() < FARTHEST && (1e-6..1e6).contains(&length) && parent != child {
            let pose = Pose { rotation: DQuat::from_vec4(turn / length), translation };
            let stamp = if stamp == 0 { recorded } else { stamp };
            samples.push(Sample { stamp, parent, child, pose });
        }
    }
    Ok(samples)
}
