//! Addresses as the user gives them, as they are requested, and as they are shown.

use std::fmt;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use autosplats_cloud::{Error, one_line};
use base64::Engine as _;
use base64::prelude::BASE64_STANDARD;
use percent_encoding::percent_decode_str;
use rusty_s3::actions::GetObject;
use rusty_s3::{Bucket, S3Action as _, UrlStyle};
use url::Url;

use crate::options::RemoteOptions;

const SCHEMES: [&str; 5] = ["http", "https", "s3", "gs", "az"];

/// How long a signed request is valid. It is signed when it is sent.
const SIGNED_FOR: Duration = Duration::from_secs(3600);

/// The region that servers take for granted.
const USUAL_REGION: &str = "us-east-1";

/// The scheme of an address, if it is one of ours.
pub(crate) fn scheme_of(name: &str) -> Option<&'static str> {
    let (scheme, _) = name.split_once("://")?;
    SCHEMES.into_iter().find(|known| scheme.eq_ignore_ascii_case(known))
}

/// Address of a file.
pub(crate) struct Address {
    place: Place,
    shown: String,
}

enum Place {
    /// An address without name and password, and the header that they are sent in.
    Web(Url, Option<String>),
    Store {
        bucket: Mutex<Bucket>,
        credentials: Option<rusty_s3::Credentials>,
        key: String,
    },
}

impl fmt::Debug for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.shown)
    }
}

impl Address {
    /// Parses an address.
    ///
    /// # Errors
    /// [`Error::Remote`].
    pub(crate) fn parse(text: &str, options: &RemoteOptions) -> Result<Self, Error> {
        let shown = shown(text);
        let place = place(text, options).map_err(|what| Error::Remote { address: shown.clone(), what })?;
        Ok(Self { place, shown })
    }

    /// The address without what may be secret: the values of its query, and a password.
    pub(crate) fn shown(&self) -> &str {
        &self.shown
    }

    /// The address to request, signed if there are credentials.
    pub(crate) fn url(&self) -> Url {
        match &self.place {
            Place::Web(url, _) => url.clone(),
            Place::Store { bucket, credentials, key } => {
                let bucket = bucket.lock().unwrap_or_else(PoisonError::into_inner);
                GetObject::new(&bucket, credentials.as_ref(), key).sign(SIGNED_FOR)
            }
        }
    }

    /// The header `Authorization` of the name and password in the address.
    pub(crate) fn authorization(&self) -> Option<&str> {
        match &self.place {
            Place::Web(_, authorization) => authorization.as_deref(),
            Place::Store { .. } => None,
        }
    }

    /// Whether requests are signed.
    pub(crate) fn is_signed(&self) -> bool {
        matches!(&self.place, Place::Store { credentials: Some(_), .. })
    }

    /// Takes over the region that a bucket of Amazon's says to be in. Whether that is news.
    pub(crate) fn set_region(&self, region: &str) -> bool {
        let Place::Store { bucket, .. } = &self.place else { return false };
        let mut bucket = bucket.lock().unwrap_or_else(PoisonError::into_inner);
        let amazons = bucket.base_url().host_str().is_some_and(|host| host.ends_with(".amazonaws.com"));
        let plain = region.bytes().all(|byte| byte.is_ascii_alphanumeric() || byte == b'-') && region.len() < 40;
        match amazon(bucket.name(), Some(region)) {
            Ok(moved) if amazons && plain && *bucket != moved => {
                *bucket = moved;
                true
            }
            _ => false,
        }
    }

    /// The address of a file below the folder of this one.
    pub(crate) fn file(&self, name: &str) -> Self {
        let beside = |path: &str| path[..path.rfind('/').map_or(0, |at| at + 1)].to_owned() + name;
        let shown = match self.shown.strip_suffix("?…") {
            Some(path) => format!("{}?…", beside(path)),
            None => beside(&self.shown),
        };
        let place = match &self.place {
            Place::Web(url, authorization) => {
                let mut url = url.clone();
                if let Ok(mut path) = url.path_segments_mut() {
                    path.pop().extend(name.split('/'));
                }
                Place::Web(url, authorization.clone())
            }
            Place::Store { bucket, credentials, key } => {
                let bucket = bucket.lock().unwrap_or_else(PoisonError::into_inner).clone();
                Place::Store { bucket: Mutex::new(bucket), credentials: credentials.clone(), key: beside(key) }
            }
        };
        Self { place, shown: one_line(&shown) }
    }

    /// The folder of this address, as it is shown.
    pub(crate) fn folder(&self) -> String {
        self.file("").shown
    }
}

