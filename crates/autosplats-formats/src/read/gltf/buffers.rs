//! The buffers of a glTF: in the file, in its text, or in files beside it.

use std::borrow::Cow;
use std::path::{Component, Path, PathBuf};

use autosplats_cloud::{Bytes, Error, excerpt, guard};
use base64::{Engine as _, alphabet, engine};
use serde::Deserialize;

use super::super::Job;
use super::json::{Container, Root};

/// Base64 with optional padding, which some programs leave out.
const BASE64: engine::GeneralPurpose = engine::GeneralPurpose::new(
    &alphabet::STANDARD,
    engine::GeneralPurposeConfig::new().with_decode_padding_mode(engine::DecodePaddingMode::Indifferent),
);

/// Longest file name with folders, in bytes.
const MAX_NAME: usize = 1024;

/// The loaded buffers.
pub(super) struct Buffers<'a> {
    loaded: Vec<Option<Data<'a>>>,
}

enum Data<'a> {
    Inside(&'a [u8]),
    Decoded(Vec<u8>),
    Beside(Bytes),
}

impl Data<'_> {
    fn bytes(&self) -> &[u8] {
        match self {
            Self::Inside(bytes) => bytes,
            Self::Decoded(bytes) => bytes,
            Self::Beside(bytes) => bytes,
        }
    }
}

impl<'a> Buffers<'a> {
    /// Loads the buffers with the indices `wanted`.
    pub(super) fn load(
        job: &Job<'_>,
        root: &Root<'a>,
        chunk: Option<&'a [u8]>,
        wanted: impl Iterator<Item = usize>,
    ) -> Result<Self, Error> {
        let mut loaded: Vec<Option<Data<'a>>> = root.buffers.iter().map(|_| None).collect();
        for index in wanted {
            let place = || format!("buffer {index}");
            let (Some(buffer), Some(data)) = (root.buffers.get(index), loaded.get_mut(index)) else {
                return Err(job.malformed(place(), "there is no such buffer; export the file again"));
            };
            if data.is_some() {
                continue;
            }
            let found = match &buffer.uri {
                Some(uri) => match uri.strip_prefix("data:") {
                    Some(data) => Data::Decoded(decode(job, &place(), data)?),
                    None => Data::Beside(beside(job, &place(), uri)?),
                },
                None if index == 0 && chunk.is_some() => Data::Inside(chunk.unwrap_or_default()),
                None => return Err(job.malformed(place(), "its bytes are missing; export the file again")),
            };
            let len = found.bytes().len();
            if len < buffer.byte_length {
                let what = format!("it has {len} of {} bytes; it is cut off, copy it again", buffer.byte_length);
                return Err(job.malformed(place(), what));
            }
            *data = Some(found);
        }
        Ok(Self { loaded })
    }

    pub(super) fn get(&self, index: usize) -> Option<&[u8]> {
        self.loaded.get(index)?.as_ref().map(Data::bytes)
    }

    /// What was made of the buffers, unless one of the other files changed meanwhile.
    pub(super) fn checked<T>(&self, made: Result<T, Error>) -> Result<T, Error> {
        self.loaded.iter().flatten().fold(made, |made, data| match data {
            Data::Beside(bytes) => bytes.checked(made),
            _ => made,
        })
    }

    /// Bytes of all buffers in other files.
    pub(super) fn len_beside(&self) -> usize {
        let beside = |data: &Data<'_>| if let Data::Beside(bytes) = data { bytes.len() } else { 0 };
        self.loaded.iter().flatten().map(beside).sum()
    }
}

/// Decodes a URI after its `data:`.
fn decode(job: &Job<'_>, place: &str, uri: &str) -> Result<Vec<u8>, Error> {
    let Some((kind, content)) = uri.split_once(',') else {
        return Err(job.malformed(place, "its URI 'data:' has no comma; export the file again"));
    };
    if !kind.ends_with(";base64") {
        return Ok(percent_decoded(content));
    }
    job.check_memory(content.len(), 1)?;
    let decoded = guard(|| BASE64.decode(content).map_err(|error| format!("it is not base64: {error}")));
    decoded.map_err(|what| job.malformed(place, format!("{what}; export the file again")))
}

