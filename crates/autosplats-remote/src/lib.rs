//! Parts of files behind `http://`, `https://`, `s3://`, `gs://` and `az://` addresses.
//!
//! ```no_run
//! use autosplats_remote::{Client, RemoteOptions};
//!
//! let client = Client::new(RemoteOptions::from_environment());
//! let scan = client.open("https://example.org/scan.copc.laz", &())?;
//! let parts = scan.read(&[0..589, 1_000_000..1_050_000], &())?;
//! assert_eq!(parts[0].len(), 589);
//! # Ok::<(), autosplats_cloud::Error>(())
//! ```
//!
//! # How it works
//!
//! [`Client::open`] asks for the first 64 KB at once. The answer tells the size and the version of the file, and its
//! bytes are kept, since files begin with what opening needs. Later ranges that are close to each other become one
//! request (`plan.rs`), and a dozen requests run on threads of their own (`batch.rs`). What arrives stays in a bounded
//! cache.
//!
//! A fault (`fault.rs`) is either final, or passing and tried again after a wait (`patience.rs`). A request that breaks
//! off goes on where it ended. Each answer must be of the version that was opened. Redirects are followed here and not
//! by the client, so that headers of the user reach no other host.
//!
//! A wait cannot be broken from outside, since the client blocks. So the caller's thread waits for results, and leaves
//! when it is told to. The threads it leaves behind end with their time limits.

#![warn(clippy::print_stderr, clippy::print_stdout, reason = "they panic where the stream cannot be written")]

mod address;
mod batch;
mod content_range;
mod fault;
mod folder;
mod kept;
mod network;
mod options;
mod patience;
mod plan;
mod proxies;
mod ranges;

use std::sync::Arc;

use autosplats_cloud::{Error, Folder, Progress, Ranges};

pub use options::{Credentials, Header, RemoteOptions, Secret};
pub use proxies::Proxies;

/// Whether a name has the form of an address that can be [opened](Client::open), valid or not.
pub fn is_address(name: &str) -> bool {
    address::scheme_of(name).is_some()
}

/// Opens remote files. All that it opens shares connections, a dozen requests at a time, and the memory for what was
/// fetched. Clones share them too.
#[derive(Clone, Debug)]
pub struct Client(Arc<network::Network>);

impl Client {
    /// A client that has not connected to anything.
    pub fn new(options: RemoteOptions) -> Self {
        Self(Arc::new(network::Network::new(options)))
    }

    /// Opens the file at an address. This is one request, whose answer holds the first bytes.
    ///
    /// # Errors
    /// [`Error::Remote`], [`Error::OutOfMemory`], and [`Error::Cancelled`] if `progress` says so.
    pub fn open(&self, address: &str, progress: &dyn Progress) -> Result<Arc<dyn Ranges>, Error> {
        Ok(Arc::new(ranges::RemoteRanges::open(address, &self.0, progress)?))
    }

    /// Opens the folder at an address that ends in a slash, or else the folder of the file at that address. Nothing is
    /// requested before a file is read.
    ///
    /// # Errors
    /// [`Error::Remote`] for an address that is not valid.
    pub fn open_folder(&self, address: &str) -> Result<Arc<dyn Folder>, Error> {
        Ok(Arc::new(folder::RemoteFolder::open(address, &self.0)?))
    }
}
