//! The points to be shown of streams: the newest of each sensor, or also what came before.

use std::{
    collections::{BTreeMap, VecDeque},
    sync::Arc,
    time::Duration,
};

use glam::DMat4;

use super::clock::{Clock, Order};
use crate::{PointCloud, Update};

/// A clock that goes back by more than this was set anew, or a recording has begun again; by less, messages may have overtaken
/// each other, unless several in a row are older than the newest and in order among themselves.
const JUMP: Duration = Duration::from_secs(1);

/// What [`Latest`] keeps beside the newest points.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LatestOptions {
    /// Also what is no older than this, by the stamps of the same sensor.
    pub decay: Option<Duration>,
    /// Also everything that came before.
    pub accumulate: bool,
    /// Points that are kept at most, beside the newest of each sensor; the oldest go first. 100 million by default.
    pub most_points: usize,
}

impl Default for LatestOptions {
    fn default() -> Self {
        Self { decay: None, accumulate: false, most_points: 100_000_000 }
    }
}

/// What became of an update that was put into [`Latest`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Arrival {
    /// It is shown.
    Shown,
    /// It is shown, and what was known of its sensor before its clock went back is forgotten: it went back by more than a second
    /// and more than is kept, or this is the fourth in a row that is older than the newest and newer than the one before it.
    /// Where everything is kept it takes both.
    Restarted,
    /// Older than what had come before, and than all that is kept.
    Late,
    /// Of a time of which there are points already.
    Duplicate,
}

/// Counts of what became of updates and of the points kept.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LatestStatistics {
    /// Updates that were shown.
    pub shown: u64,
    /// Updates refused as older than all that is kept.
    pub late: u64,
    /// Updates refused as of a time of which there were points already.
    pub duplicates: u64,
    /// Times that a clock went back and its sensor was begun anew.
    pub restarted: u64,
    /// Updates given up since there were more points than are kept.
    pub given_up: u64,
}

/// Takes the updates of one or several streams, each with a pose, and makes the one cloud to be shown.
///
/// Stamps are compared within a sensor alone, since streams have clocks of their own. Whoever seeks in a stream or plays it
/// again [restarts](Self::restart) it here.
#[derive(Debug, Default)]
pub struct Latest {
    options: LatestOptions,
    poses: Vec<DMat4>,
    /// By stream and channel.
    sensors: BTreeMap<(usize, usize), Sensor>,
    /// Updates that have come so far.
    arrivals: u64,
    merged: Option<Arc<PointCloud>>,
    statistics: LatestStatistics,
}

#[derive(Debug, Default)]
struct Sensor {
    /// In the order of stamps.
    kept: VecDeque<Kept>,
    clock: Clock,
    /// The first arrival that may be of a clock that was set back.
    since: u64,
    /// Whether what comes next takes the place of all that is kept.
    restarts: bool,
}

#[derive(Debug)]
struct Kept {
    stamp: i64,
    arrival: u64,
    cloud: Arc<PointCloud>,
}

impl Latest {
    /// Nothing yet.
    pub fn new(options: LatestOptions) -> Self {
        Self { options, ..Self::default() }
    }

    /// Adds a stream and returns its number. Its points are moved by `world_from_stream`, an affine map.
    pub fn add(&mut self, world_from_stream: DMat4) -> usize {
        self.poses.push(world_from_stream);
        self.poses.len() - 1
    }

    /// Moves a stream.
    ///
    /// # Panics
    /// If there is no such stream.
    pub fn set_pose(&mut self, stream: usize, world_from_stream: DMat4) {
        if self.poses[stream] != world_from_stream {
            self.poses[stream] = world_from_stream;
            self.merged = None;
        }
    }

    /// Changes what is kept from now on; what is too old then is given up.
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
        let jump = keeps.max(JUMP);
        let behind = |sensor: &Sensor| {
            let newest = sensor.kept.back().map_or(i64::MIN, |kept| kept.stamp);
            Duration::from_nanos(newest.saturating_sub(stamp).max(0).unsigned_abs())
        };
        let mut restarted = false;
        // Where everything is kept no single stamp may take it all away.
        match sensor.clock.hear(stamp, if accumulate { Duration::MAX } else { jump }) {
            Order::Onward => {}
            Order::Behind { first } => sensor.since = if first { self.arrivals } else { sensor.since },
            // There late points are shown as any, so that none need to go for them.
            Order::Restarted { first } if !accumulate || behind(sensor) > jump => {
                let since = if first { self.arrivals } else { sensor.since };
                sensor.kept.retain(|kept| kept.arrival >= since);
                self.statistics.restarted += 1;
                restarted = true;
            }
            Order::Restarted { .. } => {}
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
        sensor.kept.insert(at, Kept { stamp, arrival: self.arrivals, cloud });
        self.arrivals += 1;
        self.statistics.shown += 1;
        self.merged = None;
        sensor.expire(&self.options);
        self.bound();
        if restarted { Arrival::Restarted } else { Arrival::Shown }
    }

    /// Forgets the points of a stream.
    pub fn forget(&mut self, stream: usize) {
        self.sensors.retain(|key, _| key.0 != stream);
        self.merged = None;
    }

    /// Has a stream begin anew at whatever time comes next, as after a seek. What is shown stays until then.
    pub fn restart(&mut self, stream: usize) {
        for (_, sensor) in self.sensors.iter_mut().filter(|(key, _)| key.0 == stream) {
            sensor.restarts = true;
        }
    }

    /// All points that are to be shown. The same cloud as before, with the same [identity](PointCloud::identity), as long as
    /// nothing has changed; a single update that is not moved is handed through.
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

    /// What became of updates so far.
    pub fn statistics(&self) -> LatestStatistics {
        self.statistics
    }

    /// Gives up the oldest updates while there are too many points, but not the newest of a sensor.
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
    /// Drops what is too old to be shown, and says whether there was any.
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
