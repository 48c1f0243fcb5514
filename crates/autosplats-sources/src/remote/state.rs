//! State shared by Zenoh's threads and the thread that takes points: newest messages, and the connection.

use std::{
    sync::{Condvar, Mutex, MutexGuard, PoisonError},
    time::{Duration, Instant, SystemTime},
};

use autosplats_cloud::one_line;
use zenoh::{bytes::ZBytes, session::ZenohId};

use super::{
    address::Address,
    frames::Frames,
    graph::{Graph, Topic, is_name},
};
use crate::Statistics;

/// Maximum number of channels of one connection; more do not occur.
const MAX_CHANNELS: usize = 64;
/// Time without a message after which the silence is reported.
const MIN_SILENCE: Duration = Duration::from_secs(5);
/// How long the first points wait for a sign that somebody publishes transforms.
const NO_TRANSFORMS_WAIT: Duration = Duration::from_millis(300);
/// How long the first points wait for transforms if somebody publishes them; robots send them at least every second.
const TRANSFORMS_WAIT: Duration = Duration::from_secs(1);

/// The state and its lock.
#[derive(Debug, Default)]
pub(super) struct Shared {
    state: Mutex<State>,
    changed: Condvar,
}

/// The state.
#[derive(Debug, Default)]
pub(super) struct State {
    pub(super) channels: Vec<Channel>,
    /// Channel to ask first, so that no channel waits behind a faster one.
    turn: usize,
    pub(super) statistics: Statistics,
    pub(super) graph: Graph,
    pub(super) frames: Frames,
    pub(super) connection: Connection,
    /// First channel whose points cannot be transformed into the frame asked for, and why, until other points can be.
    pub(super) unplaced: Option<(usize, String)>,
    /// Time of the first message. `last_message` is the time of the last.
    first: Option<Instant>,
    last_message: Option<Instant>,
    /// Whether to listen to all messages.
    pub(super) listen: bool,
    /// Whether nobody takes points any more.
    pub(super) stop: bool,
}

/// One sensor.
#[derive(Debug)]
pub(super) struct Channel {
    pub(super) topic: Topic,
    newest: Option<Message>,
}

/// A message as received.
#[derive(Debug)]
pub(super) struct Message {
    pub(super) payload: ZBytes,
    /// Time of arrival in nanoseconds since 1970.
    pub(super) arrival: i64,
}

/// State of the connection.
#[derive(Debug, Default)]
pub(super) struct Connection {
    pub(super) connected: bool,
    /// Number of times that others connected.
    pub(super) times: u64,
    /// The others connected last.
    others: Vec<ZenohId>,
    /// Why nobody is connected.
    pub(super) fault: Option<String>,
}

impl Shared {
    pub(super) fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes transforms.
    pub(super) fn receive(&self, key: &str, payload: &ZBytes) {
        if is_name(key) {
            let topic = Topic::of_key(key);
            let message = payload.to_bytes();
            let mut state = self.lock();
            if let Err(why) = state.frames.receive(&topic, &message, now()) {
                state.refuse(format!("{}: {why}", topic.name));
            }
        }
    }

    /// Stores a message in place of the previous one of its channel.
    pub(super) fn put(&self, key: &str, payload: ZBytes) {
        let arrival = now();
        if !is_name(key) {
            return self.lock().refuse("a message with an invalid key".into());
        }
        let topic = Topic::of_key(key);
        let mut state = self.lock();
        let known = state.channels.iter().position(|channel| channel.topic.same(&topic));
        let Some(channel) = known.or_else(|| state.channel(topic)) else { return };
        let replaced = state.channels[channel].newest.replace(Message { payload, arrival });
        state.statistics.dropped += u64::from(replaced.is_some());
        let now = Instant::now();
        (state.first, state.last_message) = (state.first.or(Some(now)), Some(now));
        drop(state);
        // Frees megabytes after the lock is released.
        drop(replaced);
        self.changed.notify_all();
    }

    /// Takes the newest message of the next channel that has one, and waits up to `patience` for it.
    pub(super) fn take(&self, patience: Duration) -> Option<(usize, Message)> {
        let waited = self.changed.wait_timeout_while(self.lock(), patience, |state| {
            state.channels.iter().all(|channel| channel.newest.is_none())
        });
        let (mut state, _) = waited.unwrap_or_else(PoisonError::into_inner);
        let count = state.channels.len();
        let turn = (0..count).map(|step| (state.turn + step) % count);
        let channel = turn.into_iter().find(|&channel| state.channels[channel].newest.is_some())?;
        state.turn = channel + 1;
        Some((channel, state.channels[channel].newest.take()?))
    }

