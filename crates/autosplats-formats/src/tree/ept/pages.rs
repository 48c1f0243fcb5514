//! Pages of the hierarchy: JSON objects of keys and numbers of points.

use std::borrow::Cow;
use std::fmt;

use autosplats_cloud::{Key, excerpt};
use serde::de::{Deserializer, Error as _, MapAccess, Visitor};

use crate::tree::directory::Entry;

/// The entries of a page; `bytes` is the size of a node with so many points.
pub(super) fn entries(page: &[u8], bytes: impl Fn(u32) -> u64) -> Result<Vec<(Key, Entry)>, serde_json::Error> {
    let mut json = serde_json::Deserializer::from_slice(page);
    let list = json.deserialize_map(Entries(bytes))?;
    json.end()?;
    Ok(list)
}

struct Entries<F>(F);

impl<'de, F: Fn(u32) -> u64> Visitor<'de> for Entries<F> {
    type Value = Vec<(Key, Entry)>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an object of keys and numbers of points")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
        let mut list = Vec::new();
        while let Some((name, points)) = map.next_entry::<Name<'de>, i64>()? {
            let fail = |what: &str| A::Error::custom(format!("'{}' {what}", excerpt(name.0.as_bytes())));
            let key = key(&name.0).ok_or_else(|| fail("is no place in an octree"))?;
            let entry = match u32::try_from(points) {
                Ok(points) => {
                    let bytes = u32::try_from((self.0)(points)).unwrap_or(u32::MAX);
                    Entry::Node { points, offset: 0, bytes }
                }
                Err(_) if points == -1 => Entry::Page { offset: 0, bytes: 0 },
                Err(_) => return Err(fail(&format!("has {points} points; build the tree again"))),
            };
            list.push((key, entry));
        }
        Ok(list)
    }
}

/// A key as text, which is copied only if it has escapes.
#[derive(serde::Deserialize)]
struct Name<'a>(#[serde(borrow)] Cow<'a, str>);

/// The key of `2-1-3-0`.
fn key(name: &str) -> Option<Key> {
    let mut numbers = name.split('-').map(|number| number.parse::<u32>().ok());
    let mut next = || numbers.next().flatten();
    let key = Key::new(next()?, [next()?, next()?, next()?])?;
    numbers.next().is_none().then_some(key)
}
