//! Files of a remote folder.

use std::fmt;
use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use autosplats_cloud::{Error, Folder, Progress, Ranges, Traffic, check_memory};
use flate2::read::MultiGzDecoder;

use crate::address::Address;
use crate::batch;
use crate::content_range::{compression, length};
use crate::fault::Fault;
use crate::kept::Part;
use crate::network::{Ask, Network, Received, Target, announces_more};
use crate::patience::Stop;
use crate::ranges::RemoteRanges;

/// The folder of an address.
pub(crate) struct RemoteFolder {
    name: PathBuf,
    base: Address,
    network: Arc<Network>,
    received: Arc<Received>,
    /// What the cache knows the folder by.
    owner: u64,
}

impl fmt::Debug for RemoteFolder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("RemoteFolder").field("name", &self.name).finish_non_exhaustive()
    }
}

impl RemoteFolder {
    pub(crate) fn open(address: &str, network: &Arc<Network>) -> Result<Self, Error> {
        let base = Address::parse(address, &network.options)?;
        let (name, owner) = (base.folder().into(), network.kept.owner());
        Ok(Self { name, base, network: network.clone(), received: Arc::default(), owner })
    }
}

impl Folder for RemoteFolder {
    fn name(&self) -> &Path {
        &self.name
    }

    fn read(&self, names: &[String], most: u64, progress: &dyn Progress) -> Result<Vec<Vec<u8>>, Error> {
        let mut missing = Vec::new();
        let mut read: Vec<Vec<u8>> = Vec::with_capacity(names.len());
        for (at, name) in names.iter().enumerate() {
            read.push(self.network.kept.get(self.owner, Part::Named(name.clone())).unwrap_or_else(|| {
                missing.push(at);
                Vec::new()
            }));
        }
        let targets: Vec<Target> =
            missing.iter().map(|&at| Target::new(self.base.file(&names[at]), self.received.clone())).collect();
        let network = self.network.clone();
        let job = move |at: usize, stop: &Stop| whole(&network, &targets[at], most, stop);
        let deliver = |at: usize, bytes: Vec<u8>| {
            self.network.kept.insert(self.owner, Part::Named(names[missing[at]].clone()), &bytes);
            read[missing[at]] = bytes;
            Ok(())
        };
        batch::run(&self.network.gate, &self.base.folder(), missing.len(), job, progress, deliver)?;
        // What is kept may have been read with a higher limit.
        match read.iter().zip(names).find(|(bytes, _)| bytes.len() as u64 > most) {
            Some((_, name)) => Err(too_large(self.base.file(name).shown(), most)),
            None => Ok(read),
        }
    }

    fn open(&self, name: &str, progress: &dyn Progress) -> Result<Arc<dyn Ranges>, Error> {
        Ok(Arc::new(RemoteRanges::of(self.base.file(name), &self.network, progress)?))
    }

    fn traffic(&self) -> Traffic {
        self.received.traffic()
    }
}

/// The bytes of a file of at most `most` bytes.
fn whole(network: &Network, target: &Target, most: u64, stop: &Stop) -> Result<Vec<u8>, Error> {
    let mut patience = network.patience(target, stop);
    loop {
        match try_whole(network, target, most, stop) {
            Ok(bytes) => return Ok(bytes),
            Err(fault) => patience.after(fault)?,
        }
    }
}

fn try_whole(network: &Network, target: &Target, most: u64, stop: &Stop) -> Result<Vec<u8>, Fault> {
    let shown = target.address.shown();
    let response = network.get(target, &Ask::Whole)?;
    if response.status() != 200 {
        return Err(Fault::last("the server sends a part of what was asked for; check the address"));
    }
    let compressed = match compression(response.headers()) {
        None => false,
        Some("gzip" | "x-gzip") => true,
        Some(_) => {
            return Err(Fault::last("the server compresses it in a way that it was not asked for; tell its owner"));
        }
    };
    if announces_more(&response, most) {
        return Err(too_large(shown, most).into());
    }
    check_memory("a file of a tree", length(response.headers()).unwrap_or(0))?;
    let mut bytes = Vec::new();
    if !network.body(response, target, &mut bytes, most, stop)? {
        return Err(too_large(shown, most).into());
    }
    if !compressed {
        return Ok(bytes);
    }
    let mut plain = Vec::new();
    let unpacked = MultiGzDecoder::new(&bytes[..]).take(most.saturating_add(1)).read_to_end(&mut plain);
    unpacked.map_err(|_| Fault::last("what the server compressed is damaged; try again"))?;
    if plain.len() as u64 > most { Err(too_large(shown, most).into()) } else { Ok(plain) }
}

fn too_large(shown: &str, most: u64) -> Error {
    Error::unsupported(shown.as_ref(), format!("it has more than the {most} bytes that such a file may have"))
}
