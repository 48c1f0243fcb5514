//! Live points: bytes from a pipe, and files that other programs write.
//!
//! # How it works
//!
//! A thread waits for data, decodes them and puts the points into a [`Mailbox`]. There they replace the update that
//! nobody has taken yet, or, with [`LiveOptions::all`], wait until that update is taken. So nothing queues, however
//! slow the taker is. A panic while reading, which is a bug, becomes an error of the stream, and the stream continues.

mod bytes;
mod mailbox;
mod watch;
mod work;

use std::{
    io::Read,
    path::{Path, PathBuf},
    sync::Arc,
    time::Duration,
};

use autosplats_cloud::{Error, Progress};
use autosplats_formats::ReadOptions;

pub use self::work::LiveOptions;
use self::{mailbox::Mailbox, work::guarded};
use crate::{Next, Statistics, Stream, Timeline};

/// Live points that others send or write: a [`Stream`] without a timeline that keeps only the newest update.
///
/// ```
/// use std::{io::Cursor, time::Duration};
///
/// use autosplats_sources::{Live, LiveOptions, Next, Stream as _};
///
/// let file = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\n\
///     property float y\nproperty float z\nend_header\n1 2 3\n";
/// let options = LiveOptions { all: true, ..LiveOptions::default() };
/// let mut live = Live::bytes(Cursor::new(file.repeat(3)), "pipe", &options)?;
/// while let Next::Update(update) = live.next(Duration::from_secs(10), &())? {
///     assert_eq!(update.cloud.positions(), [[1.0, 2.0, 3.0]]);
/// }
/// assert_eq!(live.statistics().taken, 3);
/// # Ok::<(), autosplats_cloud::Error>(())
/// ```
pub struct Live {
    mailbox: Arc<Mailbox>,
}

impl Live {
    /// Reads PLY and PCD files one after the other, for instance from standard input. `name` is used in messages. Bytes
    /// outside of files are skipped up to the next header. Stamps are times of arrival.
    ///
    /// The reading thread ends with the input, or at the next bytes after `Live` is dropped.
    ///
    /// # Errors
    /// [`Error::Io`] if no thread can be started.
    pub fn bytes(input: impl Read + Send + 'static, name: &str, options: &LiveOptions) -> Result<Self, Error> {
        let (name, options) = (name.to_owned(), options.clone());
        Self::start(&name.clone(), options.all, move |mailbox| bytes::read(input, name.as_ref(), &options, mailbox))
    }

    /// Watches a file, a folder, or a pattern like `scans/*.ply`, which need not exist yet. Gives the file each time it
    /// changes, or the newest file of several. Files must not have changed for a tenth of a second. Stamps are the
    /// times at which changes are noticed.
    ///
    /// # Errors
    /// [`Error::Io`] if no thread can be started.
    pub fn watch(path: &Path, options: &ReadOptions) -> Result<Self, Error> {
        let (path, options) = (path.to_owned(), options.clone());
        Self::start(&path.display().to_string(), false, move |mailbox| watch::watch(&path, &options, mailbox))
    }

    fn start(name: &str, all: bool, work: impl FnOnce(&Mailbox) + Send + 'static) -> Result<Self, Error> {
        let mailbox = Arc::new(Mailbox::new(all));
        let filled = Arc::clone(&mailbox);
        let path = PathBuf::from(name);
        let work = move || {
            let done = guarded(&path, || {
                work(&filled);
                Ok(())
            });
            if let Err(error) = done {
                filled.refuse(error);
            }
            filled.end();
        };
        let spawned = std::thread::Builder::new().name("live points".into()).spawn(work);
        spawned.map_err(|source| Error::Io { path: name.into(), source })?;
        Ok(Self { mailbox })
    }
}

impl Stream for Live {
    fn timeline(&self) -> Option<&Timeline> {
        None
    }

    fn seek(&mut self, _: usize) {}

    fn next(&mut self, patience: Duration, progress: &dyn Progress) -> Result<Next, Error> {
        self.mailbox.take(patience, progress)
    }

    fn statistics(&self) -> Statistics {
        self.mailbox.statistics()
    }

    fn received(&self) -> u64 {
        self.mailbox.received()
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        self.mailbox.abandon();
    }
}
