//! The thread that holds the connection.
//!
//! # How it works
//!
//! Opening and closing wait for the network. A separate thread does both, so the caller that takes points never waits.
//! The thread retries until a connection is open; then Zenoh itself reconnects when the connection is lost. From then
//! on the thread watches who is connected and subscribes to new topics of bridges. It also asks for transforms sent
//! before the subscription: when others connect, and then at growing intervals. A publisher may declare itself before
//! it has transforms.

use std::{
    collections::BTreeMap,
    io,
    net::{TcpStream, ToSocketAddrs as _},
    panic::{AssertUnwindSafe, catch_unwind},
    sync::Arc,
    thread,
    time::{Duration, Instant},
};

use zenoh::{
    Config, Session, Wait as _,
    pubsub::Subscriber,
    query::{ConsolidationMode, QueryTarget, Reply, ReplyKeyExpr},
    sample::{Sample, SampleKind},
};

use super::{address::Address, graph::Graph, state::Shared};

/// Time between two attempts to open a connection.
const RETRY_INTERVAL: Duration = Duration::from_secs(1);
/// Time between two checks of the connection.
const CHECK_INTERVAL: Duration = Duration::from_millis(100);
/// How long to wait for the answer to a query for earlier transforms.
const HISTORY_TIMEOUT: Duration = Duration::from_secs(5);
/// First and longest pause between two queries for earlier transforms.
const HISTORY_PAUSES: [Duration; 2] = [Duration::from_secs(1), Duration::from_secs(32)];
/// Timeout of the connection attempt that finds why nobody answers.
const PROBE_TIMEOUT: Duration = Duration::from_secs(1);
/// Router that nodes with rmw_zenoh connect to, since they do not announce themselves on the network.
const OWN_ROUTER: &str = "tcp/localhost:7447";

/// Starts the thread for an address, which runs until [`Shared::stop`].
pub(super) fn start(address: Address, shared: Arc<Shared>) -> io::Result<()> {
    let work = move || {
        // A bug must not end the connection silently.
        if catch_unwind(AssertUnwindSafe(|| run(&address, &shared))).is_err() {
            let mut state = shared.lock();
            let why = "the thread of the connection failed because of a bug in this program, please report it";
            state.refuse(why.into());
            (state.connection.connected, state.connection.fault) = (false, Some(why.into()));
        }
    };
    thread::Builder::new().name("zenoh link".into()).spawn(work).map(drop)
}

fn run(address: &Address, shared: &Arc<Shared>) {
    let session = loop {
        match open(address) {
            Ok(session) => break session,
            Err(fault) => shared.lock().connection.fault = Some(fault),
        }
        if shared.stopped(RETRY_INTERVAL) {
            return;
        }
    };
    // Before the first message can arrive.
    look(&session, shared);
    let mut subscriptions = BTreeMap::new();
    // Subscriptions to tokens and transforms; dropping them unsubscribes.
    let mut tokens = Vec::new();
    // Points come last, so that transforms and tokens known about them arrive no later.
    let declared = Graph::keys(address).iter().try_for_each(|key| {
        tokens.push(watch(&session, key, shared)?);
        Ok(())
    });
    let declared = declared.and_then(|()| {
        address.transform_keys().iter().try_for_each(|key| {
            tokens.push(hear_transforms(&session, key, shared)?);
            Ok(())
        })
    });
    let keys = if address.topic.is_empty() { Vec::new() } else { address.keys() };
    let declared =
        declared.and_then(|()| keys.into_iter().try_for_each(|key| receive(&session, key, shared, &mut subscriptions)));
    if let Err(error) = declared {
        shared.lock().refuse(format!("nothing can be subscribed to: {error}"));
    }
    let mut history = History::default();
    while !shared.stopped(CHECK_INTERVAL) {
        look(&session, shared);
        let state = shared.lock();
        let asks = history.is_due((state.connection.times, state.graph.transforms()), state.connection.connected);
        let mut wanted = Vec::new();
        if state.listen && !subscriptions.contains_key("**") {
            wanted.push("**".to_owned());
        }
        if address.is_pattern() {
            wanted.extend(state.graph.bridged(address).into_iter().filter(|key| !subscriptions.contains_key(key)));
        }
        drop(state);
        let asked = if asks { address.history_keys() } else { Vec::new() };
        for key in asked {
            if let Err(error) = ask(&session, key, shared) {
                shared.lock().refuse(format!("earlier transforms cannot be queried: {error}"));
            }
        }
        for key in wanted {
            if let Err(error) = receive(&session, key, shared, &mut subscriptions) {
                shared.lock().refuse(error.to_string());
            }
        }
    }
}

/// Updates who is connected.
fn look(session: &Session, shared: &Shared) {
    let info = session.info();
    let others = info.routers_zid().wait().chain(info.peers_zid().wait()).collect();
    shared.lock().others(others);
}

/// Subscriptions to points by key.
type Subscriptions = BTreeMap<String, Subscriber<()>>;