/// What a glTF has in other files.
#[derive(Deserialize)]
struct Links<'a> {
    #[serde(default, borrow)]
    buffers: Vec<Link<'a>>,
    #[serde(default, borrow)]
    images: Vec<Link<'a>>,
}

#[derive(Deserialize)]
struct Link<'a> {
    #[serde(borrow)]
    uri: Option<Cow<'a, str>>,
}

/// Paths of the files that hold the buffers and images of a glTF.
pub(in super::super) fn linked(job: &Job<'_>) -> Result<Vec<PathBuf>, Error> {
    let container = Container::open(job)?;
    let links = guard(|| serde_json::from_slice::<Links<'_>>(container.json).map_err(|error| error.to_string()));
    let Links { buffers, images } = links.map_err(|what| job.malformed("JSON", what))?;
    let uris = buffers.iter().chain(&images).filter_map(|link| link.uri.as_deref());
    let decoded = uris.filter(|uri| !uri.starts_with("data:")).map(percent_decoded);
    Ok(decoded.map(|name| folder(job).join(&*String::from_utf8_lossy(&name))).collect())
}

fn folder<'a>(job: &Job<'a>) -> &'a Path {
    job.path.parent().unwrap_or(Path::new(""))
}

/// Opens a file in the same folder or below it. Other places are never opened, whatever the file says.
fn beside(job: &Job<'_>, place: &str, uri: &str) -> Result<Bytes, Error> {
    let decoded = percent_decoded(uri);
    let name = String::from_utf8_lossy(&decoded);
    let relative = Path::new(&*name);
    let inside = relative.components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
    // The name appears in messages unchanged.
    let fit = name.len() <= MAX_NAME && !name.contains(|c: char| c.is_control() || matches!(c, ':' | '\\'));
    if !inside || name.is_empty() || !fit {
        let what =
            format!("it is at '{}', and only files beside this one are read; put it there", excerpt(uri.as_bytes()));
        return Err(job.malformed(place, what));
    }
    let path: PathBuf = folder(job).join(relative);
    let metadata = std::fs::metadata(&path).map_err(|source| Error::Io { path: path.clone(), source })?;
    if !metadata.is_file() {
        return Err(job.malformed(place, format!("'{}' is not a file", excerpt(uri.as_bytes()))));
    }
    Bytes::open(&path)
}

fn percent_decoded(text: &str) -> Vec<u8> {
    let digit = |byte: Option<&u8>| byte.and_then(|&byte| char::from(byte).to_digit(16));
    let bytes = text.as_bytes();
    let mut decoded = Vec::with_capacity(bytes.len());
    let mut at = 0;
    while at < bytes.len() {
        match (bytes[at], digit(bytes.get(at + 1)), digit(bytes.get(at + 2))) {
            (b'%', Some(high), Some(low)) => {
                decoded.push((high * 16 + low) as u8);
                at += 3;
            }
            (byte, ..) => {
                decoded.push(byte);
                at += 1;
            }
        }
    }
    decoded
}

/// Indices of the buffers that hold the needed accessors.
pub(super) fn buffers_of(root: &Root<'_>, needed: Vec<bool>) -> impl Iterator<Item = usize> {
    let views = root.accessors.iter().zip(needed).filter(|(_, needed)| *needed).flat_map(|(accessor, _)| {
        let sparse = accessor.sparse.as_ref().map(|sparse| [sparse.indices.buffer_view, sparse.values.buffer_view]);
        accessor.buffer_view.into_iter().chain(sparse.into_iter().flatten())
    });
    // Buffers with compressed data only are skipped here; using them fails later with a message.
    let loadable = |view: usize| {
        let view = root.buffer_views.get(view)?;
        let nowhere = view.is_meshopt() && root.buffers.get(view.buffer).is_some_and(|buffer| buffer.uri.is_none());
        (!nowhere).then_some(view.buffer)
    };
    let mut buffers: Vec<usize> = views.filter_map(loadable).collect();
    buffers.sort_unstable();
    buffers.dedup();
    buffers.into_iter()
}