fn place(text: &str, options: &RemoteOptions) -> Result<Place, String> {
    let scheme = scheme_of(text).ok_or("an address begins with http://, https://, s3://, gs:// or az://")?;
    if matches!(scheme, "http" | "https") {
        let mut url = Url::parse(text).map_err(|error| format!("it is no address: {error}"))?;
        let authorization = basic(&url);
        // Neither fails for an address with a host, which these are.
        let _ = (url.set_username(""), url.set_password(None));
        url.set_fragment(None);
        return Ok(Place::Web(url, authorization));
    }
    let (_, rest) = text.split_once("://").unwrap_or_default();
    let form = || format!("the form is {scheme}://BUCKET/NAME");
    let (name, key) =
        rest.split_once('/').filter(|(name, key)| !name.is_empty() && !key.is_empty()).ok_or_else(form)?;
    if key.split('/').any(|part| part == "." || part == "..") {
        return Err("names with '.' or '..' cannot be asked for".into());
    }
    let store = |endpoint: &str, name: &str, key: &str, credentials| {
        let region = options.region.as_deref().unwrap_or(USUAL_REGION).to_owned();
        let bucket = bucket(endpoint, UrlStyle::Path, name, region)?;
        Ok(Place::Store { bucket: Mutex::new(bucket), credentials, key: key.to_owned() })
    };
    let credentials = options.credentials.as_ref().map(|own| {
        let (key, secret) = (own.key.clone(), own.secret.0.clone());
        match &own.token {
            Some(token) => rusty_s3::Credentials::new_with_token(key, secret, token.0.clone()),
            None => rusty_s3::Credentials::new(key, secret),
        }
    });
    match (scheme, &options.s3_endpoint) {
        ("s3", Some(endpoint)) => store(endpoint, name, key, credentials),
        ("s3", None) => {
            // Only the address without a region finds the bucket of any, but it takes no signatures for others.
            let region = options.region.as_deref().or(credentials.is_some().then_some(USUAL_REGION));
            Ok(Place::Store { bucket: Mutex::new(amazon(name, region)?), credentials, key: key.to_owned() })
        }
        ("gs", _) => store("https://storage.googleapis.com", name, key, None),
        _ if name.contains('.') => {
            let (container, key) = key.split_once('/').ok_or("the form is az://ACCOUNT_HOST/CONTAINER/NAME")?;
            store(&format!("https://{name}"), container, key, None)
        }
        _ => {
            let account = options.azure_account.as_deref();
            let account = account.ok_or("set AZURE_STORAGE_ACCOUNT to the account that the container belongs to")?;
            store(&format!("https://{account}.blob.core.windows.net"), name, key, None)
        }
    }
}

/// The header of the name and password in an address.
fn basic(url: &Url) -> Option<String> {
    let decoded = |text: &str| percent_decode_str(text).collect::<Vec<u8>>();
    let both = [decoded(url.username()), decoded(url.password().unwrap_or_default())];
    (both != [[]; 2]).then(|| format!("Basic {}", BASE64_STANDARD.encode(both.join(&b':'))))
}

/// A bucket of Amazon's.
fn amazon(name: &str, region: Option<&str>) -> Result<Bucket, String> {
    // Other names are not covered by the certificates if they are part of the host.
    let in_host = name.bytes().all(|byte| byte.is_ascii_lowercase() || byte.is_ascii_digit() || byte == b'-');
    let style = if in_host { UrlStyle::VirtualHost } else { UrlStyle::Path };
    let endpoint = match region {
        Some(region) => format!("https://s3.{region}.amazonaws.com"),
        None => "https://s3.amazonaws.com".to_owned(),
    };
    bucket(&endpoint, style, name, region.unwrap_or(USUAL_REGION).to_owned())
}

fn bucket(endpoint: &str, style: UrlStyle, name: &str, region: String) -> Result<Bucket, String> {
    let fail = |why: &str| format!("its server '{}' cannot be asked: {why}", one_line(&shown(endpoint)));
    let url = Url::parse(endpoint).map_err(|error| fail(&error.to_string()))?;
    Bucket::new(url, style, name.to_owned(), region).map_err(|error| fail(&error.to_string()))
}

