//! Remote points of ROS 2 over Zenoh: nodes that run rmw_zenoh, or any behind the bridge from DDS.
//!
//! # How it works
//!
//! A [`Remote`] subscribes to a topic in the two ways it may be named. Zenoh's threads put each message into the one place that its
//! channel has, so that the newest wins and nothing queues; it is decoded when it is [taken](crate::Stream::next), so
//! that what nobody takes costs next to nothing. A thread of ours holds the connection (`link.rs`), and what publishers declare
//! of themselves (`graph.rs`) says why nothing comes, if nothing does. Where sensors are, robots say by transforms (`frames.rs`),
//! so that all points are in one frame as those of recordings are.
//!
//! Zenoh is licensed under EPL-2.0 or Apache-2.0, at our choice. It asks for Rust 1.75, and what it needs for 1.88.

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

use self::{
    address::Address,
    frames::Frames,
    state::{Message, Shared},
};
pub use self::{graph::Topic, topics::topics};
use super::{
    point_cloud2::{self, Encoding, frame_name},
    stream::{Next, Statistics, Stream, Timeline, Update},
};
use crate::{Error, Progress, ReadOptions};

/// Between two questions whether to stop.
const ASK: Duration = Duration::from_millis(50);

/// Between two looks at whether transforms have come.
const SETTLE: Duration = Duration::from_millis(10);

/// What is heard of robots, and how.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RemoteOptions {
    /// The coordinate frame that all points are brought into; those that cannot be are refused. If there is none, the topmost that
    /// is known of the first sensor, a second after its first points. So long these wait for transforms, or 0.3 s if nobody
    /// publishes any.
    pub frame: Option<String>,
    /// How points are read.
    pub read: ReadOptions,
}

/// Whether a name is an address of live points, right or wrong.
pub fn is_remote(name: &str) -> bool {
    name.starts_with(address::PREFIX)
}

/// Points as sensors send them.
///
/// Each topic is a [channel](Update::channel), counted as they are first heard. Stamps are those that the messages have, or when
/// they came if they have none. They are handed on as they come, older ones behind newer ones too.
///
/// Points are brought into one frame by what is published as `tf` and `tf_static`, in the namespaces around their topic as well;
/// those of a sensor of which no transforms are known stay in its own. Between two transforms a pose is interpolated, after
/// the last it is the last.
pub struct Remote {
    address: Address,
    options: RemoteOptions,
    shared: Arc<Shared>,
    /// Channels of which something was told that need not be told again.
    told: Vec<[bool; 2]>,
}

impl Remote {
    /// Begins to listen to `zenoh://HOST:PORT/TOPIC?domain=N`.
    ///
    /// The port is 7447 if none is named, and without a host whoever is found on the local network is asked, a router on
    /// this machine included. The topic may be a pattern, where `*` is one part of a name and `**` any number. Without a domain
    /// it is any.
    ///
    /// Nothing is waited for: nobody needs to be there yet, and who goes away may come back. What is the matter is in
    /// [`Statistics::waiting`].
    ///
    /// # Errors
    /// [`Error::Remote`] if the address makes no sense or names no topic.
    pub fn open(url: &str, options: &RemoteOptions) -> Result<Self, Error> {
        let address = Address::parse(url)?;
        if address.topic.is_empty() {
            let what = "no topic is named; name one behind the host, as in zenoh://HOST/points, or ** for all".into();
            return Err(Error::Remote { address: url.into(), what });
        }
        let shared = Arc::new(Shared::default());
        shared.lock().frames = Frames::new(options.frame.as_deref().map(frame_name));
        link::start(address.clone(), shared.clone())
            .map_err(|error| Error::Remote { address: url.into(), what: format!("no thread can be had: {error}") })?;
        Ok(Self { address, options: options.clone(), shared, told: Vec::new() })
    }

    /// The topic of each channel heard so far.
    pub fn channels(&self) -> Vec<String> {
        self.shared.lock().channels.iter().map(|channel| channel.topic.name.clone()).collect()
    }

    /// Decodes a message; one that is none is counted.
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
        // In another frame than was asked for they would be in the way of those in that one.
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
        self.told.resize(self.told.len().max(channel + 1), [false; 2]);
        let [no_returns, frames] = &mut self.told[channel];
        if decoded.no_returns > 0 && !std::mem::replace(no_returns, true) {
            let (count, total) = (decoded.no_returns, decoded.no_returns + cloud.len());
            let note = format!("{name}: dropped {count} of {total} points at (0, 0, 0), where nothing was measured");
            progress.note(&crate::error::message(&note));
        }
        if let Some(missing) = missing
            && !std::mem::replace(frames, true)
        {
            progress.note(&crate::error::message(&format!("{name}: {missing}; its points stay as they are")));
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
                thread::sleep(left.min(SETTLE));
            } else if let Some((channel, message)) = self.shared.take(left.min(ASK))
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