/// Subscribes to points.
fn receive(
    session: &Session,
    key: String,
    shared: &Arc<Shared>,
    subscriptions: &mut Subscriptions,
) -> zenoh::Result<()> {
    let shared = shared.clone();
    let put = move |sample: Sample| {
        if sample.kind() == SampleKind::Put {
            shared.put(sample.key_expr().as_str(), sample.payload().clone());
        }
    };
    subscriptions.insert(key.clone(), session.declare_subscriber(key).callback(put).wait()?);
    Ok(())
}

/// Subscribes to transforms.
fn hear_transforms(session: &Session, key: &str, shared: &Arc<Shared>) -> zenoh::Result<Subscriber<()>> {
    let shared = shared.clone();
    let put = move |sample: Sample| {
        if sample.kind() == SampleKind::Put {
            shared.receive(sample.key_expr().as_str(), sample.payload());
        }
    };
    session.declare_subscriber(key.to_owned()).callback(put).wait()
}

/// Decides when to ask for transforms sent earlier.
#[derive(Default)]
struct History {
    /// Number of connections and of publishers of transforms at the last check.
    others: (u64, usize),
    /// Time of the last query, and the pause until the next.
    asked: Option<(Instant, Duration)>,
}

impl History {
    fn is_due(&mut self, others: (u64, usize), connected: bool) -> bool {
        let [first, longest] = HISTORY_PAUSES;
        let new = std::mem::replace(&mut self.others, others) != others;
        let pause = match self.asked {
            _ if !connected => return false,
            None => first,
            Some(_) if new => first,
            Some((asked, pause)) if asked.elapsed() >= pause => longest.min(pause * 2),
            Some(_) => return false,
        };
        self.asked = Some((Instant::now(), pause));
        true
    }
}

/// Asks all caches of transforms for their content.
fn ask(session: &Session, key: String, shared: &Arc<Shared>) -> zenoh::Result<()> {
    let shared = shared.clone();
    let answered = move |reply: Reply| {
        if let Ok(sample) = reply.result() {
            shared.receive(sample.key_expr().as_str(), sample.payload());
        }
    };
    // All answers to a query count. Each arrives under the key of its message, which differs from the query's key.
    let asked = session.get(key).target(QueryTarget::All).consolidation(ConsolidationMode::None);
    asked.accept_replies(ReplyKeyExpr::Any).timeout(HISTORY_TIMEOUT).callback(answered).wait()
}

/// Subscribes to the tokens of publishers, including existing ones.
fn watch(session: &Session, key: &str, shared: &Arc<Shared>) -> zenoh::Result<Subscriber<()>> {
    let shared = shared.clone();
    let seen = move |sample: Sample| {
        let graph = &mut shared.lock().graph;
        match sample.kind() {
            SampleKind::Put => graph.insert(sample.key_expr().as_str()),
            SampleKind::Delete => graph.remove(sample.key_expr().as_str()),
        }
    };
    session.liveliness().declare_subscriber(key.to_owned()).history(true).callback(seen).wait()
}

/// Connects, or returns why that fails.
fn open(address: &Address) -> Result<Session, String> {
    let config = config(address).map_err(|error| error.to_string())?;
    zenoh::open(config).wait().map_err(|error| match &address.host {
        Some((host, port)) => why_unreachable(host, *port),
        None => error.to_string(),
    })
}

/// Configuration: a client of the given host, or a peer that searches for others and accepts no connections.
fn config(address: &Address) -> zenoh::Result<Config> {
    let mut config = Config::default();
    let (mode, endpoint) = match address.endpoint() {
        Some(endpoint) => ("client", endpoint),
        None => ("peer", OWN_ROUTER.into()),
    };
    let scouting = if address.host.is_none() { "true" } else { "false" };
    for (name, value) in [
        ("mode", serde_json::to_string(mode)?.as_str()),
        ("connect/endpoints", &serde_json::to_string(&[endpoint])?),
        ("connect/retry", r#"{ "period_init_ms": 500, "period_max_ms": 2000, "period_increase_factor": 2 }"#),
        ("listen/endpoints", "[]"),
        ("scouting/multicast/enabled", scouting),
        ("scouting/multicast/listen", "false"),
    ] {
        config.insert_json5(name, value)?;
    }
    Ok(config)
}

/// Why a host cannot be reached, since Zenoh does not tell.
fn why_unreachable(host: &str, port: u16) -> String {
    let bare = host.trim_start_matches('[').trim_end_matches(']');
    let Some(first) = (bare, port).to_socket_addrs().ok().and_then(|mut addresses| addresses.next()) else {
        return format!("no machine is called '{host}'");
    };
    match TcpStream::connect_timeout(&first, PROBE_TIMEOUT) {
        Ok(_) => "something else answers there".into(),
        Err(error) if error.kind() == io::ErrorKind::ConnectionRefused => "nobody listens there".into(),
        Err(error) if error.kind() == io::ErrorKind::TimedOut => "the machine does not answer".into(),
        Err(error) => error.to_string(),
    }
}
