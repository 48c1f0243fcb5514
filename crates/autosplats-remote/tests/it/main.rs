//! Remote files from a server on the loopback, with all of its faults.

#![allow(clippy::unwrap_used, reason = "a test that cannot be set up should fail")]

mod copc;
mod encrypted;
mod faults;
mod folder;
mod proxy;
mod ranges;
mod stores;

use std::ops::Range;
use std::sync::Arc;
use std::time::Duration;

use autosplats_cloud::{Error, Folder, Progress, Ranges};
use autosplats_remote::{Client, RemoteOptions};
use autosplats_serve::Server;

/// Size of the served file.
const SIZE: usize = 3_000_000;

/// A server of the file `scan.laz`.
struct Site {
    server: Server,
    folder: tempfile::TempDir,
}

/// The byte at each place of the file.
fn byte(at: u64) -> u8 {
    (at ^ at >> 8 ^ at >> 16) as u8
}

fn bytes(range: Range<u64>) -> Vec<u8> {
    range.map(byte).collect()
}

fn part(file: &dyn Ranges, range: Range<u64>) -> Result<Vec<u8>, Error> {
    Ok(file.read(&[range, 0..0], &())?.swap_remove(0))
}

impl Site {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("scan.laz"), bytes(0..SIZE as u64)).unwrap();
        Self { server: Server::start(folder.path(), Duration::ZERO).unwrap(), folder }
    }

    /// Writes one more file.
    fn add(&self, name: &str, bytes: &[u8]) {
        let path = self.folder.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, bytes).unwrap();
    }

    fn open(&self, path: &str) -> Result<Arc<dyn Ranges>, Error> {
        open(&self.server.address(path), &fitting(path), &())
    }

    /// What opening or reading the file says behind its address.
    fn fault(&self, path: &str) -> String {
        let address = self.server.address(path);
        let outcome = open(&address, &fitting(path), &()).and_then(|file| part(&*file, 500_000..900_000));
        let error = outcome.expect_err(path);
        assert!(matches!(error, Error::Remote { .. }), "{path}: {error:?}");
        let told = error.to_string();
        assert!(!told.contains('\n'), "{told}");
        let shown = address.split('?').next().unwrap().to_owned() + if address.contains('?') { "?…" } else { "" };
        told.strip_prefix(&format!("{shown}: ")).unwrap_or_else(|| panic!("{told}")).to_owned()
    }
}

/// Opens a file with a client of its own.
fn open(address: &str, options: &RemoteOptions, progress: &dyn Progress) -> Result<Arc<dyn Ranges>, Error> {
    Client::new(options.clone()).open(address, progress)
}

fn open_folder(address: &str, options: &RemoteOptions) -> Result<Arc<dyn Folder>, Error> {
    Client::new(options.clone()).open_folder(address)
}

/// Options that try again at once.
fn quick() -> RemoteOptions {
    RemoteOptions { retry_wait: Duration::from_millis(1), ..RemoteOptions::default() }
}

/// Options for a path: for a server that is silent they wait for a short while only.
fn fitting(path: &str) -> RemoteOptions {
    let silent = path.starts_with("~silent") || path.starts_with("~stalls");
    let idle_timeout = Duration::from_millis(if silent { 300 } else { 30_000 });
    RemoteOptions { idle_timeout, ..quick() }
}
