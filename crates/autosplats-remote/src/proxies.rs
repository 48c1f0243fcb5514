//! Which requests go through a proxy.

use ureq::Proxy;
use url::{Host, Url};

/// Proxies as environment variables name them.
///
/// They are chosen by the protocol of a request, and this machine is reached without one. `ureq` looks at the same
/// variables, but not at the protocol.
#[derive(Clone, Default)]
pub struct Proxies {
    http: Option<Named>,
    https: Option<Named>,
    /// Hosts that are reached without a proxy.
    direct: Vec<String>,
}

/// How an address is reached.
pub(crate) struct Route {
    pub(crate) proxy: Option<Proxy>,
    /// Who is connected to, for messages.
    pub(crate) peer: String,
}

/// A variable and its value.
type Named = (String, String);

impl std::fmt::Debug for Proxies {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        // Their addresses may hold passwords.
        let shown = |named: &Option<Named>| named.as_ref().map(|(variable, _)| variable.clone());
        write!(f, "http {:?}, https {:?}, not for {:?}", shown(&self.http), shown(&self.https), self.direct)
    }
}

impl Proxies {
    /// The proxies that `variable` names when asked for `HTTPS_PROXY`, `HTTP_PROXY`, `ALL_PROXY` and `NO_PROXY`, in
    /// small letters first.
    pub fn from_variables(variable: &dyn Fn(&str) -> Option<String>) -> Self {
        let first = |names: &[&str]| {
            let both = names.iter().flat_map(|name| [name.to_ascii_lowercase(), (*name).to_owned()]);
            both.filter_map(|name| variable(&name).map(|value| (name, value))).next()
        };
        let direct = first(&["NO_PROXY"]).map(|(_, hosts)| hosts).unwrap_or_default();
        Self {
            http: first(&["HTTP_PROXY", "ALL_PROXY"]),
            https: first(&["HTTPS_PROXY", "ALL_PROXY"]),
            direct: direct.split([',', ' ']).filter(|host| !host.is_empty()).map(str::to_ascii_lowercase).collect(),
        }
    }

    /// How an address is reached; the variable of its proxy if that is not valid.
    pub(crate) fn route(&self, url: &Url) -> Result<Route, String> {
        let chosen = if url.scheme() == "https" { &self.https } else { &self.http };
        let Some((variable, value)) = chosen.as_ref().filter(|_| !self.is_direct(url)) else {
            let port = url.port_or_known_default().unwrap_or_default();
            return Ok(Route { proxy: None, peer: format!("{}, port {port}", url.host_str().unwrap_or_default()) });
        };
        let proxy = Proxy::new(value).map_err(|_| variable.clone())?;
        let peer = format!("the proxy of {variable}, {}, port {}", proxy.host(), proxy.port());
        Ok(Route { proxy: Some(proxy), peer })
    }

    fn is_direct(&self, url: &Url) -> bool {
        let host = url.host_str().unwrap_or_default();
        let here = match url.host() {
            Some(Host::Domain(name)) => name == "localhost" || name.ends_with(".localhost"),
            Some(Host::Ipv4(address)) => address.is_loopback(),
            Some(Host::Ipv6(address)) => address.is_loopback(),
            None => false,
        };
        let port = url.port_or_known_default();
        here || self.direct.iter().any(|entry| {
            let (name, only) = match entry.rsplit_once(':') {
                Some((name, only)) if !name.contains(':') => (name, only.parse().ok()),
                _ => (entry.as_str(), None),
            };
            let name = name.trim_start_matches('*').trim_start_matches('.');
            let below = host.strip_suffix(name).is_some_and(|rest| rest.is_empty() || rest.ends_with('.'));
            (name.is_empty() || below) && (only.is_none() || only == port)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn protocols_and_hosts_choose_the_proxy() {
        let variables = |name: &str| match name {
            "https_proxy" => Some("http://user:hidden@safe:1".into()),
            "HTTPS_PROXY" => Some("http://not-this:1".into()),
            "ALL_PROXY" => Some("socks5h://any:2".into()),
            "NO_PROXY" => Some("example.org, .inside,10.0.0.1:8080".into()),
            _ => None,
        };
        let proxies = Proxies::from_variables(&variables);
        let host = |address: &str| {
            let route = proxies.route(&Url::parse(address).expect("an address")).expect("they are valid");
            route.proxy.map(|proxy| proxy.host().to_owned())
        };
        assert_eq!(host("https://example.com/a").as_deref(), Some("safe"));
        assert_eq!(host("http://example.com/a").as_deref(), Some("any"));
        for direct in ["https://example.org", "http://a.example.org", "http://a.inside", "http://10.0.0.1:8080"] {
            assert_eq!(host(direct), None, "{direct}");
        }
        assert_eq!(host("https://badexample.org").as_deref(), Some("safe"), "not below it");
        assert_eq!(host("http://10.0.0.1").as_deref(), Some("any"), "another port");
        for here in ["http://localhost:1/", "http://127.0.0.2/", "http://[::1]/"] {
            assert_eq!(host(here), None, "{here}");
        }
        assert!(!format!("{proxies:?}").contains("hidden"), "passwords are not shown");
    }

    #[test]
    fn a_proxy_that_is_no_address_is_named_by_its_variable() {
        let proxies = Proxies::from_variables(&|name| (name == "ALL_PROXY").then(|| "gopher://x".into()));
        let wrong = proxies.route(&Url::parse("https://example.org").expect("an address"));
        assert_eq!(wrong.err().as_deref(), Some("ALL_PROXY"));
    }
}
