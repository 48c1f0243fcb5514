//! Files behind addresses: octrees are read in parts, all else whole.

use std::path::Path;
use std::sync::Arc;

use autosplats_cloud::{Error, PointCloud, Progress, Tree};
use autosplats_formats::ReadOptions;

/// Ways to reach a file, each the beginning of an address.
const SCHEMES: [&str; 5] = ["http://", "https://", "s3://", "gs://", "az://"];

/// Whether a name is the address of a file.
pub(crate) fn is_address(name: &str) -> bool {
    let start = name.split_once("://").map(|(scheme, _)| scheme.to_ascii_lowercase() + "://");
    start.is_some_and(|start| SCHEMES.contains(&&*start))
}

/// The path in an address, without what follows a question mark.
fn path(address: &str) -> &str {
    address.split(['?', '#']).next().unwrap_or(address)
}

/// The last part of the path in an address.
pub(crate) fn short_name(address: &str) -> String {
    let path = path(address).trim_end_matches('/');
    path.rsplit('/').next().unwrap_or(path).into()
}

#[cfg(feature = "http")]
mod open {
    use autosplats_cloud::{Ranges, Wanted, check_memory};
    use autosplats_formats::{open_ept_in, open_tree_in, read_bytes, read_part};
    use autosplats_remote::{Client, Header, RemoteOptions};

    use super::*;

    /// What is behind an address.
    enum Found {
        Tree(Arc<dyn Tree>),
        Other(Arc<dyn Ranges>),
    }

    fn find(address: &str, options: &ReadOptions, progress: &dyn Progress) -> Result<Found, Error> {
        let header = |text: &String| {
            let refused = |what| Error::Remote { address: path(address).into(), what };
            text.parse::<Header>().map_err(refused)
        };
        let headers = options.headers.iter().map(header).collect::<Result<_, _>>()?;
        let client = Client::new(RemoteOptions { headers, ..RemoteOptions::from_environment() });
        if path(address).ends_with("/ept.json") {
            return Ok(Found::Tree(open_ept_in(client.open_folder(address)?, progress)?));
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
            Found::Tree(tree) => {
                let (exact, keep) = (options.exact, options.keep.clone());
                let wanted = Wanted { colors: true, exact, keep, ..Wanted::default() };
                read_part(&*tree, None, None, &wanted, progress)
            }
            Found::Other(ranges) => {
                check_memory("a remote file", ranges.size())?;
                let bytes = ranges.read(&[0..ranges.size(), 0..0], progress)?.swap_remove(0);
                read_bytes(Path::new(path(address)), &bytes, options, progress)
            }
        }
    }
}

#[cfg(not(feature = "http"))]
mod open {
    use super::*;

    fn refused<T>(address: &str) -> Result<T, Error> {
        let what = "this program was built without network access; build it with the feature 'http'".into();
        Err(Error::Remote { address: path(address).into(), what })
    }

    pub(crate) fn open_tree(
        address: &str,
        _: &ReadOptions,
        _: &dyn Progress,
    ) -> Result<Option<Arc<dyn Tree>>, Error> {
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
    }
}
