//! Options of remote files, and what the environment says of them.

use std::fmt;
use std::str::FromStr;
use std::time::Duration;

use ureq::http::header::AUTHORIZATION;
use ureq::http::{HeaderName, HeaderValue};

use crate::proxies::Proxies;

/// Headers that requests set themselves.
const OWN_HEADERS: [&str; 9] = [
    "accept-encoding",
    "connection",
    "content-length",
    "expect",
    "host",
    "if-range",
    "range",
    "te",
    "transfer-encoding",
];

/// Options of remote files.
#[derive(Clone, Debug)]
pub struct RemoteOptions {
    /// Headers sent with each request, but to no other host that a redirect leads to.
    pub headers: Vec<Header>,
    /// Longest wait for a name or a connection. Default 10 s.
    pub connect_timeout: Duration,
    /// Longest wait for an answer, and for the next bytes of one. Default 30 s.
    pub idle_timeout: Duration,
    /// Wait before a request is tried again. Each further wait is twice as long. Default 250 ms.
    pub retry_wait: Duration,
    /// Bytes of all files together that are kept in memory. Default 64 MB.
    pub cache: u64,
    /// Credentials that sign requests to `s3://` addresses. Default `None`: unsigned, for public buckets.
    pub credentials: Option<Credentials>,
    /// Region of buckets. Default `None`: asked of the server.
    pub region: Option<String>,
    /// Address of a server that speaks S3, for `s3://` addresses. Default `None`: Amazon's.
    pub s3_endpoint: Option<String>,
    /// Storage account of `az://` addresses.
    pub azure_account: Option<String>,
    /// Certificates of authorities, in DER. Default `None`: those of the system.
    pub authorities: Option<Vec<Vec<u8>>>,
    /// Proxies. Default: none.
    pub proxies: Proxies,
}

impl Default for RemoteOptions {
    fn default() -> Self {
        Self {
            headers: Vec::new(),
            connect_timeout: Duration::from_secs(10),
            idle_timeout: Duration::from_secs(30),
            retry_wait: Duration::from_millis(250),
            cache: 64 << 20,
            credentials: None,
            region: None,
            s3_endpoint: None,
            azure_account: None,
            authorities: None,
            proxies: Proxies::default(),
        }
    }
}

impl RemoteOptions {
    /// Default options with the proxies and credentials of the usual environment variables: `HTTPS_PROXY`,
    /// `HTTP_PROXY`, `ALL_PROXY`, `NO_PROXY`, those of AWS and `AZURE_STORAGE_ACCOUNT`.
    pub fn from_environment() -> Self {
        Self::from_variables(&|name| std::env::var(name).ok())
    }

    /// Default options with what `variable` says of environment variables.
    pub fn from_variables(variable: &dyn Fn(&str) -> Option<String>) -> Self {
        let set = |name: &str| variable(name).filter(|value| !value.trim().is_empty());
        let credentials = set("AWS_ACCESS_KEY_ID").zip(set("AWS_SECRET_ACCESS_KEY"));
        Self {
            credentials: credentials.map(|(key, secret)| Credentials {
                key,
                secret: Secret(secret),
                token: set("AWS_SESSION_TOKEN").map(Secret),
            }),
            region: set("AWS_REGION").or_else(|| set("AWS_DEFAULT_REGION")),
            s3_endpoint: set("AWS_ENDPOINT_URL_S3").or_else(|| set("AWS_ENDPOINT_URL")),
            azure_account: set("AZURE_STORAGE_ACCOUNT"),
            proxies: Proxies::from_variables(&set),
            ..Self::default()
        }
    }
}

/// Text that is not shown.
#[derive(Clone, PartialEq, Eq)]
pub struct Secret(pub String);

impl fmt::Debug for Secret {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("(secret)")
    }
}

/// Credentials for buckets.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Credentials {
    /// Name of the key.
    pub key: String,
    /// The key.
    pub secret: Secret,
    /// Token of credentials that end with a session.
    pub token: Option<Secret>,
}

/// A header of requests, parsed from `NAME: VALUE`.
///
/// ```
/// use autosplats_remote::Header;
///
/// assert!("Authorization: Bearer abc".parse::<Header>().is_ok());
/// assert!("Range: bytes=0-1".parse::<Header>().is_err());
/// ```
#[derive(Clone, PartialEq, Eq)]
pub struct Header {
    pub(crate) name: HeaderName,
    pub(crate) value: HeaderValue,
}

impl Header {
    /// Whether the header says who asks.
    pub(crate) fn authorizes(&self) -> bool {
        self.name == AUTHORIZATION
    }
}

impl fmt::Debug for Header {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: (secret)", self.name)
    }
}

impl FromStr for Header {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let form = || "a header has the form 'NAME: VALUE', such as 'Authorization: Bearer TOKEN'".to_owned();
        let (name, value) = text.split_once(':').ok_or_else(form)?;
        let name = HeaderName::from_bytes(name.trim().as_bytes()).map_err(|_| form())?;
        if OWN_HEADERS.contains(&name.as_str()) {
            return Err(format!("the header '{name}' is set by each request itself"));
        }
        let bad = |_| format!("the value of the header '{name}' has characters that are not allowed");
        let value = HeaderValue::from_str(value.trim()).map_err(bad)?;
        Ok(Self { name, value })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers_are_checked_and_not_shown() {
        let header: Header = "X-Key:  a b ".parse().expect("a header");
        assert_eq!((header.name.as_str(), header.value.as_bytes()), ("x-key", &b"a b"[..]));
        assert_eq!(format!("{header:?}"), "x-key: (secret)");
        for wrong in ["X-Key", ": a", "a b: c", "a: b\r\nc: d", "Host: a", "range: bytes=0-"] {
            assert!(wrong.parse::<Header>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn credentials_come_from_the_environment() {
        let variables = |name: &str| match name {
            "AWS_ACCESS_KEY_ID" => Some("id".into()),
            "AWS_SECRET_ACCESS_KEY" => Some("hidden".into()),
            "AWS_DEFAULT_REGION" => Some("eu-west-1".into()),
            "AWS_SESSION_TOKEN" => Some(" ".into()),
            _ => None,
        };
        let options = RemoteOptions::from_variables(&variables);
        let credentials = options.credentials.as_ref().expect("both are there");
        assert_eq!((credentials.key.as_str(), &credentials.token), ("id", &None));
        assert_eq!(options.region.as_deref(), Some("eu-west-1"));
        assert!(!format!("{options:?}").contains("hidden"), "secrets are not shown");
        let half = |name: &str| variables(name).filter(|_| name != "AWS_SECRET_ACCESS_KEY");
        assert_eq!(RemoteOptions::from_variables(&half).credentials, None, "half of them are none");
    }
}
