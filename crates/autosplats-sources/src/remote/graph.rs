//! Publishers and their topics, as the publishers declare them.
//!
//! # How it works
//!
//! Nodes with rmw_zenoh and the bridge from DDS declare a *token* for each of their publishers. A token is a key with
//! the name and type of the topic, and disappears with the publisher:
//!
//! ```text
//! @ros2_lv/DOMAIN/SESSION/NODE/ID/MP/ENCLAVE/NAMESPACE/NODE/TOPIC/TYPE/HASH/QOS   rmw_zenoh; % is a slash
//! @/SESSION/@ros2_lv/MP/TOPIC/TYPE/QOS                                            the bridge; § is a slash
//! @ros2_lv/SESSION/MP/TOPIC/TYPE/QOS                                              the bridge before 1.0
//! ```

use std::collections::{BTreeMap, BTreeSet};

use super::address::{Address, TRANSFORM_TOPICS};

/// Type of PointCloud2 messages in ROS notation.
pub(super) const POINT_CLOUD: &str = "sensor_msgs/msg/PointCloud2";
/// Maximum number of stored tokens, enough for large fleets.
const MAX_TOKENS: usize = 20_000;
/// Maximum length of a key in bytes. Zenoh allows longer keys, but ROS does not use them.
const MAX_KEY_BYTES: usize = 1024;
/// Maximum number of topics listed in a message.
const MAX_LISTED_TOPICS: usize = 5;

/// A topic and its publishers.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Topic {
    /// Name in ROS notation, with a leading slash.
    pub name: String,
    /// Type of the messages, for instance `sensor_msgs/msg/PointCloud2`; empty if unknown.
    pub kind: String,
    /// ROS domain; `None` behind a bridge.
    pub domain: Option<u32>,
    /// Number of declared publishers; 0 if only messages were seen.
    pub publishers: usize,
}

impl Topic {
    /// Whether the messages contain points.
    pub fn has_points(&self) -> bool {
        self.kind == POINT_CLOUD
    }

    /// Topic from the key of a message.
    pub(super) fn of_key(key: &str) -> Self {
        let typed = key.rsplit_once('/').and_then(|(rest, _hash)| rest.rsplit_once('/'));
        if let Some((rest, kind)) = typed
            && kind.contains("::dds_::")
            && let Some((domain, name)) = rest.split_once('/')
        {
            return Self { name: format!("/{name}"), kind: ros_type(kind), domain: domain.parse().ok(), publishers: 0 };
        }
        Self { name: format!("/{key}"), ..Self::default() }
    }

    /// Topic from the token of a publisher.
    fn of_token(token: &str) -> Option<Self> {
        let parts: Vec<&str> = token.split('/').collect();
        let (name, kind, domain) = match *parts {
            ["@ros2_lv", domain, _, _, _, "MP", _, _, _, name, kind, _, _] => {
                (name.replace('%', "/"), ros_type(kind), Some(domain.parse().ok()?))
            }
            ["@", _, "@ros2_lv", "MP", name, kind, _] | ["@ros2_lv", _, "MP", name, kind, _] => {
                (name.replace('§', "/"), kind.replace('§', "/"), None)
            }
            _ => return None,
        };
        Some(Self { name: format!("/{}", name.trim_start_matches('/')), kind, domain, publishers: 1 })
    }
}

/// Converts a type from DDS notation to ROS notation: `a::msg::dds_::B_` to `a/msg/B`.
fn ros_type(kind: &str) -> String {
    let kind = kind.replace("::dds_::", "::").replace("::", "/");
    kind.strip_suffix('_').unwrap_or(&kind).to_owned()
}

/// Whether a key may be stored and displayed.
pub(super) fn is_name(key: &str) -> bool {
    key.len() <= MAX_KEY_BYTES && !key.contains(char::is_control)
}

/// All known publishers.
#[derive(Debug, Default)]
pub(super) struct Graph {
    publishers: BTreeMap<String, Topic>,
}

