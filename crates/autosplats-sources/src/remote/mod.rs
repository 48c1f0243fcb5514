//! Live points of ROS 2 over Zenoh, from nodes with rmw_zenoh or behind the bridge from DDS.
//!
//! ```no_run
//! use std::time::Duration;
//!
//! use autosplats_sources::{Next, remote::{Remote, RemoteOptions, topics}, Stream as _};
//!
//! for topic in topics("zenoh://robot", Duration::from_secs(5))? {
//!     println!("{}, {}", topic.name, topic.kind);
//! }
//! let mut points = Remote::open("zenoh://robot/lidar/points", &RemoteOptions::default())?;
//! while let Next::Update(update) = points.next(Duration::from_secs(1), &())? {
//!     println!("{} points", update.cloud.len());
//! }
//! # Ok::<(), autosplats_cloud::Error>(())
//! ```
//!
//! # How it works
//!
//! A [`Remote`] subscribes to a topic under both of its possible keys. Zenoh's threads store only the newest message of
//! each channel, so nothing queues. A message is decoded when it is [taken](crate::Stream::next), so messages that
//! nobody takes cost next to nothing. A separate thread holds the connection (`link.rs`). What publishers declare about
//! themselves (`graph.rs`) explains why nothing arrives, if so. Robots publish transforms of their sensors
//! (`frames.rs`), which bring all points into one coordinate frame, as in recordings.
//!
//! Zenoh is licensed under EPL-2.0 or Apache-2.0, at our choice. It asks for Rust 1.75, and its dependencies for 1.88.

mod address;
mod frames;
mod graph;
mod link;
mod state;
mod topics;

use std::{
    path::Path,
    sync::Arc,
    thread,
    time::{Duration, Instant},
};

use autosplats_cloud::{Error, Progress, one_line};
use autosplats_formats::ReadOptions;

use self::{
    address::Address,
    frames::Frames,
    state::{Message, Shared},
};
pub use self::{graph::Topic, topics::topics};
use crate::{
    point_cloud2::{self, Encoding},
    stream::{Next, Statistics, Stream, Timeline, Update},
    wire::frame_name,
};

/// Time between two checks for cancellation.
const CANCEL_CHECK_INTERVAL: Duration = Duration::from_millis(50);

/// Time between two checks for transforms.
const TRANSFORMS_CHECK_INTERVAL: Duration = Duration::from_millis(10);

/// Options of [`Remote::open`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RemoteOptions {
    /// Coordinate frame to transform all points into. Points that cannot be transformed are refused. Default `None`:
    /// the root of the tree of frames above the first sensor, as known one second after the first points. The first
    /// points wait that second for transforms, or 0.3 s if nobody publishes any.
    pub frame: Option<String>,
    /// How to read points.
    pub read: ReadOptions,
}

/// Whether a name has the form of an address of live points, valid or not.
pub fn is_remote(name: &str) -> bool {
    name.starts_with(address::PREFIX)
}

/// Live points of ROS 2 over Zenoh.
///
/// Each topic is a [channel](Update::channel), numbered in order of first messages. Stamps come from the messages, or
/// else from their arrival. Messages are passed on as they arrive, even older ones after newer ones.
///
/// Transforms published as `tf` and `tf_static`, also in the namespaces around the topic, bring points into one
/// coordinate frame. Poses are interpolated between transforms, and constant after the last one. Points of a sensor
/// without transforms stay in their own frame.
pub struct Remote {
    address: Address,
    options: RemoteOptions,
    shared: Arc<Shared>,
    /// Channels that have reported points without a return, or missing transforms. Each is reported once.
    noted: Vec<[bool; 2]>,
}

impl Remote {
    /// Subscribes to `zenoh://HOST:PORT/TOPIC?domain=N`, without waiting for a connection.
    ///
    /// - Without PORT, the port is 7447.
    /// - Without HOST, peers and routers on the local network are searched, including a router on this machine.
    /// - TOPIC may be a pattern, in which `*` stands for one component of a name and `**` for any number of them.
    /// - Without `domain`, all ROS domains match.
    ///
    /// Publishers may start later, leave and come back. [`Statistics::waiting`] tells why nothing arrives.
    ///
    /// # Errors
    /// [`Error::Remote`] if the address is invalid or names no topic.
    pub fn open(url: &str, options: &RemoteOptions) -> Result<Self, Error> {
        let address = Address::parse(url)?;
        if address.topic.is_empty() {
            let what = "the topic is missing; add one after the host, as in zenoh://HOST/points, or ** for all".into();
            return Err(Error::Remote { address: url.into(), what });
        }
        let shared = Arc::new(Shared::default());
        shared.lock().frames = Frames::new(options.frame.as_deref().map(frame_name));
        link::start(address.clone(), shared.clone())
            .map_err(|error| Error::Remote { address: url.into(), what: format!("cannot start thread: {error}") })?;
        Ok(Self { address, options: options.clone(), shared, noted: Vec::new() })
    }

