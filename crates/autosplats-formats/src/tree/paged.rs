//! Pages of a hierarchy, and nodes, that are ranges of files.

use std::ops::Range;

use autosplats_cloud::{Error, Key, Progress, Ranges, check_memory};

use super::{
    directory::{Directory, Entry},
    octree::{Octal, unknown},
};

/// Most bytes of pages that are in memory at once, before they are entries.
pub(super) const MAX_PAGES: u64 = 64 << 20;

/// Memory that an entry of a page takes once it is known, as a multiple of its bytes in the page.
const KNOWN: u64 = 4;

/// A page's place in the file of pages.
#[derive(Clone, Copy, Debug)]
pub(super) struct Page {
    pub(super) offset: u64,
    pub(super) bytes: u64,
}

impl Page {
    /// Checks the place in a file of `size` bytes, for entries of `entry` bytes each.
    pub(super) fn check(self, size: u64, entry: usize) -> Result<(), String> {
        let Self { offset, bytes } = self;
        let end = offset.checked_add(bytes).filter(|&end| end <= size);
        let whole = bytes > 0 && bytes.is_multiple_of(entry as u64);
        if end.is_none() {
            Err(format!("a page of {bytes} bytes at byte {offset} reaches beyond the end; copy the file again"))
        } else if bytes > MAX_PAGES {
            Err(format!("a page of {bytes} bytes is too large; at most {MAX_PAGES} are read"))
        } else if !whole {
            Err(format!("a page of {bytes} bytes is not made of entries of {entry} bytes; build the file again"))
        } else {
            Ok(())
        }
    }
}

/// The entries of a page, which tells of a key. An error has the byte of the faulty entry, counted from the start of
/// the page.
pub(super) type Parsed = Result<Vec<(Key, Entry)>, (usize, String)>;

/// Takes a page at byte `offset` of a file into the directory.
pub(super) fn take_page(
    directory: &Directory,
    ranges: &dyn Ranges,
    key: Key,
    offset: u64,
    page: &[u8],
    parse: impl Fn(Key, &[u8]) -> Parsed,
) -> Result<(), Error> {
    let fail = |at: u64, what: String| {
        Error::malformed(ranges.name(), format!("byte {at}"), format!("page of the hierarchy: {what}"))
    };
    let list = parse(key, page).map_err(|(at, what)| fail(offset + at as u64, what))?;
    check_memory("the hierarchy", KNOWN * page.len() as u64)?;
    directory.load(key, list).map_err(|what| fail(offset, format!("{what}; build the file again")))
}

/// Loads pages until all of `keys` are known.
pub(super) fn load_pages(
    directory: &Directory,
    ranges: &dyn Ranges,
    keys: &[Key],
    progress: &dyn Progress,
    parse: impl Fn(Key, &[u8]) -> Parsed,
) -> Result<(), Error> {
    loop {
        // A page may tell that the key is on a further page.
        let pages = directory.pages(keys);
        if pages.is_empty() {
            return Ok(());
        }
        let mut rest = &pages[..];
        while !rest.is_empty() {
            let mut total = 0;
            let fits = |(_, range): &&(Key, Range<u64>)| {
                total += range.end - range.start;
                total <= MAX_PAGES
            };
            let (batch, after) = rest.split_at(rest.iter().take_while(fits).count().max(1));
            let wanted: Vec<Range<u64>> = batch.iter().map(|(_, range)| range.clone()).collect();
            let read = ranges.read(&wanted, progress)?;
            for ((key, range), page) in batch.iter().zip(&read) {
                take_page(directory, ranges, *key, range.start, page, &parse)?;
            }
            rest = after;
        }
    }
}

/// Points and place of a known node.
pub(super) fn place(tree: &impl Octal, key: Key) -> Result<(u32, Range<u64>), Error> {
    match tree.octree().directory.entry(key) {
        Some(Entry::Node { points, offset, bytes }) => Ok((points, offset..offset + u64::from(bytes))),
        _ => Err(unknown(tree, key)),
    }
}

/// The bytes of known nodes.
pub(super) fn fetch(
    tree: &impl Octal,
    ranges: &dyn Ranges,
    keys: &[Key],
    progress: &dyn Progress,
) -> Result<Vec<Vec<u8>>, Error> {
    let places = keys.iter().map(|&key| Ok(place(tree, key)?.1)).collect::<Result<Vec<_>, Error>>()?;
    let filled: Vec<Range<u64>> = places.iter().filter(|range| !range.is_empty()).cloned().collect();
    let mut read = ranges.read(&filled, progress)?.into_iter();
    // Nodes without points have no bytes.
    let bytes = |range: &Range<u64>| if range.is_empty() { None } else { read.next() };
    Ok(places.iter().map(bytes).map(Option::unwrap_or_default).collect())
}
