//! Transforms between the coordinate frames of a robot, at any time.

use std::{
    collections::{BTreeMap, BTreeSet, VecDeque},
    time::Duration,
};

use autosplats_cloud::{Axes, PointCloud};
use glam::{DMat4, DQuat, DVec3, DVec4};

use crate::{
    clock::{Clock, StampOrder},
    wire::{Encoding, Fault, Wire, frame_name, header},
};

/// A tree of coordinate frames, each with its poses in its parent over time.
#[derive(Debug, Default)]
pub(crate) struct Transforms {
    edges: BTreeMap<String, Edge>,
    /// The frame that all points are transformed into.
    target: Option<String>,
}

/// A frame in its parent.
#[derive(Debug)]
struct Edge {
    parent: String,
    /// Whether the pose is the same at all times.
    fixed: bool,
    /// Poses sorted by time.
    poses: VecDeque<(i64, Pose)>,
    /// Clock of poses that are received live.
    clock: Clock,
}

/// A rigid transform from a frame to its parent.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Pose {
    rotation: DQuat,
    translation: DVec3,
}

/// One pose from a message.
pub(crate) struct PoseSample {
    stamp: i64,
    parent: String,
    child: String,
    pose: Pose,
}

/// Smallest size of a transform in bytes: time, lengths of names, seven numbers.
const MIN_TRANSFORM_BYTES: usize = 72;

/// How long live poses are kept, by their stamps. Longer than the delay between measurement and arrival of points.
const POSE_HISTORY: Duration = Duration::from_secs(10);
/// Maximum number of live poses kept per frame: a thousand per second.
const MAX_POSES: usize = 10_000;
/// Maximum number of live frames; more do not occur on robots.
const MAX_FRAMES: usize = 4096;

/// Upper bound of a valid coordinate of a translation, in metres; far beyond any place on or around Earth.
const MAX_TRANSLATION_M: f64 = 1e12;

impl Transforms {
    /// Takes the transforms of a message; `fixed` ones hold at all times. Poses may come in any order, until they are
    /// [sorted](Self::sort).
    pub(crate) fn add(&mut self, fixed: bool, samples: Vec<PoseSample>) {
        samples.into_iter().for_each(|sample| self.insert(fixed, sample));
    }

    /// Sorts the poses that were added. Of several at one time the first counts.
    pub(crate) fn sort(&mut self) {
        for Edge { poses, .. } in self.edges.values_mut() {
            let mut sorted = Vec::from(std::mem::take(poses));
            sorted.sort_by_key(|(stamp, _)| *stamp);
            sorted.dedup_by_key(|(stamp, _)| *stamp);
            *poses = sorted.into();
        }
    }

    fn insert(&mut self, fixed: bool, PoseSample { stamp, parent, child, pose }: PoseSample) {
        let edge = self.edges.entry(child).or_insert_with(|| Edge::new(parent, fixed));
        // A frame with both fixed and moving transforms counts as moving. Of several fixed transforms the last counts.
        match (edge.fixed, fixed) {
            (false, true) => return,
            (true, _) => edge.poses.clear(),
            (false, false) => {}
        }
        edge.fixed = fixed;
        edge.poses.push_back((stamp, pose));
    }

    /// Takes a live message, in any order. Keeps ten seconds of each frame, and restarts if a clock was set back.
    pub(crate) fn receive(&mut self, message: &[u8], fixed: bool, arrival: i64) -> Result<(), String> {
        let samples = parse(message, Encoding::Cdr, arrival);
        let samples = samples.map_err(|fault| format!("{}: {}", fault.place(), fault.what))?;
        for PoseSample { stamp, parent, child, pose } in samples {
            if self.edges.len() >= MAX_FRAMES && !self.edges.contains_key(&child) {
                return Err(format!("there are {MAX_FRAMES} other frames already; '{child}' is left out"));
            }
            let edge = self.edges.entry(child).or_insert_with(|| Edge::new(parent.clone(), fixed));
            if edge.parent != parent {
                *edge = Edge::new(parent, fixed);
            }
            edge.receive(fixed, stamp, pose);
        }
        Ok(())
    }

    /// Whether a frame is part of the tree.
    pub(crate) fn knows(&self, frame: &str) -> bool {
        self.edges.contains_key(frame) || self.edges.values().any(|edge| edge.parent == frame)
    }

    /// Chooses the frame to transform points into: `wanted`, or else the root above the first sensor in the tree.
    pub(crate) fn choose(&mut self, sensors: &[String], wanted: Option<String>) -> Result<(), String> {
        if let Some(wanted) = wanted {
            let known = self.frames(sensors);
            if !known.contains(&wanted) {
                return Err(format!("no frame is called '{wanted}'; there are: {}", known.join(", ")));
            }
            self.target = Some(wanted);
            return Ok(());
        }
        // Without transforms, and for sensors outside of the tree, there is no common frame.
        let mut inside = sensors.iter().filter(|sensor| self.knows(sensor));
        self.target = inside.find_map(|sensor| Some(self.to_root(sensor, 0)?.1.to_owned()));
        Ok(())
    }

