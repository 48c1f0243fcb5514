//! Ranges of a remote file.

use std::fmt;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use autosplats_cloud::{Error, Progress, Ranges, Traffic, check_memory, check_range};

use crate::address::Address;
use crate::batch;
use crate::content_range::{ContentRange, Version, length, text};
use crate::fault::{Fault, Wait};
use crate::kept::Part;
use crate::network::{Ask, Network, Target, announces_more, check_plain};
use crate::patience::Stop;
use crate::plan::spans;

/// Bytes that opening asks for.
const HEAD: u64 = 64 << 10;

/// Bytes after which tries are counted anew.
const PROGRESS: u64 = 64 << 10;

/// A file at an address.
pub(crate) struct RemoteRanges {
    name: PathBuf,
    file: Arc<File>,
    version: Version,
    /// The first bytes, or all of them.
    head: Vec<u8>,
    /// What the cache knows the file by.
    owner: u64,
}

#[derive(Debug)]
struct File {
    network: Arc<Network>,
    target: Target,
}

impl fmt::Debug for RemoteRanges {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("RemoteRanges").field("name", &self.name).field("version", &self.version).finish_non_exhaustive()
    }
}

impl RemoteRanges {
    pub(crate) fn open(address: &str, network: &Arc<Network>, progress: &dyn Progress) -> Result<Self, Error> {
        Self::of(Address::parse(address, &network.options)?, network, progress)
    }

    pub(crate) fn of(address: Address, network: &Arc<Network>, progress: &dyn Progress) -> Result<Self, Error> {
        let target = Target::new(address, Arc::default());
        let name = PathBuf::from(target.address.shown());
        let file = Arc::new(File { network: network.clone(), target });
        let (mut opened, opening) = (None, file.clone());
        let keep = |_, found| {
            opened = Some(found);
            Ok(())
        };
        file.run(1, move |_, stop| opening.first(stop), progress, keep)?;
        let (version, head) = opened.ok_or(Error::Cancelled)?;
        if head.len() as u64 == version.size && version.size > HEAD {
            progress.note(&format!("its server sends no parts of files; all {} bytes were loaded", version.size));
        }
        Ok(Self { name, file, version, head, owner: network.kept.owner() })
    }

    /// The bytes of a range that are in memory.
    fn known(&self, range: &Range<u64>) -> Option<Vec<u8>> {
        if range.end <= self.head.len() as u64 {
            return Some(self.head[range.start as usize..range.end as usize].to_vec());
        }
        self.file.network.kept.get(self.owner, Part::Range(range.start, range.end))
    }
}

impl Ranges for RemoteRanges {
    fn name(&self) -> &Path {
        &self.name
    }

    fn size(&self) -> u64 {
        self.version.size
    }

    fn read(&self, ranges: &[Range<u64>], progress: &dyn Progress) -> Result<Vec<Vec<u8>>, Error> {
        let mut total = 0;
        for range in ranges {
            check_range(&self.name, range, self.version.size)?;
            total += u128::from(range.end - range.start);
        }
        check_memory("parts of a file", u64::try_from(total).unwrap_or(u64::MAX))?;
        let mut missing = Vec::new();
        let mut read: Vec<Vec<u8>> = Vec::with_capacity(ranges.len());
        for (at, range) in ranges.iter().enumerate() {
            read.push(self.known(range).unwrap_or_else(|| {
                missing.push(at);
                vec![0; (range.end - range.start) as usize]
            }));
        }
        let spans: Arc<[_]> = spans(ranges, missing.clone()).into();
        let (jobs, file, version) = (spans.clone(), self.file.clone(), self.version.clone());
        let job = move |at: usize, stop: &Stop| file.part(&jobs[at].part, &version, stop);
        let deliver = |at: usize, bytes: Vec<u8>| {
            spans[at].deliver(&bytes, ranges, &mut read);
            Ok(())
        };
        self.file.run(spans.len(), job, progress, deliver)?;
        for at in missing {
            let part = Part::Range(ranges[at].start, ranges[at].end);
            self.file.network.kept.insert(self.owner, part, &read[at]);
        }
        Ok(read)
    }

    fn traffic(&self) -> Traffic {
        self.file.target.received.traffic()
    }
}

