//! Where live points come from: `zenoh://HOST:PORT/TOPIC?domain=N`.

use super::frames::TRANSFORMS;
use crate::Error;

/// What begins an address of live points.
pub(super) const PREFIX: &str = "zenoh://";
/// What it looks like, for messages.
const FORM: &str = "zenoh://HOST:PORT/TOPIC?domain=N, where HOST, :PORT and ?domain=N may be left out";
/// Where routers listen if nobody says otherwise.
const PORT: u16 = 7447;
/// The type of message as rmw_zenoh writes it into keys.
pub(super) const POINTS: &str = "sensor_msgs::msg::dds_::PointCloud2_";

/// The type of messages of transforms.
const TRANSFORM: &str = "tf2_msgs::msg::dds_::TFMessage_";

/// An address, taken apart.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Address {
    /// As it was given.
    pub(super) url: String,
    /// Name or number of the machine and its port; whoever is on the local network if there is none.
    pub(super) host: Option<(String, u16)>,
    /// Without a slash before it; empty if none was named.
    pub(super) topic: String,
    /// The ROS domain; any if there is none.
    pub(super) domain: Option<u32>,
}

impl Address {
    pub(super) fn parse(url: &str) -> Result<Self, Error> {
        let bad = |what: String| Error::Remote { address: crate::error::message(url), what };
        let rest = url.strip_prefix(PREFIX).ok_or_else(|| bad(format!("it must be {FORM}")))?;
        let (rest, query) = rest.split_once('?').map_or((rest, None), |(rest, query)| (rest, Some(query)));
        let domain = match query.map(|query| query.strip_prefix("domain=").and_then(|number| number.parse().ok())) {
            Some(None) => {
                return Err(bad("behind the question mark only domain=N is understood, as in ?domain=0".into()));
            }
            Some(domain) => domain,
            None => None,
        };
        let (authority, topic) = rest.split_once('/').unwrap_or((rest, ""));
        let topic = topic.trim_matches('/');
        let host = if authority.is_empty() {
            None
        } else {
            Some(host(authority).ok_or_else(|| bad(format!("'{authority}' is no host and port; it must be {FORM}")))?)
        };
        if topic.contains(char::is_control) {
            return Err(bad("no name of a topic has line breaks or the like in it".into()));
        }
        if let Err(error) = zenoh::key_expr::KeyExpr::new(if topic.is_empty() { "**" } else { topic }) {
            let why = crate::error::message(&error.to_string());
            return Err(bad(format!("'{topic}' is no name of a topic, nor a pattern with * and ** of some: {why}")));
        }
        Ok(Self { url: url.into(), host, topic: topic.into(), domain })
    }

    /// What zenoh connects to.
    pub(super) fn endpoint(&self) -> Option<String> {
        self.host.as_ref().map(|(host, port)| format!("tcp/{host}:{port}"))
    }

    /// Whether several topics may be meant.
    pub(super) fn is_pattern(&self) -> bool {
        self.topic.contains('*')
    }

    /// The topic as ROS writes it.
    pub(super) fn shown_topic(&self) -> String {
        format!("/{}", self.topic)
    }

    /// The domain as a part of a key.
    pub(super) fn domain_key(&self) -> String {
        self.domain.map_or_else(|| "*".into(), |domain| domain.to_string())
    }

    /// The keys under which points of the topic are heard: as rmw_zenoh names it, of which type it is included, and as the bridge
    /// from DDS does, which is the bare name. A pattern of bare names would fetch messages of all types, so
    /// that those are found by what their publishers declare.
    pub(super) fn keys(&self) -> Vec<String> {
        let Self { topic, .. } = self;
        let typed = format!("{}/{topic}/{POINTS}/*", self.domain_key());
        if self.is_pattern() { vec![typed] } else { vec![typed, topic.clone()] }
    }

    /// The keys under which the transforms of its robots are heard, named in the same two ways: those beside the topic and those
    /// of all namespaces around it, as far as they are no pattern. None without a topic.
    pub(super) fn transform_keys(&self) -> Vec<String> {
        let domain = self.domain_key();
        let named = |name: String| [format!("{domain}/{name}/{TRANSFORM}/*"), name];
        let names = self.namespaces().into_iter().flat_map(|space| TRANSFORMS.map(|name| format!("{space}{name}")));
        names.flat_map(named).collect()
    }