    /// Waits up to `patience`, and returns whether nobody takes points any more.
    pub(super) fn stopped(&self, patience: Duration) -> bool {
        let waited = self.changed.wait_timeout_while(self.lock(), patience, |state| !state.stop);
        waited.unwrap_or_else(PoisonError::into_inner).0.stop
    }

    pub(super) fn stop(&self) {
        self.lock().stop = true;
        self.changed.notify_all();
    }
}

/// Current time in nanoseconds since 1970.
fn now() -> i64 {
    let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    i64::try_from(since.as_nanos()).unwrap_or(i64::MAX)
}

impl State {
    /// Whether the first points have not arrived, or still wait for the transforms of their robot.
    pub(super) fn is_settling(&self) -> bool {
        let known = !self.frames.is_empty() || self.graph.transforms() > 0;
        let patience = if known { TRANSFORMS_WAIT } else { NO_TRANSFORMS_WAIT };
        self.first.is_none_or(|first| first.elapsed() < patience)
    }

    /// Adds a channel.
    fn channel(&mut self, topic: Topic) -> Option<usize> {
        if self.channels.len() == MAX_CHANNELS {
            self.refuse(format!("{}: there are {MAX_CHANNELS} other topics already; choose fewer", topic.name));
            return None;
        }
        self.channels.push(Channel { topic, newest: None });
        Some(self.channels.len() - 1)
    }

    /// Counts a refusal.
    pub(super) fn refuse(&mut self, why: String) {
        self.statistics.refused += 1;
        self.statistics.last_refusal = Some(one_line(&why));
    }

    /// Updates who is connected.
    pub(super) fn others(&mut self, others: Vec<ZenohId>) {
        let Connection { connected, times, others: before, fault } = &mut self.connection;
        let lost = !*connected && !before.is_empty();
        let replaced = !before.is_empty() && !before.iter().any(|other| others.contains(other));
        let was = std::mem::replace(connected, !others.is_empty());
        *times += u64::from(*connected && (!was || replaced));
        if *connected {
            self.statistics.reconnected += u64::from(lost || replaced);
            *before = others;
            *fault = None;
        } else if was {
            *fault = Some("the connection is lost".into());
        }
    }

    /// Why nothing arrives, in one line; `None` if something does.
    pub(super) fn waiting(&self, address: &Address) -> Option<String> {
        let silence = self.last_message.map(|last_message| last_message.elapsed());
        if !self.connection.connected {
            let place = match address.endpoint() {
                Some(endpoint) => format!("no router at {endpoint}"),
                None => "no router or peer on the local network".into(),
            };
            let why = self.connection.fault.as_ref().map(|why| format!(": {why}")).unwrap_or_default();
            return Some(one_line(&(place + &why)));
        }
        if silence.is_some_and(|silence| silence < MIN_SILENCE) {
            return self.unplaced.as_ref().map(|(_, why)| one_line(why));
        }
        let told = match (self.graph.has(address), silence) {
            (true, None) => "publisher found, no message yet".into(),
            (true, Some(silence)) => format!("publisher found, no message for {} s", silence.as_secs()),
            (false, _) => format!("connected, but {}", self.graph.why_not(address)),
        };
        Some(one_line(&told))
    }
}

impl Topic {
    /// Whether both topics are of the same sensor.
    fn same(&self, other: &Self) -> bool {
        self.domain == other.domain && self.name == other.name
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_message_of_each_channel_in_turn() {
        let shared = Shared::default();
        for number in 0..3_u8 {
            for key in ["a", "b", "c"] {
                shared.put(key, ZBytes::from(vec![number]));
            }
        }
        let take = || shared.take(Duration::ZERO).map(|(channel, message)| (channel, message.payload.to_bytes()[0]));
        assert_eq!(take(), Some((0, 2)), "the newest");
        shared.put("a", ZBytes::from(vec![3]));
        assert_eq!([take(), take(), take(), take()], [Some((1, 2)), Some((2, 2)), Some((0, 3)), None], "in turn");
        assert_eq!(shared.lock().statistics.dropped, 6, "replaced");
    }

    #[test]
    fn made_up_topics_end_somewhere() {
        let shared = Shared::default();
        for number in 0..1000 {
            shared.put(&format!("topic{number}"), ZBytes::from(vec![0]));
        }
        shared.put("a\u{1b}[2Jb", ZBytes::new());
        shared.put(&"a".repeat(2000), ZBytes::new());
        let state = shared.lock();
        assert_eq!((state.channels.len(), state.statistics.refused), (64, 938), "no more of them");
    }
}
