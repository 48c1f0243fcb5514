//! What the network's threads and the one that takes points share: of each channel the newest message, and who is there.

use std::{
    sync::{Condvar, Mutex, MutexGuard, PoisonError},
    time::{Duration, Instant, SystemTime},
};

use zenoh::{bytes::ZBytes, session::ZenohId};

use super::{
    address::Address,
    frames::Frames,
    graph::{Graph, Topic, is_name},
};
use crate::Statistics;

/// Sensors of one connection: whoever makes up more has nothing to show.
const MAX_CHANNELS: usize = 64;
/// Time without a message that is worth telling.
const SILENCE: Duration = Duration::from_secs(5);
/// How long the first points wait for a sign that somebody publishes transforms, and if so for these: those of a robot come at
/// least every second.
const SIGNS: Duration = Duration::from_millis(300);
const SETTLING: Duration = Duration::from_secs(1);

/// State and its lock.
#[derive(Debug, Default)]
pub(super) struct Shared {
    state: Mutex<State>,
    changed: Condvar,
}

/// What is there.
#[derive(Debug, Default)]
pub(super) struct State {
    pub(super) channels: Vec<Channel>,
    /// The channel that is asked first, so that none waits behind a faster one.
    turn: usize,
    pub(super) statistics: Statistics,
    pub(super) graph: Graph,
    pub(super) frames: Frames,
    pub(super) connection: Connection,
    /// The first channel whose points cannot be brought into the frame that was asked for, and why, before any others could.
    pub(super) unplaced: Option<(usize, String)>,
    /// When the first message came, and the last.
    first: Option<Instant>,
    heard: Option<Instant>,
    /// Whether to listen to all that is sent.
    pub(super) listen: bool,
    /// Nobody takes points any more.
    pub(super) stop: bool,
}

/// One sensor.
#[derive(Debug)]
pub(super) struct Channel {
    pub(super) topic: Topic,
    newest: Option<Message>,
}

/// A message as it came.
#[derive(Debug)]
pub(super) struct Message {
    pub(super) payload: ZBytes,
    /// When it came, in nanoseconds since 1970.
    pub(super) arrival: i64,
}

/// Whether anybody is at the other end.
#[derive(Debug, Default)]
pub(super) struct Connection {
    pub(super) connected: bool,
    /// Times that others came.
    pub(super) times: u64,
    /// Who was there last.
    others: Vec<ZenohId>,
    /// Why nobody is.
    pub(super) fault: Option<String>,
}

impl Shared {
    pub(super) fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Transforms came.
    pub(super) fn hear(&self, key: &str, payload: &ZBytes) {
        if is_name(key) {
            let topic = Topic::of_key(key);
            let message = payload.to_bytes();
            let mut state = self.lock();
            if let Err(why) = state.frames.hear(&topic, &message, now()) {
                state.refuse(format!("{}: {why}", topic.name));
            }
        }
    }

    /// A message came, which takes the place of the one before that nobody took.
    pub(super) fn put(&self, key: &str, payload: ZBytes) {
        let arrival = now();
        if !is_name(key) {
            return self.lock().refuse("a message under a name that is none".into());
        }
        let topic = Topic::of_key(key);
        let mut state = self.lock();
        let known = state.channels.iter().position(|channel| channel.topic.same(&topic));
        let Some(channel) = known.or_else(|| state.channel(topic)) else { return };
        let replaced = state.channels[channel].newest.replace(Message { payload, arrival });
        state.statistics.dropped += u64::from(replaced.is_some());
        let now = Instant::now();
        (state.first, state.heard) = (state.first.or(Some(now)), Some(now));
        drop(state);
        // Megabytes are freed here, while nobody waits for the lock.
        drop(replaced);
        self.changed.notify_all();
    }

    /// The newest message of the next channel that has one, for which it waits no longer than `patience`.
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

    /// Waits, unless nobody takes points any more: then it says so.
    pub(super) fn stopped(&self, patience: Duration) -> bool {
        let waited = self.changed.wait_timeout_while(self.lock(), patience, |state| !state.stop);
        waited.unwrap_or_else(PoisonError::into_inner).0.stop
    }

    pub(super) fn stop(&self) {
        self.lock().stop = true;
        self.changed.notify_all();
    }
}

/// Nanoseconds since 1970.
fn now() -> i64 {
    let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    i64::try_from(since.as_nanos()).unwrap_or(i64::MAX)
}

impl State {
    /// Whether the first points have not come, or still wait for the transforms of their robot.
    pub(super) fn is_settling(&self) -> bool {
        let known = !self.frames.is_empty() || self.graph.transforms() > 0;
        let patience = if known { SETTLING } else { SIGNS };
        self.first.is_none_or(|first| first.elapsed() < patience)
    }

    /// A new channel.
    fn channel(&mut self, topic: Topic) -> Option<usize> {
        if self.channels.len() == MAX_CHANNELS {
            self.refuse(format!("{}: there are {MAX_CHANNELS} other topics already; name fewer", topic.name));
            return None;
        }
        self.channels.push(Channel { topic, newest: None });
        Some(self.channels.len() - 1)
    }

    /// Counts what cannot be shown.
    pub(super) fn refuse(&mut self, why: String) {
        self.statistics.refused += 1;
        self.statistics.last_refusal = Some(crate::error::message(&why));
    }

    /// Who is at the other end now.
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

    /// Why nothing comes, in a line; nothing if something does.
    pub(super) fn waiting(&self, address: &Address) -> Option<String> {
        let silence = self.heard.map(|heard| heard.elapsed());
        if !self.connection.connected {
            let place = match address.endpoint() {
                Some(endpoint) => format!("no router at {endpoint}"),
                None => "no router or peer on the local network".into(),
            };
            let why = self.connection.fault.as_ref().map(|why| format!(": {why}")).unwrap_or_default();
            return Some(crate::error::message(&(place + &why)));
        }
        if silence.is_some_and(|silence| silence < SILENCE) {
            return self.unplaced.as_ref().map(|(_, why)| crate::error::message(why));
        }
        let told = match (self.graph.has(address), silence) {
            (true, None) => "publisher found, no message yet".into(),
            (true, Some(silence)) => format!("publisher found, no message for {} s", silence.as_secs()),
            (false, _) => format!("connected, but {}", self.graph.why_not(address)),
        };
        Some(crate::error::message(&told))
    }
}

impl Topic {
    /// Whether it is the same sensor's.
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