    pub(crate) fn target(&self) -> Option<&str> {
        self.target.as_deref()
    }

    /// All frames, including those of sensors.
    pub(crate) fn frames(&self, sensors: &[String]) -> Vec<String> {
        let parents = self.edges.values().map(|edge| &edge.parent);
        let all: BTreeSet<&String> = self.edges.keys().chain(parents).chain(sensors).collect();
        all.into_iter().filter(|name| !name.is_empty()).cloned().collect()
    }

    /// Transform of points of a frame measured at a time; `None` if there is no common frame.
    pub(crate) fn placement(&self, frame: &str, stamp: i64) -> Option<Placement> {
        let target = self.target()?.to_owned();
        let pose = self.pose(frame, &target, stamp);
        Some(Placement { frame: frame.to_owned(), target, pose })
    }

    /// Transform between two frames at a time; `None` if they are not connected.
    fn pose(&self, frame: &str, target: &str, stamp: i64) -> Option<DMat4> {
        if frame == target {
            return Some(DMat4::IDENTITY);
        }
        let (up, root) = self.to_root(frame, stamp)?;
        let (down, other) = self.to_root(target, stamp)?;
        (root == other).then(|| down.inverse() * up)
    }

    /// Transform from a frame to its root, and the name of the root; `None` if the frames form a cycle.
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

/// A transform of points to the common frame.
pub(crate) struct Placement {
    frame: String,
    target: String,
    pose: Option<DMat4>,
}

impl Placement {
    /// Transforms points. If the frames are not connected, points stay unchanged and the reason is returned.
    pub(crate) fn apply(self, cloud: PointCloud) -> (PointCloud, Option<String>) {
        let Self { frame, target, pose } = self;
        // All points are in one frame afterwards, so they share the up direction.
        let axes = if target.contains("optical") { Axes::Camera } else { Axes::ZUp };
        match pose {
            Some(pose) if !cloud.is_empty() => (PointCloud::merge(vec![(cloud, pose)]).with_axes(axes), None),
            Some(_) => (cloud, None),
            None => (cloud, Some(format!("no transforms lead from '{frame}' to '{target}'"))),
        }
    }
}

impl Edge {
    fn new(parent: String, fixed: bool) -> Self {
        Self { parent, fixed, poses: VecDeque::new(), clock: Clock::default() }
    }

    /// Takes a live pose.
    fn receive(&mut self, fixed: bool, stamp: i64, pose: Pose) {
        // As in recordings, a frame with fixed and moving transforms moves. Of several fixed ones the last counts.
        match (self.fixed, fixed) {
            (false, true) => return,
            (true, _) => self.poses.clear(),
            (false, false) => {}
        }
        self.fixed = fixed;
        if !fixed && matches!(self.clock.receive(stamp, POSE_HISTORY), StampOrder::Restarted { .. }) {
            self.poses.clear();
        }
        let at = self.poses.partition_point(|(time, _)| *time < stamp);
        match self.poses.get_mut(at) {
            Some(known) if known.0 == stamp => known.1 = pose,
            _ => self.poses.insert(at, (stamp, pose)),
        }
        let newest = self.poses.back().map_or(stamp, |(time, _)| *time);
        let oldest = newest.saturating_sub(POSE_HISTORY.as_nanos() as i64);
        while self.poses.len() > MAX_POSES || self.poses.front().is_some_and(|(time, _)| *time < oldest) {
            self.poses.pop_front();
        }
    }

    /// Pose at a time, interpolated. Before the first pose it is the first, after the last it is the last.
    fn at(&self, stamp: i64) -> Pose {
        let after = self.poses.partition_point(|(time, _)| *time <= stamp);
        match (after.checked_sub(1).map(|before| self.poses[before]), self.poses.get(after)) {
            (Some((from, a)), Some(&(to, b))) => {
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

/// The transforms of a message. Invalid poses are left out. `recorded` is the time of those without a stamp.
pub(crate) fn parse(message: &[u8], encoding: Encoding, recorded: i64) -> Result<Vec<PoseSample>, Fault> {
    let mut wire = Wire::message(message, encoding)?;
    let mut samples = Vec::new();
    for _ in 0..wire.list(MIN_TRANSFORM_BYTES, "transforms")? {
        let (stamp, parent) = header(&mut wire, encoding)?;
        let (parent, child) = (frame_name(&parent), frame_name(&wire.string("a frame's name")?));
        let mut numbers = [0.0; 7];
        for number in &mut numbers {
            *number = wire.f64("a transform")?;
        }
        let [x, y, z, qx, qy, qz, qw] = numbers;
        let (translation, turn) = (DVec3::new(x, y, z), DVec4::new(qx, qy, qz, qw));
        let length = turn.length();
        if translation.abs().max_element() < MAX_TRANSLATION_M && (1e-6..1e6).contains(&length) && parent != child {
            let pose = Pose { rotation: DQuat::from_vec4(turn / length), translation };
            let stamp = if stamp == 0 { recorded } else { stamp };
            samples.push(PoseSample { stamp, parent, child, pose });
        }
    }
    Ok(samples)
}
