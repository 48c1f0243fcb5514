//! Merges streams into the cloud to show: the newest points of each sensor, and optionally older ones.

use std::{
    collections::{BTreeMap, VecDeque},
    sync::Arc,
    time::Duration,
};

use autosplats_cloud::PointCloud;
use glam::DMat4;

use super::clock::{Clock, StampOrder};
use crate::Update;

/// A stamp older than the newest by more than this means a restarted clock or recording. By less, messages may have
/// overtaken each other, unless several consecutive ones increase among themselves.
const MIN_RESTART_JUMP: Duration = Duration::from_secs(1);

/// Which older points [`Latest`] keeps beside the newest.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LatestOptions {
    /// Keeps updates up to this much older than the newest stamp of the same sensor. Default `None`: only the newest.
    pub decay: Option<Duration>,
    /// Keeps all earlier updates. Default false.
    pub accumulate: bool,
    /// Maximum number of points to keep, beside the newest of each sensor. The oldest go first. Default 100 million.
    pub most_points: usize,
}

impl Default for LatestOptions {
    fn default() -> Self {
        Self { decay: None, accumulate: false, most_points: 100_000_000 }
    }
}

/// Outcome of [`Latest::put`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Arrival {
    /// The update is shown.
    Shown,
    /// The update is shown, and older ones of its sensor are removed because its clock went back. This is so if:
    ///
    /// - the stamp is older than the newest by more than a second and more than `decay`, or
    /// - this is the fourth consecutive stamp that is older than the newest and newer than the one before.
    ///
    /// With `accumulate` both conditions must hold.
    Restarted,
    /// The update is refused because it is older than the newest and than everything that is kept.
    Late,
    /// The update is refused because its sensor already has an update with the same stamp.
    Duplicate,
}

/// Counts of the outcomes of updates.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LatestStatistics {
    /// Updates that were shown.
    pub shown: u64,
    /// Updates refused as [late](Arrival::Late).
    pub late: u64,
    /// Updates refused as [duplicates](Arrival::Duplicate).
    pub duplicates: u64,
    /// Clocks that went back, after which the sensor started anew.
    pub restarted: u64,
    /// Updates removed because there were more points than [`LatestOptions::most_points`].
    pub given_up: u64,
}

/// Merges the updates of one or more streams, each with a pose, into the one cloud to show.
///
/// Stamps are compared only within a sensor. After a seek or a replay, call [`restart`](Self::restart).
///
/// ```
/// use std::{sync::Arc, time::Duration};
///
/// use autosplats_sources::{Arrival, Latest, LatestOptions, Update};
/// use autosplats_cloud::{PointCloud, glam::{DMat4, DVec3}};
///
/// let update = |seconds: i64, count| {
///     let cloud = Arc::new(PointCloud::new(DVec3::ZERO, vec![[0.0; 3]; count]));
///     Update { channel: 0, stamp: seconds * 1_000_000_000, cloud }
/// };
/// let decay = Some(Duration::from_secs(2));
/// let mut latest = Latest::new(LatestOptions { decay, ..LatestOptions::default() });
/// let lidar = latest.add(DMat4::IDENTITY);
/// latest.put(lidar, update(0, 10));
/// latest.put(lidar, update(1, 20));
/// assert_eq!(latest.cloud().len(), 30);
/// assert_eq!(latest.put(lidar, update(3, 40)), Arrival::Shown);
/// assert_eq!(latest.cloud().len(), 60);
/// ```
#[derive(Debug, Default)]
pub struct Latest {
    options: LatestOptions,
    poses: Vec<DMat4>,
    /// Sensors by stream and channel.
    sensors: BTreeMap<(usize, usize), Sensor>,
    /// Number of updates accepted so far.
    arrivals: u64,
    merged: Option<Arc<PointCloud>>,
    statistics: LatestStatistics,
}

#[derive(Debug, Default)]
struct Sensor {
    /// Sorted by stamp.
    kept: VecDeque<KeptUpdate>,
    clock: Clock,
    /// Arrival number of the first update that may belong to a clock that was set back.
    since: u64,
    /// Whether the next update replaces everything kept.
    restarts: bool,
}

#[derive(Debug)]
struct KeptUpdate {
    stamp: i64,
    arrival: u64,
    cloud: Arc<PointCloud>,
}

impl Latest {
    /// Creates an empty `Latest`.
    pub fn new(options: LatestOptions) -> Self {
        Self { options, ..Self::default() }
    }

    /// Adds a stream and returns its number. `world_from_stream` is an affine map for its points.
    pub fn add(&mut self, world_from_stream: DMat4) -> usize {
        self.poses.push(world_from_stream);
        self.poses.len() - 1
    }

    /// Changes the pose of a stream.
    ///
    /// # Panics
    /// If there is no such stream.
    pub fn set_pose(&mut self, stream: usize, world_from_stream: DMat4) {
        if self.poses[stream] != world_from_stream {
            self.poses[stream] = world_from_stream;
            self.merged = None;
        }
    }

    /// Changes the options, and removes updates that are too old for the new options.
    pub fn set_options(&mut self, options: LatestOptions) {
        self.options = options;
        for sensor in self.sensors.values_mut() {
            if sensor.expire(&self.options) {
                self.merged = None;
            }
        }
        self.bound();
    }

