//! Lists topics.

use std::{
    collections::BTreeMap,
    path::Path,
    sync::Arc,
    thread,
    time::{Duration, Instant},
};

use autosplats_cloud::{Error, one_line};
use autosplats_formats::ReadOptions;

use super::{
    address::Address,
    graph::{POINT_CLOUD, Topic},
    link,
    state::Shared,
};
use crate::point_cloud2::{self, Encoding};

/// The search ends when something is found and nothing new appears for this long.
const QUIET_TIME: Duration = Duration::from_millis(700);
/// Time between two checks.
const CHECK_INTERVAL: Duration = Duration::from_millis(50);

/// The topics published at `zenoh://HOST:PORT/?domain=N`: topics of points first, then sorted by name.
///
/// Waits up to `patience`, and less if publishers are found earlier. Publishers that do not declare themselves, unlike
/// those of ROS, are searched only if no others are found, by listening to all messages.
///
/// # Errors
/// [`Error::Remote`] if the address is invalid or nobody answers.
pub fn topics(url: &str, patience: Duration) -> Result<Vec<Topic>, Error> {
    let address = Address::parse(url)?;
    let address = Address { topic: String::new(), ..address };
    let failed = |what| Error::Remote { address: one_line(url), what };
    let shared = Arc::new(Shared::default());
    link::start(address.clone(), shared.clone()).map_err(|error| failed(format!("cannot start thread: {error}")))?;
    let found = find(&address, &shared, patience);
    shared.stop();
    found.map_err(failed)
}

fn find(address: &Address, shared: &Shared, patience: Duration) -> Result<Vec<Topic>, String> {
    let begin = Instant::now();
    let (mut known, mut changed) = (0, begin);
    while begin.elapsed() < patience {
        let mut state = shared.lock();
        // Publishers that declare themselves do so at once.
        let nobody = state.connection.connected && state.graph.len() == 0;
        state.listen |= nobody && begin.elapsed() > patience / 2;
        let now = state.graph.len() + state.channels.len();
        drop(state);
        if now != known {
            (known, changed) = (now, Instant::now());
        } else if known > 0 && changed.elapsed() > QUIET_TIME {
            break;
        }
        thread::sleep(CHECK_INTERVAL);
    }
    let state = shared.lock();
    if !state.connection.connected {
        let why = state.waiting(address).unwrap_or_default();
        let remedy = match address.host {
            Some(_) => "start one there (ros2 run rmw_zenoh_cpp rmw_zenohd, or zenohd), or give another port",
            None => "start one (ros2 run rmw_zenoh_cpp rmw_zenohd, or zenohd), or give its host: zenoh://HOST/",
        };
        return Err(format!("{why}; {remedy}"));
    }
    let mut topics = state.graph.topics();
    let mut heard: BTreeMap<usize, Topic> =
        state.channels.iter().map(|channel| channel.topic.clone()).enumerate().collect();
    drop(state);
    while !heard.is_empty()
        && let Some((channel, message)) = shared.take(Duration::ZERO)
    {
        // More messages, also of new topics, may arrive while these are decoded.
        let Some(mut topic) = heard.remove(&channel) else { continue };
        let bytes = message.payload.to_bytes();
        let decoded = point_cloud2::decode(Path::new(&topic.name), &bytes, Encoding::Cdr, &ReadOptions::default());
        if topic.kind.is_empty() && decoded.is_ok() {
            topic.kind = POINT_CLOUD.into();
        }
        topics.push(topic);
    }
    topics.sort_by(|a, b| b.has_points().cmp(&a.has_points()).then_with(|| a.name.cmp(&b.name)));
    Ok(topics)
}
