//! Chunks of a recording, usually compressed.

use std::{borrow::Cow, io::Read, ops::Range};

use autosplats_cloud::{check_memory, excerpt, guard};

use crate::wire::Fault;

/// A sequence of records that is compressed as a whole.
#[derive(Clone, Debug)]
pub(super) struct Chunk {
    /// Range of the file that holds the chunk's data, compressed.
    pub(super) data: Range<usize>,
    /// Size after decompression in bytes, as claimed by the file.
    pub(super) size: u64,
    /// CRC-32 of the decompressed data; 0 if unknown.
    pub(super) crc: u32,
    pub(super) compression: String,
    /// The fault, if the file ends inside the chunk.
    pub(super) cut: Option<Fault>,
}

/// The records of a chunk. A chunk that is cut off gives what can be decompressed, perhaps not whole records.
///
/// Allocates no more than the chunk really contains, whatever it claims.
pub(super) fn unpack<'a>(file: &'a [u8], chunk: &Chunk) -> Result<Cow<'a, [u8]>, String> {
    let data = file.get(chunk.data.clone()).ok_or("it does not lie within the file")?;
    if chunk.compression.is_empty() || chunk.compression == "none" {
        if chunk.size != data.len() as u64 && chunk.cut.is_none() {
            return Err(format!("it has {} bytes but claims {}", data.len(), chunk.size));
        }
        check(data, chunk)?;
        return Ok(Cow::Borrowed(data));
    }
    check_memory("a chunk of the recording", chunk.size).map_err(|error| error.to_string())?;
    // Claims of a larger size count only as far as the data confirm them.
    let mut content = Vec::with_capacity((chunk.size as usize).min(data.len().saturating_mul(64)));
    let mut read = |decoder: &mut dyn Read| {
        let outcome = decoder.take(chunk.size).read_to_end(&mut content);
        if chunk.cut.is_some() { Ok(()) } else { outcome.map(drop).map_err(|error| error.to_string()) }
    };
    guard(|| match &*chunk.compression {
        "zstd" => read(&mut Zstd { data, frame: None }),
        "lz4" => read(&mut lz4_flex::frame::FrameDecoder::new(data)),
        "bz2" => read(&mut bzip2::read::MultiBzDecoder::new(data)),
        other => Err(format!("it is compressed by '{}', which is not read", excerpt(other.as_bytes()))),
    })?;
    if content.len() as u64 != chunk.size && chunk.cut.is_none() {
        return Err(format!("it unpacks to {} bytes but claims {}", content.len(), chunk.size));
    }
    check(&content, chunk)?;
    Ok(Cow::Owned(content))
}

fn check(content: &[u8], chunk: &Chunk) -> Result<(), String> {
    if chunk.crc == 0 || chunk.cut.is_some() || crc32fast::hash(content) == chunk.crc {
        Ok(())
    } else {
        Err("its checksum is wrong; the file is damaged, copy it again".into())
    }
}

/// Consecutive Zstandard frames.
struct Zstd<'a> {
    data: &'a [u8],
    frame: Option<Box<ruzstd::decoding::StreamingDecoder<&'a [u8], ruzstd::decoding::FrameDecoder>>>,
}

/// Maximum window of a frame in bytes. Large frames may ask for more.
const MAX_WINDOW_BYTES: u64 = 16 << 20;

/// Bytes decompressed at once.
const UNPACK_STEP_BYTES: usize = 1 << 17;

impl Read for Zstd<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        use ruzstd::decoding::StreamingDecoder;
        loop {
            if let Some(mut frame) = self.frame.take() {
                // A frame that is cut off loses at most this many bytes.
                let len = buffer.len().min(UNPACK_STEP_BYTES);
                let read = frame.read(&mut buffer[..len])?;
                if read > 0 || buffer.is_empty() {
                    self.frame = Some(frame);
                    return Ok(read);
                }
                self.data = frame.into_inner();
            }
            if self.data.is_empty() {
                return Ok(0);
            }
            let most = MAX_WINDOW_BYTES.max((self.data.len() as u64) << 14);
            let frame = StreamingDecoder::new_with_max_window_size(self.data, most).map_err(std::io::Error::other)?;
            self.frame = Some(Box::new(frame));
        }
    }
}