    /// Takes an update of a stream.
    ///
    /// # Panics
    /// If there is no such stream.
    pub fn put(&mut self, stream: usize, update: Update) -> Arrival {
        assert!(stream < self.poses.len(), "stream {stream} of {}", self.poses.len());
        let Update { channel, stamp, cloud } = update;
        let sensor = self.sensors.entry((stream, channel)).or_default();
        if sensor.restarts {
            *sensor = Sensor::default();
        }
        let accumulate = self.options.accumulate;
        let keeps = self.options.decay.unwrap_or_default();
        let jump = keeps.max(MIN_RESTART_JUMP);
        let behind = |sensor: &Sensor| {
            let newest = sensor.kept.back().map_or(i64::MIN, |kept| kept.stamp);
            Duration::from_nanos(newest.saturating_sub(stamp).max(0).unsigned_abs())
        };
        let mut restarted = false;
        // With `accumulate`, a single stamp must not remove everything.
        match sensor.clock.receive(stamp, if accumulate { Duration::MAX } else { jump }) {
            StampOrder::Onward => {}
            StampOrder::Behind { first } => sensor.since = if first { self.arrivals } else { sensor.since },
            // With `accumulate`, late points are shown like any others, so a small step back removes nothing.
            StampOrder::Restarted { first } if !accumulate || behind(sensor) > jump => {
                let since = if first { self.arrivals } else { sensor.since };
                sensor.kept.retain(|kept| kept.arrival >= since);
                self.statistics.restarted += 1;
                restarted = true;
            }
            StampOrder::Restarted { .. } => {}
        }
        let at = sensor.kept.partition_point(|kept| kept.stamp < stamp);
        if sensor.kept.get(at).is_some_and(|kept| kept.stamp == stamp) {
            self.statistics.duplicates += 1;
            return Arrival::Duplicate;
        }
        if !accumulate && behind(sensor) > keeps {
            self.statistics.late += 1;
            return Arrival::Late;
        }
        sensor.kept.insert(at, KeptUpdate { stamp, arrival: self.arrivals, cloud });
        self.arrivals += 1;
        self.statistics.shown += 1;
        self.merged = None;
        sensor.expire(&self.options);
        self.bound();
        if restarted { Arrival::Restarted } else { Arrival::Shown }
    }

    /// Removes all updates of a stream.
    pub fn forget(&mut self, stream: usize) {
        self.sensors.retain(|key, _| key.0 != stream);
        self.merged = None;
    }

    /// Starts a stream anew at its next update, for instance after a seek. Its points stay visible until then.
    pub fn restart(&mut self, stream: usize) {
        for (_, sensor) in self.sensors.iter_mut().filter(|(key, _)| key.0 == stream) {
            sensor.restarts = true;
        }
    }

    /// All points to show. The same cloud, with the same [identity](PointCloud::identity), is returned until something
    /// changes. A single update with the identity pose is returned without a copy.
    pub fn cloud(&mut self) -> Arc<PointCloud> {
        let poses = &self.poses;
        let merge = || {
            let sensors = self.sensors.iter();
            let parts = sensors.flat_map(|(key, own)| own.kept.iter().map(|kept| (&kept.cloud, poses[key.0])));
            let parts: Vec<_> = parts.collect();
            match &parts[..] {
                [(only, pose)] if *pose == DMat4::IDENTITY => Arc::clone(only),
                parts => {
                    let parts: Vec<_> = parts.iter().map(|(cloud, pose)| (&***cloud, *pose)).collect();
                    Arc::new(PointCloud::merged(&parts))
                }
            }
        };
        Arc::clone(self.merged.get_or_insert_with(merge))
    }

    /// Counts of the outcomes of updates so far.
    pub fn statistics(&self) -> LatestStatistics {
        self.statistics
    }

    /// Removes the oldest updates while there are too many points, but keeps the newest of each sensor.
    fn bound(&mut self) {
        let mut points: usize =
            self.sensors.values().flat_map(|sensor| &sensor.kept).map(|kept| kept.cloud.len()).sum();
        while points > self.options.most_points {
            let many = self.sensors.values_mut().map(|sensor| &mut sensor.kept).filter(|kept| kept.len() > 1);
            let Some(oldest) = many.min_by_key(|kept| kept[0].arrival) else { return };
            let given_up = oldest.pop_front();
            points -= given_up.map_or(0, |kept| kept.cloud.len());
            self.statistics.given_up += 1;
            self.merged = None;
        }
    }
}

impl Sensor {
    /// Removes updates that are too old, and returns whether there were any.
    fn expire(&mut self, options: &LatestOptions) -> bool {
        let before = self.kept.len();
        if !options.accumulate {
            let keeps = i64::try_from(options.decay.unwrap_or_default().as_nanos()).unwrap_or(i64::MAX);
            let oldest = self.kept.back().map_or(i64::MIN, |newest| newest.stamp.saturating_sub(keeps));
            self.kept.retain(|kept| kept.stamp >= oldest);
        }
        self.kept.len() < before
    }
}