    /// The topic of each channel so far.
    pub fn channels(&self) -> Vec<String> {
        self.shared.lock().channels.iter().map(|channel| channel.topic.name.clone()).collect()
    }

    /// Decodes a message. Returns `None` and counts a refusal if that fails.
    fn update(&mut self, channel: usize, message: &Message, progress: &dyn Progress) -> Option<Update> {
        let topic = self.shared.lock().channels[channel].topic.clone();
        let (name, bytes) = (&topic.name, message.payload.to_bytes());
        let decoded = point_cloud2::decode(Path::new(name), &bytes, Encoding::Cdr, &self.options.read);
        let mut state = self.shared.lock();
        let decoded = match decoded {
            Ok(decoded) => decoded,
            Err(error) => {
                state.refuse(error.to_string());
                return None;
            }
        };
        let stamp = if decoded.stamp == 0 { message.arrival } else { decoded.stamp };
        let placement = state.frames.placement(&topic, &decoded.frame_id, stamp);
        drop(state);
        let (cloud, missing) = match placement {
            Ok(Some(placement)) => placement.apply(decoded.cloud),
            Ok(None) => (decoded.cloud, None),
            Err(missing) => (decoded.cloud, Some(missing)),
        };
        let mut state = self.shared.lock();
        // Points in a frame other than the one asked for would mix with points in that frame.
        if let (Some(missing), Some(_)) = (&missing, &self.options.frame) {
            let why = format!("{name}: {missing}");
            let is_first = state.unplaced.as_ref().is_none_or(|(other, _)| channel <= *other);
            if is_first && state.statistics.taken == 0 {
                state.unplaced = Some((channel, why.clone()));
            }
            state.refuse(why);
            return None;
        }
        state.unplaced = None;
        state.statistics.taken += 1;
        drop(state);
        self.noted.resize(self.noted.len().max(channel + 1), [false; 2]);
        let [no_returns, frames] = &mut self.noted[channel];
        if decoded.no_returns > 0 && !std::mem::replace(no_returns, true) {
            let (count, total) = (decoded.no_returns, decoded.no_returns + cloud.len());
            let note = format!("{name}: dropped {count} of {total} points at (0, 0, 0), where nothing was measured");
            progress.note(&one_line(&note));
        }
        if let Some(missing) = missing
            && !std::mem::replace(frames, true)
        {
            progress.note(&one_line(&format!("{name}: {missing}; its points stay as they are")));
        }
        Some(Update { channel, stamp, cloud: cloud.into() })
    }
}

impl Stream for Remote {
    fn timeline(&self) -> Option<&Timeline> {
        None
    }

    fn seek(&mut self, _frame: usize) {}

    fn next(&mut self, patience: Duration, progress: &dyn Progress) -> Result<Next, Error> {
        let begin = Instant::now();
        loop {
            if progress.cancelled() {
                return Err(Error::Cancelled);
            }
            let left = patience.saturating_sub(begin.elapsed());
            let settling = self.shared.lock().is_settling();
            if settling {
                thread::sleep(left.min(TRANSFORMS_CHECK_INTERVAL));
            } else if let Some((channel, message)) = self.shared.take(left.min(CANCEL_CHECK_INTERVAL))
                && let Some(update) = self.update(channel, &message, progress)
            {
                return Ok(Next::Update(update));
            }
            if begin.elapsed() >= patience {
                return Ok(Next::Nothing);
            }
        }
    }

    fn statistics(&self) -> Statistics {
        let state = self.shared.lock();
        Statistics { waiting: state.waiting(&self.address), ..state.statistics.clone() }
    }
}

impl Drop for Remote {
    fn drop(&mut self) {
        self.shared.stop();
    }
}
