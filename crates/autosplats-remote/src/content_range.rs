//! What an answer says of the bytes that it holds.

use std::ops::Range;

use ureq::http::HeaderMap;
use ureq::http::header::{CONTENT_ENCODING, CONTENT_LENGTH, CONTENT_RANGE, ETAG, LAST_MODIFIED};

/// Part of a file that an answer holds, and the size of the whole.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct ContentRange {
    pub(crate) part: Range<u64>,
    pub(crate) size: u64,
}

/// Text of a header.
pub(crate) fn text<'a>(headers: &'a HeaderMap, name: &str) -> Option<&'a str> {
    headers.get(name).and_then(|value| value.to_str().ok()).map(str::trim)
}

/// Number of bytes that follow, if it is told.
pub(crate) fn length(headers: &HeaderMap) -> Option<u64> {
    text(headers, CONTENT_LENGTH.as_str())?.parse().ok()
}

/// How the bytes that follow are compressed, if they are.
pub(crate) fn compression(headers: &HeaderMap) -> Option<&str> {
    // Some programs leave the third with what they store at Amazon, where it means nothing.
    let plain = |name: &&str| matches!(*name, "" | "identity" | "aws-chunked");
    text(headers, CONTENT_ENCODING.as_str())?.split(',').map(str::trim).find(|name| !plain(name))
}

impl ContentRange {
    /// The range of `bytes 0-9/100`; `None` if there is none, or not all of it.
    pub(crate) fn of(headers: &HeaderMap) -> Option<Self> {
        let (part, size) = text(headers, CONTENT_RANGE.as_str())?.strip_prefix("bytes")?.trim().split_once('/')?;
        let (first, last) = part.split_once('-')?;
        let (first, last): (u64, u64) = (first.trim().parse().ok()?, last.trim().parse().ok()?);
        let size: u64 = size.trim().parse().ok()?;
        (first <= last && last < size).then(|| Self { part: first..last + 1, size })
    }
}

/// Which version of a file an answer is of.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Version {
    pub(crate) size: u64,
    tag: Option<String>,
    modified: Option<String>,
}

impl Version {
    pub(crate) fn of(headers: &HeaderMap, size: u64) -> Self {
        let owned = |name: &str| text(headers, name).map(str::to_owned);
        Self { size, tag: owned(ETAG.as_str()), modified: owned(LAST_MODIFIED.as_str()) }
    }

    /// The tag, if a server may be asked to compare it.
    pub(crate) fn strong_tag(&self) -> Option<&str> {
        self.tag.as_deref().filter(|tag| tag.starts_with('"'))
    }

    /// Whether two answers are of the same version, as far as both tell.
    pub(crate) fn same(&self, other: &Self) -> bool {
        let bare = |tag: &str| tag.strip_prefix("W/").unwrap_or(tag).to_owned();
        self.size == other.size
            && match (&self.tag, &other.tag) {
                (Some(one), Some(other)) => bare(one) == bare(other),
                _ => self.modified.is_none() || other.modified.is_none() || self.modified == other.modified,
            }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn headers(pairs: &[(&'static str, &'static str)]) -> HeaderMap {
        let header = |(name, value): &(&'static str, &'static str)| {
            (name.parse().expect("a name"), value.parse().expect("a value"))
        };
        pairs.iter().map(header).collect()
    }

    #[test]
    fn ranges_are_parsed_or_refused() {
        let range = |text| ContentRange::of(&headers(&[("content-range", text)]));
        assert_eq!(range("bytes 5-9/10"), Some(ContentRange { part: 5..10, size: 10 }));
        for wrong in ["bytes 5-9/*", "bytes 9-5/10", "bytes 5-10/10", "bytes */10", "rows 5-9/10", "", "bytes 0-1"] {
            assert_eq!(range(wrong), None, "{wrong}");
        }
        assert_eq!(range("bytes 0-18446744073709551615/18446744073709551615"), None, "no overflow");
    }

    #[test]
    fn what_is_not_compressed_is_known() {
        for plain in ["", "identity", "aws-chunked", "aws-chunked,"] {
            assert_eq!(compression(&headers(&[("content-encoding", plain)])), None, "{plain}");
        }
        assert_eq!(compression(&headers(&[("content-encoding", "aws-chunked, gzip")])), Some("gzip"));
        assert_eq!(compression(&headers(&[])), None);
    }

    #[test]
    fn versions_differ_by_tag_then_by_date() {
        let version = |pairs: &[(&'static str, &'static str)]| Version::of(&headers(pairs), 9);
        let first = version(&[("etag", "\"a\""), ("last-modified", "Monday")]);
        assert!(first.same(&version(&[("etag", "W/\"a\""), ("last-modified", "Tuesday")])), "tags say more than dates");
        assert!(!first.same(&version(&[("etag", "\"b\"")])), "another tag");
        assert!(!first.same(&version(&[("last-modified", "Tuesday")])), "another date");
        assert!(first.same(&version(&[])), "nothing is told");
        assert!(!first.same(&Version { size: 8, ..first.clone() }), "another size");
        assert_eq!(first.strong_tag(), Some("\"a\""));
        assert_eq!(version(&[("etag", "W/\"a\"")]).strong_tag(), None);
    }
}
