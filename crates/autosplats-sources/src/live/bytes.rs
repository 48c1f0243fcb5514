//! Reads files one after the other from a pipe.

use std::{
    io::{ErrorKind, Read},
    path::Path,
    sync::Arc,
};

use autosplats_cloud::Error;
use autosplats_formats::{
    framing::{Found, Framing},
    read_bytes,
};

use super::{
    mailbox::Mailbox,
    work::{LiveOptions, UntilAbandoned, guarded, now},
};
use crate::{Update, stream::or_empty};

/// Bytes read at a time.
const READ_BYTES: usize = 1 << 16;

/// Reads until the input ends or the mailbox is abandoned.
pub(super) fn read(mut input: impl Read, name: &Path, options: &LiveOptions, mailbox: &Mailbox) {
    let mut framing = Framing::new(options.max_frame_bytes);
    let mut piece = vec![0; READ_BYTES];
    loop {
        let len = match input.read(&mut piece) {
            Ok(len) => len,
            Err(error) if error.kind() == ErrorKind::Interrupted => continue,
            Err(source) => {
                mailbox.refuse(Error::Io { path: name.into(), source });
                0
            }
        };
        if mailbox.is_abandoned() {
            return;
        }
        framing.push(&piece[..len]);
        while let Some(found) = framing.find() {
            deliver(found, name, options, mailbox);
        }
        // Bytes outside of files do not count as received.
        if framing.is_within() {
            mailbox.receive(len);
        }
        if len == 0 {
            framing.end().into_iter().for_each(|found| deliver(found, name, options, mailbox));
            return;
        }
    }
}

fn deliver(found: Found, name: &Path, options: &LiveOptions, mailbox: &Mailbox) {
    let refused = |byte: u64, what| Error::Malformed { path: name.into(), place: format!("byte {byte}"), what };
    let error = match found {
        Found::Refused(byte, what) => refused(byte, what),
        Found::File(byte, bytes) => {
            match guarded(name, || or_empty(read_bytes(name, &bytes, &options.read, &UntilAbandoned(mailbox)))) {
                Ok(cloud) => return mailbox.put(Update { channel: 0, stamp: now(), cloud: Arc::new(cloud) }),
                // A position within a frame needs the offset of the frame.
                Err(Error::Malformed { place, what, .. }) => refused(byte, format!("in a frame, {place}: {what}")),
                Err(error) => error,
            }
        }
    };
    if !mailbox.is_abandoned() {
        mailbox.refuse(error);
    }
}