impl Graph {
    /// The keys of the publishers' tokens.
    pub(super) fn keys(address: &Address) -> [String; 3] {
        let domain = address.domain_key();
        [format!("@ros2_lv/{domain}/*/*/*/MP/**"), "@/*/@ros2_lv/MP/**".into(), "@ros2_lv/*/MP/**".into()]
    }

    /// Adds a token.
    pub(super) fn insert(&mut self, token: &str) {
        if self.publishers.len() < MAX_TOKENS
            && is_name(token)
            && let Some(topic) = Topic::of_token(token)
        {
            self.publishers.insert(token.to_owned(), topic);
        }
    }

    /// Removes a token.
    pub(super) fn remove(&mut self, token: &str) {
        self.publishers.remove(token);
    }

    pub(super) fn len(&self) -> usize {
        self.publishers.len()
    }

    /// Number of publishers of transforms, of any robot.
    pub(super) fn transforms(&self) -> usize {
        let last = |topic: &Topic| topic.name.rsplit('/').next().is_some_and(|name| TRANSFORM_TOPICS.contains(&name));
        self.publishers.values().filter(|topic| last(topic)).count()
    }

    /// All topics: topics of points first, then sorted by name.
    pub(super) fn topics(&self) -> Vec<Topic> {
        let mut topics: BTreeMap<(bool, &str, &str, Option<u32>), usize> = BTreeMap::new();
        for topic in self.publishers.values() {
            *topics.entry((!topic.has_points(), &topic.name, &topic.kind, topic.domain)).or_default() += 1;
        }
        let topic = |((_, name, kind, domain), publishers): ((bool, &str, &str, _), _)| Topic {
            name: name.into(),
            kind: kind.into(),
            domain,
            publishers,
        };
        topics.into_iter().map(topic).collect()
    }

    /// The publishers of points that match an address.
    fn wanted<'a>(&'a self, address: &'a Address) -> impl Iterator<Item = &'a Topic> {
        let domain =
            move |topic: &Topic| topic.domain.is_none() || address.domain.is_none() || topic.domain == address.domain;
        self.named(address).filter(move |topic| topic.has_points() && domain(topic))
    }

    /// The publishers of topics whose name matches an address.
    fn named<'a>(&'a self, address: &'a Address) -> impl Iterator<Item = &'a Topic> {
        let pattern = zenoh::key_expr::KeyExpr::new(&*address.topic).ok();
        let matches = move |topic: &Topic| {
            let name = zenoh::key_expr::keyexpr::new(topic.name.trim_start_matches('/'));
            name.is_ok_and(|name| pattern.as_ref().is_some_and(|pattern| pattern.intersects(name)))
        };
        self.publishers.values().filter(move |topic| matches(topic))
    }

    /// Whether any publisher of points matches an address.
    pub(super) fn has(&self, address: &Address) -> bool {
        self.wanted(address).next().is_some()
    }

    /// The bare keys of matching topics published by a bridge.
    pub(super) fn bridged(&self, address: &Address) -> BTreeSet<String> {
        let bare = self.wanted(address).filter(|topic| topic.domain.is_none());
        bare.map(|topic| topic.name.trim_start_matches('/').to_owned()).collect()
    }