impl File {
    fn run<T: Send + 'static>(
        &self,
        jobs: usize,
        job: impl Fn(usize, &Stop) -> Result<T, Error> + Send + Sync + 'static,
        progress: &dyn Progress,
        done: impl FnMut(usize, T) -> Result<(), Error>,
    ) -> Result<(), Error> {
        batch::run(&self.network.gate, self.target.address.shown(), jobs, job, progress, done)
    }

    /// The version of the file and its first bytes.
    fn first(&self, stop: &Stop) -> Result<(Version, Vec<u8>), Error> {
        let mut patience = self.network.patience(&self.target, stop);
        loop {
            match self.try_first(stop) {
                Ok(first) => return Ok(first),
                Err(fault) => patience.after(fault)?,
            }
        }
    }

    fn try_first(&self, stop: &Stop) -> Result<(Version, Vec<u8>), Fault> {
        let response = self.network.get(&self.target, &Ask::Part(0..HEAD, None))?;
        check_plain(&response)?;
        let headers = response.headers().clone();
        let mut head = Vec::new();
        match response.status().as_u16() {
            206 => {
                let sized = ContentRange::of(&headers).ok_or_else(unclear)?;
                let wanted = sized.size.min(HEAD);
                if sized.part.start != 0 || sized.part.end > wanted || announces_more(&response, wanted) {
                    return Err(unclear());
                }
                if !self.network.body(response, &self.target, &mut head, wanted, stop)? {
                    return Err(unclear());
                }
                Ok((Version::of(&headers, sized.size), head))
            }
            200 => {
                let most = self.network.options.cache.max(HEAD);
                check_memory("a file", length(&headers).unwrap_or(0).min(most))?;
                let refuse = || {
                    Fault::Final(format!(
                        "the server sends no parts of files, and more than {most} bytes are not loaded whole; download it"
                    ))
                };
                if announces_more(&response, most)
                    || !self.network.body(response, &self.target, &mut head, most, stop)?
                {
                    return Err(refuse());
                }
                Ok((Version::of(&headers, head.len() as u64), head))
            }
            // An empty file has no first byte.
            _ if text(&headers, "content-range").is_some_and(|told| told.ends_with("*/0")) => {
                Ok((Version::of(&headers, 0), head))
            }
            _ => Err(unclear()),
        }
    }

    /// The bytes of one part. What breaks off goes on where it ended.
    fn part(&self, part: &Range<u64>, version: &Version, stop: &Stop) -> Result<Vec<u8>, Error> {
        let len = part.end - part.start;
        let mut bytes = Vec::with_capacity(len as usize);
        let mut patience = self.network.patience(&self.target, stop);
        while (bytes.len() as u64) < len {
            let had = bytes.len() as u64;
            let rest = part.start + had..part.end;
            let outcome = self.try_part(&rest, version, &mut bytes, len, stop);
            if bytes.len() as u64 - had >= PROGRESS {
                patience = self.network.patience(&self.target, stop);
            }
            match outcome {
                Ok(()) if (bytes.len() as u64) < len => {
                    patience.after(Fault::Passing("the server sends less than was asked for".into(), Wait::None))?;
                }
                Ok(()) => {}
                Err(fault) => patience.after(fault)?,
            }
        }
        Ok(bytes)
    }

    fn try_part(
        &self,
        part: &Range<u64>,
        version: &Version,
        bytes: &mut Vec<u8>,
        most: u64,
        stop: &Stop,
    ) -> Result<(), Fault> {
        let response = self.network.get(&self.target, &Ask::Part(part.clone(), version.strong_tag()))?;
        check_plain(&response)?;
        let headers = response.headers();
        match response.status().as_u16() {
            206 => {
                let sized = ContentRange::of(headers).ok_or_else(unclear)?;
                if !version.same(&Version::of(headers, sized.size)) {
                    return Err(Fault::changed());
                }
                if sized.part.start != part.start || sized.part.end > part.end {
                    return Err(unclear());
                }
                if announces_more(&response, part.end - part.start) {
                    return Err(unclear());
                }
                if self.network.body(response, &self.target, bytes, most, stop)? { Ok(()) } else { Err(unclear()) }
            }
            200 if version.same(&Version::of(headers, version.size)) => {
                Err(Fault::last("the server sends parts of files only sometimes; download it"))
            }
            _ => Err(Fault::changed()),
        }
    }
}

fn unclear() -> Fault {
    Fault::last("the server sends other parts than it was asked for, or does not tell which; download it")
}
