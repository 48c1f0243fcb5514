//! Points that come when they come: bytes from a pipe, files that others write.
//!
//! # How it works
//!
//! A thread waits for what comes, decodes it and puts it into a [`Mailbox`], where it takes the place of what nobody has
//! taken yet. So nothing queues, however slow the taker is.

mod bytes;
mod mailbox;
mod watch;

use std::{
    io::Read,
    path::Path,
    sync::Arc,
    time::{Duration, SystemTime},
};

use self::mailbox::Mailbox;
use crate::{Error, Next, Progress, ReadOptions, Statistics, Stream, Timeline};

/// Points that others send or write: a [`Stream`] without a timeline, of which the newest are at hand.
pub struct Live {
    mailbox: Arc<Mailbox>,
}

/// How to read [`Live::bytes`].
#[derive(Clone, Debug, PartialEq)]
pub struct LiveOptions {
    /// How to read a frame.
    pub read: ReadOptions,
    /// Bytes that a frame may have; what announces more is refused. 1 GiB by default.
    pub max_frame_bytes: usize,
}

impl Default for LiveOptions {
    fn default() -> Self {
        Self { read: ReadOptions::default(), max_frame_bytes: 1 << 30 }
    }
}

impl Live {
    /// PLY and PCD files one after the other, as from standard input, in pieces of any size. `name` stands in messages. What
    /// is no file is skipped to the next header. The stamps are the times of arrival.
    ///
    /// The thread that reads ends with the input, or at the next bytes after this was dropped.
    ///
    /// # Errors
    /// [`Error::Io`] if there can be no thread.
    pub fn bytes(input: impl Read + Send + 'static, name: &str, options: &LiveOptions) -> Result<Self, Error> {
        let (name, options) = (name.to_owned(), options.clone());
        Self::start(&name.clone(), move |mailbox| bytes::read(input, name.as_ref(), &options, mailbox))
    }

    /// A file, each time it has changed, or the newest file of a folder, once it has not changed for a tenth of a second. What
    /// is not there yet is waited for. The stamps are the times at which that was noticed.
    ///
    /// # Errors
    /// [`Error::Io`] if there can be no thread.
    pub fn watch(path: &Path, options: &ReadOptions) -> Result<Self, Error> {
        let (path, options) = (path.to_owned(), options.clone());
        Self::start(&path.display().to_string(), move |mailbox| watch::watch(&path, &options, mailbox))
    }

    fn start(name: &str, work: impl FnOnce(&Mailbox) + Send + 'static) -> Result<Self, Error> {
        let mailbox = Arc::new(Mailbox::default());
        let filled = Arc::clone(&mailbox);
        let work = move || {
            work(&filled);
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
}

impl Drop for Live {
    fn drop(&mut self) {
        self.mailbox.abandon();
    }
}

/// Nanoseconds since 1970.
fn now() -> i64 {
    let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    i64::try_from(since.as_nanos()).unwrap_or(i64::MAX)
}
