//! A server of files over http for tests, with the faults of other servers.
//!
//! It serves a folder on the loopback with ranges, `HEAD` and a delay, and counts what it does. A fault is the first
//! part of a path: `/~busy/a/b` is the file `/a/b` from a busy server, `/~busy:2/a/b` is so for the first two
//! requests, and `/~busy:1-3/a/b` for the second and third. [`FAULTS`] lists them. By hand:
//! `cargo run -p autosplats-serve -- FOLDER`.
//!
//! ```
//! let folder = std::env::temp_dir();
//! let server = autosplats_serve::Server::start(folder, std::time::Duration::ZERO)?;
//! assert!(server.address("~reset/scan.laz").ends_with("/~reset/scan.laz"));
//! assert_eq!(server.counts().requests, 0);
//! # Ok::<(), std::io::Error>(())
//! ```

mod answer;

use std::collections::HashMap;
use std::io::{BufRead, BufReader, Read, Result, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

pub use answer::FAULTS;

/// Longest head of a request.
const MAX_HEAD: u64 = 1 << 16;

/// A running server, which ends when dropped.
#[derive(Debug)]
pub struct Server {
    address: SocketAddr,
    site: Site,
}

/// What the server serves, and what it did.
#[derive(Clone, Debug)]
pub struct Site(Arc<Shared>);

#[derive(Debug)]
struct Shared {
    folder: PathBuf,
    delay: Duration,
    /// Whether to print each request.
    told: bool,
    ended: AtomicBool,
    bytes: AtomicU64,
    connections: AtomicU64,
    heads: Mutex<Vec<String>>,
    /// How often each path was asked for.
    asked: Mutex<HashMap<String, u32>>,
}

/// What a server did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Requests received.
    pub requests: u64,
    /// Bytes of bodies sent.
    pub bytes: u64,
    /// Connections taken.
    pub connections: u64,
}

impl Server {
    /// Serves a folder on a free port of the loopback. Each answer comes after `delay`.
    ///
    /// # Errors
    /// Those of the system.
    pub fn start(folder: impl Into<PathBuf>, delay: Duration) -> Result<Self> {
        Self::on(0, Site::new(folder.into(), delay, false))
    }

    /// Serves a site on a port of the loopback; 0 is a free one.
    ///
    /// # Errors
    /// Those of the system.
    pub fn on(port: u16, site: Site) -> Result<Self> {
        let listener = TcpListener::bind(("127.0.0.1", port))?;
        let address = listener.local_addr()?;
        let serving = site.clone();
        std::thread::spawn(move || {
            for stream in listener.incoming() {
                if serving.0.ended.load(Ordering::Relaxed) {
                    return;
                }
                let (Ok(stream), site) = (stream, serving.clone()) else { continue };
                // The other side may leave at any time.
                std::thread::spawn(move || stream.set_nodelay(true).and_then(|()| site.converse(stream)));
            }
        });
        Ok(Self { address, site })
    }

    /// The address of a path, which does not start with a slash.
    pub fn address(&self, path: &str) -> String {
        format!("http://{}/{path}", self.address)
    }

    /// What the server did since it started.
    pub fn counts(&self) -> Counts {
        let load = |count: &AtomicU64| count.load(Ordering::Relaxed);
        let (bytes, connections) = (load(&self.site.0.bytes), load(&self.site.0.connections));
        Counts { requests: self.heads().len() as u64, bytes, connections }
    }

    /// The heads of all requests, as they came.
    pub fn heads(&self) -> Vec<String> {
        self.site.0.heads.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.site.0.ended.store(true, Ordering::Relaxed);
        // Wakes the thread that waits for the next connection.
        let _ = TcpStream::connect(self.address);
    }
}

impl Site {
    /// A folder to serve, each answer after `delay`. `told` prints requests to standard output.
    pub fn new(folder: PathBuf, delay: Duration, told: bool) -> Self {
        Self(Arc::new(Shared {
            folder,
            delay,
            told,
            ended: AtomicBool::new(false),
            bytes: AtomicU64::new(0),
            connections: AtomicU64::new(0),
            heads: Mutex::default(),
            asked: Mutex::default(),
        }))
    }

    /// Answers requests of one connection until it ends. The stream may be encrypted.
    ///
    /// # Errors
    /// Those of the connection.
    pub fn converse(&self, stream: impl Read + Write) -> Result<()> {
        self.0.connections.fetch_add(1, Ordering::Relaxed);
        let mut stream = BufReader::new(stream);
        loop {
            let mut head = Vec::new();
            while !head.ends_with(b"\r\n\r\n") {
                let read = (&mut stream).take(MAX_HEAD).read_until(b'\n', &mut head)?;
                if head.first().is_some_and(|byte| !byte.is_ascii_uppercase()) {
                    return answer::plain(stream.get_mut(), 400, "Connection: close\r\n");
                }
                if read == 0 || head.len() as u64 > MAX_HEAD {
                    return Ok(());
                }
            }
            let head = String::from_utf8_lossy(&head).into_owned();
            let path = head.split(' ').nth(1).unwrap_or_default().to_owned();
            let before = {
                let mut asked = self.0.asked.lock().unwrap_or_else(PoisonError::into_inner);
                let count = asked.entry(path).or_default();
                *count += 1;
                *count - 1
            };
            self.0.heads.lock().unwrap_or_else(PoisonError::into_inner).push(head.clone());
            if self.0.told {
                println!("{}", head.lines().next().unwrap_or_default());
            }
            std::thread::sleep(self.0.delay);
            if !self.answer(&head, before, stream.get_mut())? {
                return Ok(());
            }
        }
    }

    /// Waits until the server ends, a minute at most.
    fn silence(&self) {
        for _ in 0..6000 {
            if !self.0.ended.load(Ordering::Relaxed) {
                std::thread::sleep(Duration::from_millis(10));
            }
        }
    }
}