    /// The keys to ask for transforms that do not change and were sent before anybody listened, since ROS has their publishers
    /// keep them: in the cache of Zenoh's advanced publisher, of rmw_zenoh and the bridge from 1.3 on, or before that in
    /// one that is asked with the session before the key, by the bridge with a name of its own as well.
    pub(super) fn history_keys(&self) -> Vec<String> {
        let domain = self.domain_key();
        let [_, fixed] = TRANSFORMS;
        let asked = |space: String| {
            let (bare, typed) = (format!("{space}{fixed}"), format!("{domain}/{space}{fixed}/{TRANSFORM}/*"));
            [
                format!("{typed}/@adv/**"),
                format!("*/{typed}"),
                format!("{bare}/@adv/**"),
                format!("@/*/@ros2_pub_cache/{bare}"),
                format!("@ros2_pub_cache/*/{bare}"),
            ]
        };
        self.namespaces().into_iter().flat_map(asked).collect()
    }

    /// What stands before the names of topics in the namespaces that the topic is in: nothing, then `robot/`, and so on.
    fn namespaces(&self) -> Vec<String> {
        if self.topic.is_empty() {
            return Vec::new();
        }
        let plain = &self.topic[..self.topic.find('*').unwrap_or(self.topic.len())];
        let slashes = plain.match_indices('/').map(|(at, _)| plain[..=at].to_owned());
        std::iter::once(String::new()).chain(slashes).collect()
    }
}

/// Host and port; an IPv6 address is in brackets.
fn host(authority: &str) -> Option<(String, u16)> {
    let (host, port) = match authority.rsplit_once(':') {
        Some((host, port)) if !port.ends_with(']') => (host, port.parse().ok().filter(|&port| port > 0)?),
        _ => (authority, PORT),
    };
    let plain = |text: &str| !text.is_empty() && text.chars().all(|c| c.is_alphanumeric() || "-._".contains(c));
    let six = host.strip_prefix('[').and_then(|host| host.strip_suffix(']'));
    match six {
        Some(six) => six.parse::<std::net::Ipv6Addr>().is_ok(),
        None => plain(host),
    }
    .then(|| (host.to_owned(), port))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_may_be_left_out() -> Result<(), Error> {
        let host = |url| Ok::<_, Error>(Address::parse(url)?.endpoint());
        assert_eq!(host("zenoh://robot/points")?.as_deref(), Some("tcp/robot:7447"), "the usual port");
        assert_eq!(host("zenoh://10.0.0.7:8000/points")?.as_deref(), Some("tcp/10.0.0.7:8000"), "another");
        assert_eq!(host("zenoh://[fe80::1]/points")?.as_deref(), Some("tcp/[fe80::1]:7447"), "six");
        assert_eq!(host("zenoh://[::1]:7448/points")?.as_deref(), Some("tcp/[::1]:7448"), "six and a port");
        assert_eq!(host("zenoh:///points")?, None, "no host");
        let address = Address::parse("zenoh://robot//front/points/?domain=42")?;
        assert_eq!((&*address.topic, address.domain), ("front/points", Some(42)), "slashes at the ends mean nothing");
        let keys = ["42/front/points/sensor_msgs::msg::dds_::PointCloud2_/*", "front/points"];
        assert_eq!(address.keys(), keys, "both ways of naming it");
        let transforms = "42/tf/tf2_msgs::msg::dds_::TFMessage_/* tf 42/tf_static/tf2_msgs::msg::dds_::TFMessage_/* tf_static \
                          42/front/tf/tf2_msgs::msg::dds_::TFMessage_/* front/tf \
                          42/front/tf_static/tf2_msgs::msg::dds_::TFMessage_/* front/tf_static";
        assert_eq!(address.transform_keys().join(" "), transforms, "beside it and around it");
        let history = address.history_keys();
        assert!(history.contains(&"front/tf_static/@adv/**".into()) && history.len() == 10, "{history:?}");
        assert_eq!(Address::parse("zenoh://robot/a/*/points")?.transform_keys().len(), 8, "those before it are there");
        let all = Address::parse("zenoh://robot/**")?;
        assert_eq!(all.transform_keys().len(), 4, "a pattern has no namespaces");
        assert_eq!(all.keys(), ["*/**/sensor_msgs::msg::dds_::PointCloud2_/*"], "never all there is");
        let none = Address::parse("zenoh://robot")?;
        assert_eq!((&*none.topic, none.transform_keys().len()), ("", 0), "no topic");
        Ok(())
    }

    #[test]
    fn what_makes_no_sense_is_refused_in_a_line() {
        for url in [
            "http://robot/points",
            "zenoh://robot:0/points",
            "zenoh://robot:70000/points",
            "zenoh://ro bot/points",
            "zenoh://robot#x=y/points",
            "zenoh://[::g]/points",
            "zenoh://robot/a//b",
            "zenoh://robot/a*b",
            "zenoh://robot/points\n",
            "zenoh://robot/points?domain=x",
            "zenoh://robot/points?mode=client",
        ] {
            let told = Address::parse(url).map_err(|error| error.to_string());
            assert!(told.as_ref().is_err_and(|told| !told.contains(char::is_control)), "{url}: {told:?}");
        }
    }
}
