//! Zenoh sessions to connect to, in the same process.

use std::net::TcpListener;

use zenoh::{Config, Session, Wait as _, liveliness::LivelinessToken, query::Queryable};

/// Type of transforms in the keys of rmw_zenoh.
pub(crate) const TRANSFORM: &str = "tf2_msgs::msg::dds_::TFMessage_";

/// Key of a topic in rmw_zenoh, with an arbitrary hash.
pub(crate) fn rmw_key(domain: u32, topic: &str) -> String {
    format!("{domain}/{topic}/sensor_msgs::msg::dds_::PointCloud2_/RIHS01_{:x}", std::process::id())
}

/// A free port of this machine.
pub(crate) fn free_port() -> u16 {
    TcpListener::bind("127.0.0.1:0").and_then(|listener| listener.local_addr()).unwrap().port()
}

fn open(mode: &str, way: &str, port: u16, calls: bool) -> Session {
    let mut config = Config::default();
    // A session that is found on the network must be reachable from there.
    let host = if calls { "0.0.0.0" } else { "127.0.0.1" };
    for (name, value) in [
        ("mode", format!("{mode:?}")),
        (way, format!(r#"["tcp/{host}:{port}"]"#)),
        ("scouting/multicast/enabled", calls.to_string()),
        ("scouting/gossip/enabled", "false".into()),
    ] {
        config.insert_json5(name, &value).unwrap();
    }
    zenoh::open(config).wait().unwrap()
}

/// A session that others connect to.
pub(crate) fn listener(mode: &str, port: u16) -> Session {
    open(mode, "listen/endpoints", port, false)
}

/// A session that answers searches on the network.
pub(crate) fn answering(port: u16) -> Session {
    open("peer", "listen/endpoints", port, true)
}

/// A session that connects to another.
pub(crate) fn client(port: u16) -> Session {
    open("client", "connect/endpoints", port, false)
}

/// Declares a publisher as rmw_zenoh does.
pub(crate) fn rmw_token(session: &Session, topic: &str, kind: &str, id: u32) -> LivelinessToken {
    let topic = topic.replace('/', "%");
    let key = format!("@ros2_lv/0/{}/0/{id}/MP/%/%/lidar/%{topic}/{kind}/RIHS01_00/::,:,:,:,,", session.zid());
    session.liveliness().declare_token(key).wait().unwrap()
}

/// Declares a publisher as the bridge from DDS does.
pub(crate) fn bridge_token(session: &Session, topic: &str) -> LivelinessToken {
    let topic = topic.replace('/', "§");
    let key = format!("@/{}/@ros2_lv/MP/{topic}/sensor_msgs§msg§PointCloud2/:::", session.zid());
    session.liveliness().declare_token(key).wait().unwrap()
}

/// Stores a message under the key `asked` for later queries, and answers with the message's own key.
pub(crate) fn cache(session: &Session, asked: String, key: String, message: Vec<u8>) -> Queryable<()> {
    let answer = move |query: zenoh::query::Query| query.reply(key.clone(), message.clone()).wait().unwrap();
    session.declare_queryable(asked).callback(answer).wait().unwrap()
}
