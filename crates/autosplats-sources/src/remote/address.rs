//! Addresses of live points: `zenoh://HOST:PORT/TOPIC?domain=N`.

use autosplats_cloud::{Error, one_line};

/// Names of the ROS topics of moving and of fixed transforms.
pub(super) const TRANSFORM_TOPICS: [&str; 2] = ["tf", "tf_static"];
/// Prefix of an address of live points.
pub(super) const PREFIX: &str = "zenoh://";
/// Form of an address, for messages.
const ADDRESS_FORM: &str = "zenoh://HOST:PORT/TOPIC?domain=N, where HOST, :PORT and ?domain=N may be left out";
/// Default port of Zenoh routers.
const PORT: u16 = 7447;
/// Type of PointCloud2 messages in the keys of rmw_zenoh.
pub(super) const POINTS_TYPE: &str = "sensor_msgs::msg::dds_::PointCloud2_";

/// Type of messages of transforms in the keys of rmw_zenoh.
const TRANSFORMS_TYPE: &str = "tf2_msgs::msg::dds_::TFMessage_";

/// A parsed address.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Address {
    /// The address as given.
    pub(super) url: String,
    /// Name or IP address of the machine, and its port; `None` to search the local network.
    pub(super) host: Option<(String, u16)>,
    /// Topic without a leading slash; empty if none is named.
    pub(super) topic: String,
    /// ROS domain; `None` for any.
    pub(super) domain: Option<u32>,
}

impl Address {
    pub(super) fn parse(url: &str) -> Result<Self, Error> {
        let bad = |what: String| Error::Remote { address: one_line(url), what };
        let rest = url.strip_prefix(PREFIX).ok_or_else(|| bad(format!("the address must be {ADDRESS_FORM}")))?;
        let (rest, query) = rest.split_once('?').map_or((rest, None), |(rest, query)| (rest, Some(query)));
        let domain = match query.map(|query| query.strip_prefix("domain=").and_then(|number| number.parse().ok())) {
            Some(None) => {
                return Err(bad("only domain=N may follow the question mark, as in ?domain=0".into()));
            }
            Some(domain) => domain,
            None => None,
        };
        let (authority, topic) = rest.split_once('/').unwrap_or((rest, ""));
        let topic = topic.trim_matches('/');
        let host = if authority.is_empty() {
            None
        } else {
            Some(host(authority).ok_or_else(|| bad(format!("'{authority}' is no host; the form is {ADDRESS_FORM}")))?)
        };
        if topic.contains(char::is_control) {
            return Err(bad("the name of a topic must not contain control characters".into()));
        }
        if let Err(error) = zenoh::key_expr::KeyExpr::new(if topic.is_empty() { "**" } else { topic }) {
            let why = one_line(&error.to_string());
            return Err(bad(format!("'{topic}' is neither the name of a topic nor a pattern with * and **: {why}")));
        }
        Ok(Self { url: url.into(), host, topic: topic.into(), domain })
    }

    /// The endpoint that Zenoh connects to.
    pub(super) fn endpoint(&self) -> Option<String> {
        self.host.as_ref().map(|(host, port)| format!("tcp/{host}:{port}"))
    }

    /// Whether several topics may match.
    pub(super) fn is_pattern(&self) -> bool {
        self.topic.contains('*')
    }

    /// The topic as ROS writes it.
    pub(super) fn shown_topic(&self) -> String {
        format!("/{}", self.topic)
    }

    /// The domain as a component of a key.
    pub(super) fn domain_key(&self) -> String {
        self.domain.map_or_else(|| "*".into(), |domain| domain.to_string())
    }

    /// The keys to subscribe to for points of the topic: that of rmw_zenoh with the type, and the bare name of the
    /// bridge. A pattern of bare names would match messages of all types; declarations of publishers give those names.
    pub(super) fn keys(&self) -> Vec<String> {
        let Self { topic, .. } = self;
        let typed = format!("{}/{topic}/{POINTS_TYPE}/*", self.domain_key());
        if self.is_pattern() { vec![typed] } else { vec![typed, topic.clone()] }
    }

    /// The keys of transforms for the topic, in both forms: beside the topic and in all namespaces around it, up to the
    /// first wildcard. Empty without a topic.
    pub(super) fn transform_keys(&self) -> Vec<String> {
        let domain = self.domain_key();
        let named = |name: String| [format!("{domain}/{name}/{TRANSFORMS_TYPE}/*"), name];
        let names =
            self.namespaces().into_iter().flat_map(|space| TRANSFORM_TOPICS.map(|name| format!("{space}{name}")));
        names.flat_map(named).collect()
    }

    /// The keys to query for fixed transforms sent before the subscription, since ROS has publishers keep them.
    /// `rmw_zenoh` and the bridge, from 1.3 on, use the cache of Zenoh's advanced publisher. Older versions use a cache
    /// whose queries have the session before the key, and the bridge adds a prefix of its own.
    pub(super) fn history_keys(&self) -> Vec<String> {
        let domain = self.domain_key();
        let [_, fixed] = TRANSFORM_TOPICS;
        let asked = |space: String| {
            let (bare, typed) = (format!("{space}{fixed}"), format!("{domain}/{space}{fixed}/{TRANSFORMS_TYPE}/*"));
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

    /// Prefixes of topic names in the namespaces that contain the topic: empty, then `robot/`, and so on.
    fn namespaces(&self) -> Vec<String> {
        if self.topic.is_empty() {
            return Vec::new();
        }
        let plain = &self.topic[..self.topic.find('*').unwrap_or(self.topic.len())];
        let slashes = plain.match_indices('/').map(|(at, _)| plain[..=at].to_owned());
        std::iter::once(String::new()).chain(slashes).collect()
    }
}

/// Parses host and port. IPv6 addresses are in brackets.
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
