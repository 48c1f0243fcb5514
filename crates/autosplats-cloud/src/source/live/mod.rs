//! Points that come when they come: bytes from a pipe, files that others write.
//!
//! # How it works
//!
//! A thread waits for what comes, decodes it and puts it into a [`Mailbox`], where it takes the place of what nobody has
//! taken yet, or is left only once that is taken. So nothing queues, however slow the taker is. Should reading panic, which is a mistake of ours, that is an error
//! of the stream like any other, which goes on with what comes next.

mod bytes;
mod mailbox;
mod watch;

use std::{
    io::Read,
    panic::{AssertUnwindSafe, catch_unwind},
    path::{Path, PathBuf},
    sync::Arc,
    time::{Duration, SystemTime},
};

use self::mailbox::Mailbox;
use crate::{Error, Next, Progress, ReadOptions, Statistics, Stream, Timeline, error::message};

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
    /// Frames are read as they are taken, so that whoever writes them waits and none is dropped. Without it, which is the
    /// default, those that nobody takes in time are.
    pub all: bool,
}

impl Default for LiveOptions {
    fn default() -> Self {
        Self { read: ReadOptions::default(), max_frame_bytes: 1 << 30, all: false }
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
        Self::start(&name.clone(), options.all, move |mailbox| bytes::read(input, name.as_ref(), &options, mailbox))
    }

    /// A file, each time it has changed, or the newest of a folder or of those that a pattern like `scans/*.ply` stands for, once
    /// it has not changed for a tenth of a second. What is not there yet is waited for. The stamps are the times at which
    /// that was noticed.
    ///
    /// # Errors
    /// [`Error::Io`] if there can be no thread.
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

/// Does something that must not end a thread without a word: a panic becomes an error.
fn guarded<T>(name: &Path, work: impl FnOnce() -> Result<T, Error>) -> Result<T, Error> {
    // What is left half done belongs to the frame that failed, and to nobody after it.
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|panic| {
        let said = panic.downcast_ref::<&str>().map(|said| (*said).to_owned());
        let said = said.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_default();
        let what = message(&format!("reading has failed by a mistake of this program, please report it: {said}"));
        Err(Error::Unsupported { path: name.into(), what })
    })
}

/// Nanoseconds since 1970.
fn now() -> i64 {
    let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    i64::try_from(since.as_nanos()).unwrap_or(i64::MAX)
}
