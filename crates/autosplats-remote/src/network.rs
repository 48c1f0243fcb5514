//! Connections, and one request and its answer.

use std::fmt;
use std::io::Read as _;
use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use autosplats_cloud::{Traffic, printable};
use ureq::http::Response;
use ureq::tls::{Certificate, RootCerts, TlsConfig};
use ureq::{Agent, Body};
use url::Url;

use crate::address::Address;
use crate::batch::{AT_ONCE, Gate};
use crate::content_range::{compression, length, text};
use crate::fault::{Fault, Wait};
use crate::kept::Kept;
use crate::options::{Header, RemoteOptions};
use crate::patience::{Patience, Stop};
use crate::proxies::Route;

/// Most redirects of one request.
const MOST_REDIRECTS: usize = 10;

/// Bytes of a body that are read at once.
const BLOCK: usize = 64 << 10;

/// Bytes that are read of the explanation of an error.
const EXPLANATION: u64 = 4 << 10;

/// What all files and folders of a client share.
pub(crate) struct Network {
    agent: Agent,
    pub(crate) options: RemoteOptions,
    pub(crate) gate: Arc<Gate>,
    pub(crate) kept: Kept,
}

/// What was received of one file or folder.
#[derive(Debug, Default)]
pub(crate) struct Received {
    answers: AtomicU64,
    requests: AtomicU64,
    bytes: AtomicU64,
}

/// A file to request, and where redirects led.
#[derive(Debug)]
pub(crate) struct Target {
    pub(crate) address: Address,
    pub(crate) received: Arc<Received>,
    moved: Mutex<Option<Url>>,
}

/// What to request of a file.
pub(crate) enum Ask<'a> {
    /// Bytes, of that version whose tag is given.
    Part(Range<u64>, Option<&'a str>),
    /// The whole file, which may come compressed.
    Whole,
}

impl fmt::Debug for Network {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Network").field("options", &self.options).finish_non_exhaustive()
    }
}

impl Received {
    pub(crate) fn traffic(&self) -> Traffic {
        Traffic { requests: self.requests.load(Ordering::Relaxed), bytes: self.bytes.load(Ordering::Relaxed) }
    }
}

impl Target {
    pub(crate) fn new(address: Address, received: Arc<Received>) -> Self {
        Self { address, received, moved: Mutex::new(None) }
    }

    fn moved(&self, set: impl FnOnce(&mut Option<Url>)) -> Option<Url> {
        let mut moved = self.moved.lock().unwrap_or_else(PoisonError::into_inner);
        set(&mut moved);
        moved.clone()
    }
}

impl Network {
    pub(crate) fn new(options: RemoteOptions) -> Self {
        let authorities = match &options.authorities {
            Some(ders) => {
                let certificates: Vec<_> = ders.iter().map(|der| Certificate::from_der(der).to_owned()).collect();
                RootCerts::new_with_certs(&certificates)
            }
            None => RootCerts::PlatformVerifier,
        };
        let provider = Arc::new(rustls::crypto::ring::default_provider());
        let tls = TlsConfig::builder().unversioned_rustls_crypto_provider(provider).root_certs(authorities).build();
        let config = Agent::config_builder()
            .http_status_as_error(false)
            // Redirects are followed here: `ureq` would send the user's headers along.
            .max_redirects(0)
            .proxy(None)
            .user_agent(concat!("autosplats/", env!("CARGO_PKG_VERSION")))
            .tls_config(tls)
            .timeout_resolve(Some(options.connect_timeout))
            .timeout_connect(Some(options.connect_timeout))
            .timeout_per_read(Some(options.idle_timeout))
            .timeout_per_write(Some(options.idle_timeout))
            .max_idle_connections(AT_ONCE)
            .max_idle_connections_per_host(AT_ONCE)
            .build();
        let kept = Kept::new(options.cache);
        Self { agent: config.new_agent(), options, gate: Arc::default(), kept }
    }

    pub(crate) fn patience<'a>(&self, target: &'a Target, stop: &'a Stop) -> Patience<'a> {
        Patience::new(target.address.shown(), self.options.retry_wait, stop)
    }