    /// Why no publisher matches an address.
    pub(super) fn why_not(&self, address: &Address) -> String {
        let wanted = address.shown_topic();
        if let Some(other) = self.named(address).find(|topic| !topic.has_points() && !address.is_pattern()) {
            return format!("{wanted} has no points: its type is {}, not {POINT_CLOUD}", other.kind);
        }
        let topics = self.topics();
        let points = topics.iter().filter(|topic| topic.has_points()).count();
        let shown = &topics[..if points > 0 { points } else { topics.len() }];
        let mut names: Vec<&str> = shown.iter().map(|topic| &*topic.name).collect();
        names.dedup();
        let more = names.len().saturating_sub(MAX_LISTED_TOPICS);
        names.truncate(MAX_LISTED_TOPICS);
        let what = if points > 0 { "known topics" } else { "known topics, none of them with points" };
        let more = if more > 0 { format!(" and {more} more") } else { String::new() };
        match *names {
            [] => format!("nobody publishes {wanted}, nor anything else"),
            _ => format!("nobody publishes {wanted}; {what}: {}{more}", names.join(", ")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use autosplats_cloud::Error;

    fn graph() -> Graph {
        let mut graph = Graph::default();
        for token in [
            "@ros2_lv/0/7f3a/0/11/MP/%/%/talker/%front%points/sensor_msgs::msg::dds_::PointCloud2_/RIHS01_9198/::,:,:,:,,",
            "@ros2_lv/0/7f3b/0/12/MP/%/%robot/talker/%front%points/sensor_msgs::msg::dds_::PointCloud2_/RIHS01_9198/::,5",
            "@ros2_lv/0/7f3a/0/13/MP/%/%/talker/%image/sensor_msgs::msg::dds_::Image_/RIHS01_d31d/::,:,:,:,,",
            "@/1a2b/@ros2_lv/MP/robot§points/sensor_msgs§msg§PointCloud2/:::",
            "@ros2_lv/1a2b/MP/tf/tf2_msgs§msg§TFMessage/:::",
            // Tokens that are not of publishers, and keys that are not tokens.
            "@ros2_lv/0/7f3a/0/14/MS/%/%/talker/%x/sensor_msgs::msg::dds_::PointCloud2_/RIHS01_9198/::,:,:,:,,",
            "@ros2_lv/0/7f3a/0/0/NN/%/%/talker",
            "@ros2_lv/x/7f3a/0/13/MP/%/%/talker/%image/a/b/c",
            "@/1a2b/@ros2_lv/MP/a\u{1b}[2Jb/sensor_msgs§msg§PointCloud2/:::",
            "@ros2_lv",
            "",
        ] {
            graph.insert(token);
        }
        graph
    }

    #[test]
    fn tokens_of_nodes_and_bridges_are_topics() {
        let topic = |name: &str, kind: &str, domain, publishers| Topic {
            name: name.into(),
            kind: kind.into(),
            domain,
            publishers,
        };
        let expected = [
            topic("/front/points", POINT_CLOUD, Some(0), 2),
            topic("/robot/points", POINT_CLOUD, None, 1),
            topic("/image", "sensor_msgs/msg/Image", Some(0), 1),
            topic("/tf", "tf2_msgs/msg/TFMessage", None, 1),
        ];
        let mut graph = graph();
        assert_eq!(graph.topics(), expected, "points first");
        graph.remove("@/1a2b/@ros2_lv/MP/robot§points/sensor_msgs§msg§PointCloud2/:::");
        assert_eq!(graph.topics().len(), 3, "gone");
    }

    #[test]
    fn keys_say_topic_and_type() {
        let topic = Topic::of_key("7/front/points/sensor_msgs::msg::dds_::PointCloud2_/RIHS01_9198");
        assert_eq!((&*topic.name, topic.has_points(), topic.domain), ("/front/points", true, Some(7)), "rmw_zenoh");
        let topic = Topic::of_key("front/points");
        assert_eq!((&*topic.name, &*topic.kind, topic.domain), ("/front/points", "", None), "bare");
    }

    #[test]
    fn what_is_wanted_and_why_it_is_not_there() -> Result<(), Error> {
        let graph = graph();
        let address = |topic| Address::parse(&format!("zenoh://robot/{topic}"));
        assert!(graph.has(&address("front/points")?) && graph.has(&address("*/points")?), "there");
        assert!(!graph.has(&address("front/points?domain=1")?), "in another domain");
        assert_eq!(graph.bridged(&address("**")?), BTreeSet::from(["robot/points".into()]), "behind a bridge");
        assert_eq!(
            graph.why_not(&address("points")?),
            "nobody publishes /points; known topics: /front/points, /robot/points",
            "only those of points"
        );
        assert!(
            graph.why_not(&address("image")?).starts_with("/image has no points: its type is sensor_msgs/msg/Image"),
            "another type"
        );
        assert!(Graph::default().why_not(&address("a")?).ends_with("nor anything else"), "nothing at all");
        Ok(())
    }
}