/// An address without what may be secret.
fn shown(text: &str) -> String {
    let (path, rest) = text.split_at(text.find(['?', '#']).unwrap_or(text.len()));
    let (scheme, path) = path.split_once("://").unwrap_or(("", path));
    let (host, file) = path.split_at(path.find('/').unwrap_or(path.len()));
    let host = host.rsplit_once('@').map_or(host, |(_, host)| host);
    let colon = if scheme.is_empty() { "" } else { "://" };
    one_line(&format!("{scheme}{colon}{host}{file}{}", if rest.starts_with('?') { "?…" } else { "" }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::options::{Credentials, Secret};

    fn url(text: &str, options: &RemoteOptions) -> String {
        Address::parse(text, options).map_or_else(|error| error.to_string(), |address| address.url().into())
    }

    #[test]
    fn stores_are_reached_by_https() {
        let none = RemoteOptions::default();
        let known =
            RemoteOptions { region: Some("eu-west-1".into()), azure_account: Some("me".into()), ..none.clone() };
        let own = RemoteOptions { s3_endpoint: Some("http://127.0.0.1:9000".into()), ..none.clone() };
        let cases = [
            (&none, "HTTPS://host/a%20b?x=1", "https://host/a%20b?x=1"),
            (&none, "s3://bucket/a/b c+d#.laz", "https://bucket.s3.amazonaws.com/a/b%20c%2Bd%23.laz"),
            (&none, "s3://dotted.bucket/a", "https://s3.amazonaws.com/dotted.bucket/a"),
            (&known, "s3://bucket/a", "https://bucket.s3.eu-west-1.amazonaws.com/a"),
            (&own, "s3://bucket/a", "http://127.0.0.1:9000/bucket/a"),
            (&none, "gs://bucket/a", "https://storage.googleapis.com/bucket/a"),
            (&known, "az://container/a", "https://me.blob.core.windows.net/container/a"),
            (&none, "az://me.blob.core.windows.net/c/a", "https://me.blob.core.windows.net/c/a"),
        ];
        for (options, given, wanted) in cases {
            assert_eq!(url(given, options), wanted, "{given}");
        }
        let refused = [
            ("s3://bucket", "the form is s3://BUCKET/NAME"),
            ("gs:///a", "the form is gs://BUCKET/NAME"),
            ("s3://bucket/a/../b", "names with '.' or '..' cannot be asked for"),
            ("az://container/a", "set AZURE_STORAGE_ACCOUNT to the account that the container belongs to"),
            ("http://", "it is no address: empty host"),
        ];
        for (given, what) in refused {
            assert_eq!(url(given, &none), format!("{given}: {what}"));
        }
    }

    #[test]
    fn requests_are_signed_for_the_region_that_the_bucket_is_in() {
        let credentials = Credentials { key: "ID".into(), secret: Secret("hidden".into()), token: None };
        let options = RemoteOptions { credentials: Some(credentials), ..RemoteOptions::default() };
        let address = Address::parse("s3://bucket/a", &options).expect("an address");
        let scope = |region: &str| {
            let url = address.url();
            let query = url.query().unwrap_or_default();
            assert!(url.host_str() == Some(&format!("bucket.s3.{region}.amazonaws.com")), "{url}");
            assert!(query.contains("X-Amz-Credential=ID%2F") && query.contains("X-Amz-Signature="), "{url}");
            assert!(query.contains(&format!("%2F{region}%2Fs3%2Faws4_request")), "{url}");
        };
        scope("us-east-1");
        assert!(url("s3://eu-west-1/a", &options).starts_with("https://eu-west-1.s3.us-east-1.amazonaws.com/a?"));
        assert!(!address.set_region("us-east-1") && !address.set_region("a.evil.host"), "no other region");
        assert!(address.set_region("eu-central-1"), "another region");
        scope("eu-central-1");
        assert!(url("gs://bucket/a", &options).ends_with("/bucket/a"), "signed for no other store");
    }

    #[test]
    fn secrets_are_not_shown() {
        assert_eq!(shown("https://host/a.laz?X-Amz-Signature=abc#x"), "https://host/a.laz?…");
        assert_eq!(shown("https://me:hidden@host/a@b"), "https://host/a@b");
        assert_eq!(shown("https://host/a\nb"), "https://host/a b");
        assert_eq!(shown("https://host?a/b"), "https://host?…");
    }

    #[test]
    fn files_stand_beside_each_other_and_keep_the_query() {
        let none = RemoteOptions::default();
        let file = |text: &str, name: &str| {
            let file = Address::parse(text, &none).expect("an address").file(name);
            (String::from(file.url()), file.shown().to_owned())
        };
        let both = |one: &str, other: &str| (one.to_owned(), other.to_owned());
        assert_eq!(file("http://h/a/ept.json?s=1", "d/0 1"), both("http://h/a/d/0%201?s=1", "http://h/a/d/0 1?…"));
        assert_eq!(file("http://h/a/", "b"), both("http://h/a/b", "http://h/a/b"));
        assert_eq!(file("http://h/a/", "../b"), both("http://h/a/b", "http://h/a/../b"));
        assert_eq!(file("s3://bucket/ept.json", "d/0"), both("https://bucket.s3.amazonaws.com/d/0", "s3://bucket/d/0"));
    }
}
