//! Files behind addresses, and octrees: these are read in parts, all else whole.

use std::path::Path;
use std::sync::Arc;

use autosplats_cloud::{Error, PointCloud, Progress, Tree, Wanted};
use autosplats_formats::{Part, ReadOptions, is_tree_file, open_tree as open_local, read_part, read_with};

/// Ways to reach a file, each the beginning of an address.
const SCHEMES: [&str; 5] = ["http://", "https://", "s3://", "gs://", "az://"];

/// Octrees of fewer points in files are read whole, since that takes no longer than choosing a part.
pub const MIN_TREE_POINTS: u64 = 20_000_000;

/// Whether a name is the address of a file.
pub(crate) fn is_address(name: &str) -> bool {
    let start = name.split_once("://").map(|(scheme, _)| scheme.to_ascii_lowercase() + "://");
    start.is_some_and(|start| SCHEMES.contains(&&*start))
}

/// An address without what follows a question mark.
fn path(address: &str) -> &str {
    address.split(['?', '#']).next().unwrap_or(address)
}

/// An address for messages: without user, password and query.
fn shown(address: &str) -> String {
    let path = path(address);
    let Some((scheme, rest)) = path.split_once("://") else { return path.into() };
    let host = rest.find('/').unwrap_or(rest.len());
    let start = rest[..host].rfind('@').map_or(0, |at| at + 1);
    format!("{scheme}://{}", &rest[start..])
}

/// The last part of the path in an address.
pub(crate) fn short_name(address: &str) -> String {
    let path = path(address).trim_end_matches('/');
    path.rsplit('/').next().unwrap_or(path).into()
}

/// Reads a local file whole.
pub(crate) fn read_file(path: &Path, options: &ReadOptions, progress: &dyn Progress) -> Result<PointCloud, Error> {
    // Other octrees are read whole as files, which is faster.
    match is_tree_file(path).then(|| open_local(path, progress)).transpose()?.flatten() {
        Some(tree) => read_tree(&*tree, &Part::default(), options, progress),
        None => read_with(path, options, progress),
    }
}

/// Reads the part of an octree that options ask for.
///
/// # Errors
/// Those of [`read_part`].
pub fn read_tree(
    tree: &dyn Tree,
    part: &Part,
    options: &ReadOptions,
    progress: &dyn Progress,
) -> Result<PointCloud, Error> {
    let part = Part { keep_no_returns: options.keep_no_returns, whole: options.whole, ..part.clone() };
    let wanted = Wanted { colors: true, exact: options.exact, keep: options.keep.clone(), ..Wanted::default() };
    read_part(tree, &part, &wanted, progress)
}

#[cfg(feature = "http")]
mod open {
    use std::sync::{Mutex, PoisonError};

    use autosplats_cloud::{Ranges, check_memory};
    use autosplats_formats::{TREE_FILES, open_folder_tree, open_tree_in, read_bytes};
    use autosplats_remote::{Client, Header, RemoteOptions};

    use super::*;

    /// The client for these headers. All addresses share its connections and its memory.
    fn client(texts: &[String], headers: Vec<Header>) -> Client {
        static KNOWN: Mutex<Vec<(Vec<String>, Client)>> = Mutex::new(Vec::new());
        let mut known = KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, client)) = known.iter().find(|(known, _)| known == texts) {
            return client.clone();
        }
        let client = Client::new(RemoteOptions { headers, ..RemoteOptions::from_environment() });
        known.push((texts.to_vec(), client.clone()));
        client
    }

    /// What is behind an address.
    enum Found {
        Tree(Arc<dyn Tree>),
        Other(Arc<dyn Ranges>),
    }

    fn find(address: &str, options: &ReadOptions, progress: &dyn Progress) -> Result<Found, Error> {
        let header = |text: &String| {
            let refused = |what| Error::Remote { address: shown(address), what };
            text.parse::<Header>().map_err(refused)
        };
        let headers: Vec<Header> = options.headers.iter().map(header).collect::<Result<_, _>>()?;
        let client = client(&options.headers, headers);
        let name = path(address).rsplit('/').next().unwrap_or_default();
        if TREE_FILES.contains(&name) {
            return Ok(Found::Tree(open_folder_tree(client.open_folder(address)?, name, progress)?));
        }
        let ranges = client.open(address, progress)?;
        Ok(match open_tree_in(ranges.clone(), progress)? {
            Some(tree) => Found::Tree(tree),
            None => Found::Other(ranges),
        })
    }

    pub(crate) fn open_tree(
        address: &str,
        options: &ReadOptions,
        progress: &dyn Progress,
    ) -> Result<Option<Arc<dyn Tree>>, Error> {
        match find(address, options, progress)? {
            Found::Tree(tree) => Ok(Some(tree)),
            Found::Other(_) => Ok(None),
        }
    }

    pub(crate) fn read(address: &str, options: &ReadOptions, progress: &dyn Progress) -> Result<PointCloud, Error> {
        match find(address, options, progress)? {
            Found::Tree(tree) => read_tree(&*tree, &Part::default(), options, progress),
            Found::Other(ranges) => {
                check_memory("a remote file", ranges.size())?;
                let bytes = ranges.read(&[0..ranges.size(), 0..0], progress)?.swap_remove(0);
                read_bytes(Path::new(&shown(address)), &bytes, options, progress)
            }
        }
    }
}

#[cfg(not(feature = "http"))]
mod open {
    use super::*;

    fn refused<T>(address: &str) -> Result<T, Error> {
        let what = "this program was built without network access; build it with the feature 'http'".into();
        Err(Error::Remote { address: shown(address), what })
    }

    pub(crate) fn open_tree(address: &str, _: &ReadOptions, _: &dyn Progress) -> Result<Option<Arc<dyn Tree>>, Error> {
        refused(address)
    }

    pub(crate) fn read(address: &str, _: &ReadOptions, _: &dyn Progress) -> Result<PointCloud, Error> {
        refused(address)
    }
}

pub(crate) use open::{open_tree, read};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_told_from_paths() {
        for address in ["https://a.b/c.copc.laz", "HTTP://a/b", "s3://bucket/key", "gs://b/k", "az://a/c/b"] {
            assert!(is_address(address), "{address}");
        }
        for other in ["a/b.laz", "https:/a", "ftp://a/b", "zenoh://a/b", "C:\\a.laz", "scene:herd"] {
            assert!(!is_address(other), "{other}");
        }
        assert_eq!(short_name("https://a.b/c/d.copc.laz?X-Signature=1/2"), "d.copc.laz");
        assert_eq!(short_name("https://a.b/c/"), "c");
        assert_eq!(shown("https://me:secret@a.b/c@d?key=1"), "https://a.b/c@d");
    }
}