    /// Requests a file, wherever redirects lead. The answer's status is 200, 206 or 416.
    pub(crate) fn get(&self, target: &Target, ask: &Ask<'_>) -> Result<Response<Body>, Fault> {
        let mut home = target.address.url();
        let remembered = target.moved(|_| ());
        let mut url = remembered.clone().unwrap_or_else(|| home.clone());
        for _ in 0..=MOST_REDIRECTS {
            let at_home = url.origin() == home.origin();
            let mut response = self.send(target, &url, at_home, ask)?;
            let (status, headers) = (response.status(), response.headers());
            let region = text(headers, "x-amz-bucket-region").filter(|_| !status.is_success());
            if region.is_some_and(|region| target.address.set_region(region)) {
                home = target.address.url();
                url = home.clone();
                continue;
            }
            match status.as_u16() {
                301 | 302 | 303 | 307 | 308 => url = next(&url, text(headers, "location"))?,
                200 | 206 | 416 => {
                    if url != home && remembered.as_ref() != Some(&url) && !target.address.is_signed() {
                        target.moved(|moved| *moved = Some(url));
                    }
                    return Ok(response);
                }
                401 | 403 | 404 | 410 if remembered.is_some() => {
                    // Where a redirect led may be valid for a while only.
                    target.moved(|moved| *moved = None);
                    return Err(Fault::Passing("where it redirects to, it is not found".into(), Wait::None));
                }
                401 | 403 if !at_home && !self.options.headers.is_empty() => {
                    let host = printable(url.host_str().unwrap_or_default());
                    return Err(Fault::Final(format!(
                        "it redirects to {host}, which answers {} and gets no headers; give the address there",
                        status.as_u16()
                    )));
                }
                _ => {
                    let mut body = Vec::new();
                    // It is only an explanation.
                    let _ = response.body_mut().as_reader().take(EXPLANATION).read_to_end(&mut body);
                    let signed = target.address.is_signed();
                    return Err(Fault::of_status(status, response.headers(), code(&body).as_deref(), signed));
                }
            }
        }
        Err(Fault::Final(format!("it redirects more than {MOST_REDIRECTS} times; check the address")))
    }

    fn send(&self, target: &Target, url: &Url, at_home: bool, ask: &Ask<'_>) -> Result<Response<Body>, Fault> {
        let mut request = self.agent.get(url.as_str());
        let Route { proxy, peer } = self.route(url)?;
        if proxy.is_some() {
            request = request.config().proxy(proxy).build();
        }
        if at_home {
            let own = target.address.authorization().filter(|_| !self.options.headers.iter().any(Header::authorizes));
            request = own.into_iter().fold(request, |request, own| request.header("Authorization", own));
            for header in &self.options.headers {
                request = request.header(&header.name, &header.value);
            }
        }
        match ask {
            Ask::Part(range, tag) => {
                request = request.header("Range", format!("bytes={}-{}", range.start, range.end - 1));
                request = request.header("Accept-Encoding", "identity");
                if let Some(tag) = tag {
                    request = request.header("If-Range", *tag);
                }
            }
            Ask::Whole => request = request.header("Accept-Encoding", "gzip"),
        }
        target.received.requests.fetch_add(1, Ordering::Relaxed);
        let response = request.call().map_err(|error| self.broken(error, target, &peer))?;
        target.received.answers.fetch_add(1, Ordering::Relaxed);
        Ok(response)
    }

    fn route(&self, url: &Url) -> Result<Route, Fault> {
        let wrong = |variable| {
            Fault::Final(format!("{variable} is no address of a proxy, such as http://host:8080; set it anew"))
        };
        self.options.proxies.route(url).map_err(wrong)
    }

    fn broken(&self, error: ureq::Error, target: &Target, peer: &str) -> Fault {
        let limits = [self.options.connect_timeout, self.options.idle_timeout];
        Fault::of_connection(error, peer, target.received.answers.load(Ordering::Relaxed) > 0, limits)
    }

    /// Appends the body of an answer to `bytes`, which keep what arrived before a fault. Whether it ended before
    /// `bytes` became longer than `most`.
    pub(crate) fn body(
        &self,
        mut response: Response<Body>,
        target: &Target,
        bytes: &mut Vec<u8>,
        most: u64,
        stop: &Stop,
    ) -> Result<bool, Fault> {
        let mut reader = response.body_mut().as_reader();
        let mut block = vec![0; BLOCK];
        loop {
            stop.check()?;
            let read = reader.read(&mut block).map_err(|error| self.broken(error.into(), target, "the server"))?;
            target.received.bytes.fetch_add(read as u64, Ordering::Relaxed);
            if read == 0 {
                return Ok(true);
            }
            if (bytes.len() + read) as u64 > most {
                return Ok(false);
            }
            bytes.extend_from_slice(&block[..read]);
        }
    }
}

/// Fails for an answer whose bytes are not those of the file.
pub(crate) fn check_plain(response: &Response<Body>) -> Result<(), Fault> {
    match compression(response.headers()) {
        None => Ok(()),
        Some(_) => Err(Fault::last("the server compresses it, so that it has no parts; have it stored as it is")),
    }
}

/// Whether an answer says that it has more than `most` bytes.
pub(crate) fn announces_more(response: &Response<Body>, most: u64) -> bool {
    length(response.headers()).is_some_and(|length| length > most)
}

fn next(url: &Url, location: Option<&str>) -> Result<Url, Fault> {
    let location = location.ok_or_else(|| Fault::last("it redirects without saying where to; check the address"))?;
    let next = url.join(location).ok().filter(|next| matches!(next.scheme(), "http" | "https") && next.has_host());
    next.ok_or_else(|| Fault::last("it redirects to what is no http or https address; check the address"))
}

/// The code by which object stores explain an error.
fn code(body: &[u8]) -> Option<String> {
    let body = String::from_utf8_lossy(body);
    let (code, _) = body.split_once("<Code>")?.1.split_once("</Code>")?;
    let plain = code.len() <= 60 && code.bytes().all(|byte| byte.is_ascii_alphanumeric());
    (plain && !code.is_empty()).then(|| code.to_owned())
}
