//! What can go wrong between here and a file, whether it may pass, and what to do about it.

use std::error::Error as _;
use std::io::{self, ErrorKind};
use std::time::Duration;

use autosplats_cloud::{Error, printable};
use rustls::CertificateError;
use ureq::Timeout;
use ureq::http::{HeaderMap, StatusCode};

use crate::content_range::text;

/// Why a request failed.
#[derive(Debug)]
pub(crate) enum Fault {
    /// The fault would be the same the next time: what it is, and the remedy.
    Final(String),
    /// The fault may pass: what it is, and the wait before the next try.
    Passing(String, Wait),
    /// No fault of the server.
    Error(Error),
}

/// Wait before the next try.
#[derive(Debug)]
pub(crate) enum Wait {
    /// No wait: something else is asked for.
    None,
    /// The usual wait.
    Usual,
    /// The usual wait, and no further try: each lasts as long as a time limit.
    Once,
    /// As the server says.
    Told(Duration),
}

impl From<Error> for Fault {
    fn from(error: Error) -> Self {
        Self::Error(error)
    }
}

impl Fault {
    pub(crate) fn last(what: impl Into<String>) -> Self {
        Self::Final(what.into())
    }

    /// The file is another one than that which was opened.
    pub(crate) fn changed() -> Self {
        Self::last("the file changed while it was read; open it again")
    }

    /// A fault of the connection to `peer`. `answered` tells whether it has answered before. The limits are those of
    /// connecting and of waiting.
    pub(crate) fn of_connection(error: ureq::Error, peer: &str, answered: bool, limits: [Duration; 2]) -> Self {
        let [connect, idle] = limits.map(|limit| limit.as_secs_f32());
        match error {
            ureq::Error::Timeout(Timeout::Resolve | Timeout::Connect) => Self::Passing(
                format!("no connection to {peer} within {connect} s; check the address and the network"),
                Wait::Once,
            ),
            ureq::Error::Timeout(_) => Self::Passing(format!("the server sends nothing for {idle} s"), Wait::Once),
            ureq::Error::HostNotFound => unknown_host(peer),
            ureq::Error::Rustls(error) => encryption(&error),
            ureq::Error::Io(error) => of_system(&error, peer, answered),
            ureq::Error::ConnectProxyFailed(why) => {
                let why = printable(&why);
                let remedy =
                    if why.contains("407") { "put name and password into that variable" } else { "ask its owner" };
                Self::Final(format!("{peer} does not let it through ({why}); {remedy}"))
            }
            ureq::Error::LargeResponseHeader(..) => {
                Self::last("the server sends headers without an end; tell its owner")
            }
            ureq::Error::Protocol(_) => Self::Final(format!("what answers at {peer} is no HTTP; check the address")),
            ureq::Error::BadUri(_) | ureq::Error::Http(_) => Self::last("it is no address that can be asked for"),
            other => Self::Final(format!("the request failed: {}; try again", printable(&other.to_string()))),
        }
    }

    /// The fault that a status means. `signed` tells whether the request was signed.
    pub(crate) fn of_status(status: StatusCode, headers: &HeaderMap, code: Option<&str>, signed: bool) -> Self {
        let code = code.map(|code| format!(", {code}")).unwrap_or_default();
        let what = format!("the server answers {}{code}", status.as_u16());
        let remedy = match status.as_u16() {
            401 => "it asks who you are; give --header 'Authorization: …'",
            403 if signed => "these credentials may not read it, or there is no such file; check the AWS_ variables",
            403 => "it may not be read; a signed address may have expired, else give credentials",
            404 | 410 => "there is no such file; check the address",
            408 | 429 | 500 | 502 | 503 | 504 => {
                let seconds = text(headers, "retry-after").and_then(|value| value.parse().ok());
                let wait = seconds.map_or(Wait::Usual, |seconds| Wait::Told(Duration::from_secs(seconds)));
                return Self::Passing(what, wait);
            }
            _ => "check the address",
        };
        Self::Final(format!("{what}: {remedy}"))
    }
}

fn unknown_host(peer: &str) -> Fault {
    let host = peer.rsplit_once(", port").map_or(peer, |(host, _)| host);
    Fault::Final(format!("{host} is not found; check the address and the network"))
}

fn of_system(error: &io::Error, peer: &str, answered: bool) -> Fault {
    let inner = error.get_ref().and_then(|inner| inner.downcast_ref::<rustls::Error>());
    if let Some(inner) = inner {
        return encryption(inner);
    }
    match error.kind() {
        ErrorKind::ConnectionRefused if answered => {
            Fault::Passing(format!("{peer} takes no connections any more"), Wait::Usual)
        }
        ErrorKind::ConnectionRefused => {
            Fault::Final(format!("nobody answers at {peer}; check the address, and that the server runs"))
        }
        ErrorKind::HostUnreachable | ErrorKind::NetworkUnreachable | ErrorKind::NetworkDown => {
            Fault::Passing(format!("{peer} cannot be reached; check the network"), Wait::Once)
        }
        // The standard library has no kind for it.
        _ if error.to_string().contains("lookup address") => unknown_host(peer),
        _ => Fault::Passing("the connection broke off".into(), Wait::Usual),
    }
}

fn encryption(error: &rustls::Error) -> Fault {
    match error {
        rustls::Error::InvalidCertificate(fault) => {
            let why = match fault {
                CertificateError::Expired | CertificateError::ExpiredContext { .. } => "it has expired".to_owned(),
                CertificateError::NotValidForName | CertificateError::NotValidForNameContext { .. } => {
                    "it is for another host".to_owned()
                }
                CertificateError::UnknownIssuer => "no authority known here has issued it".to_owned(),
                other => printable(&other.to_string()),
            };
            let remedy = "a private authority must be one of the system's, or in the file that SSL_CERT_FILE names";
            Fault::Final(format!("the server's certificate is not trusted: {why}; {remedy}"))
        }
        rustls::Error::General(why) if why.contains("No CA certificates") => {
            Fault::last("this system has no certificates of authorities; install them (ca-certificates)")
        }
        other => {
            let source = other.source().map(|source| format!(": {source}")).unwrap_or_default();
            let why = printable(&format!("{other}{source}"));
            Fault::Final(format!("no encrypted connection: {why}; check the address, which may be an http:// one"))
        }
    }
}
