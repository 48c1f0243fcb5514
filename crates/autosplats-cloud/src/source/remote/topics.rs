//! Which topics there are.

use std::{
    collections::BTreeMap,
    path::Path,
    sync::Arc,
    thread,
    time::{Duration, Instant},
};

use super::{
    address::Address,
    graph::{POINT_CLOUD, Topic},
    link,
    state::Shared,
};
use crate::{
    Error, ReadOptions,
    point_cloud2::{self, Encoding},
};

/// Once something was found, so long without anything new is the end.
const QUIET: Duration = Duration::from_millis(700);
/// Between two looks.
const LOOK: Duration = Duration::from_millis(50);

/// The topics that are published at `zenoh://HOST:PORT/?domain=N`, those of points first, then by name.
///
/// It takes no longer than `patience`, and less if somebody is found earlier. Publishers that do not declare themselves, as
/// none of ROS are, are only looked for if nobody else is there, by listening to all that is sent.
///
/// # Errors
/// [`Error::Remote`] if the address makes no sense or nobody is there.
pub fn topics(url: &str, patience: Duration) -> Result<Vec<Topic>, Error> {
    let address = Address::parse(url)?;
    let address = Address { topic: String::new(), ..address };
    let failed = |what| Error::Remote { address: crate::error::message(url), what };
    let shared = Arc::new(Shared::default());
    link::start(address.clone(), shared.clone()).map_err(|error| failed(format!("no thread can be had: {error}")))?;
    let found = find(&address, &shared, patience);
    shared.stop();
    found.map_err(failed)
}

fn find(address: &Address, shared: &Shared, patience: Duration) -> Result<Vec<Topic>, String> {
    let begin = Instant::now();
    let (mut known, mut changed) = (0, begin);
    while begin.elapsed() < patience {
        let mut state = shared.lock();
        // Those who declare themselves do so at once.
        let nobody = state.connection.connected && state.graph.len() == 0;
        state.listen |= nobody && begin.elapsed() > patience / 2;
        let now = state.graph.len() + state.channels.len();
        drop(state);
        if now != known {
            (known, changed) = (now, Instant::now());
        } else if known > 0 && changed.elapsed() > QUIET {
            break;
        }
        thread::sleep(LOOK);
    }
    let state = shared.lock();
    if !state.connection.connected {
        let why = state.waiting(address).unwrap_or_default();
        let remedy = match address.host {
            Some(_) => "start one there (ros2 run rmw_zenoh_cpp rmw_zenohd, or zenohd), or name another port",
            None => "start one (ros2 run rmw_zenoh_cpp rmw_zenohd, or zenohd), or name its host: zenoh://HOST/",
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
        // More come while these are decoded, of topics told already and of new ones.
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
