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
/// Allocates no more than the chunk really contains, whatever it claims, and no more than points can be packed into.
pub(super) fn unpack<'a>(file: &'a [u8], chunk: &Chunk) -> Result<Cow<'a, [u8]>, String> {
    let data = file.get(chunk.data.clone()).ok_or("it does not lie within the file")?;
    if chunk.compression.is_empty() || chunk.compression == "none" {
        if chunk.size != data.len() as u64 && chunk.cut.is_none() {
            return Err(format!("it has {} bytes but claims {}", data.len(), chunk.size));
        }
        check(data, chunk)?;
        return Ok(Cow::Borrowed(data));
    }
    let most = (data.len() as u64).saturating_mul(MAX_RATIO).clamp(PLAUSIBLE_BYTES, MAX_BYTES);
    if chunk.size > most {
        let (len, size) = (data.len(), chunk.size);
        return Err(format!("its {len} bytes claim to unpack to {size}, which is not believed; at most {most} are"));
    }
    check_memory("a chunk of the recording", chunk.size).map_err(|error| error.to_string())?;
    // Claims of a larger size count only as far as the data confirm them.
    let mut content = Vec::with_capacity((chunk.size as usize).min(data.len().saturating_mul(64)));
    let mut read = |decoder: &mut dyn Read| {
        let outcome = decoder.take(chunk.size).read_to_end(&mut content);
        if chunk.cut.is_some() { Ok(()) } else { outcome.map(drop).map_err(|error| error.to_string()) }
    };
    guard(|| match &*chunk.compression {
        "zstd" => read(&mut Streams::<Zstd<'_>>::new(data)),
        "lz4" => read(&mut lz4_flex::frame::FrameDecoder::new(data)),
        "bz2" => read(&mut Streams::<bzip2::bufread::BzDecoder<&[u8]>>::new(data)),
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

/// Bytes that any chunk may unpack to; writers close chunks at a few megabytes.
const PLAUSIBLE_BYTES: u64 = 64 << 20;

/// Bytes that a byte of a larger chunk may unpack to. Measured points do not compress so well.
const MAX_RATIO: u64 = 256;

/// Most bytes of a chunk, as of a file that comes through a pipe.
const MAX_BYTES: u64 = 1 << 30;

/// Fewest bytes that a stream unpacks to on average where several follow each other. Starting one takes megabytes, so
/// many without content would take forever.
const MIN_STREAM_BYTES: usize = 1 << 12;

/// Streams that may be shorter.
const FREE_STREAMS: usize = 16;

/// Maximum window of a frame in bytes. Large frames may ask for more.
const MAX_WINDOW_BYTES: u64 = 16 << 20;

/// Bytes decompressed at once.
const UNPACK_STEP_BYTES: usize = 1 << 17;

/// Zstandard frames.
type Zstd<'a> = ruzstd::decoding::StreamingDecoder<&'a [u8], ruzstd::decoding::FrameDecoder>;

/// A decoder of one compressed stream.
trait Decoder<'a>: Read + Sized {
    /// Starts a stream of the bytes, which may go on with other streams.
    fn start(data: &'a [u8]) -> std::io::Result<Self>;

    /// The bytes behind the stream.
    fn rest(self) -> &'a [u8];
}

impl<'a> Decoder<'a> for Zstd<'a> {
    fn start(data: &'a [u8]) -> std::io::Result<Self> {
        let most = MAX_WINDOW_BYTES.max((data.len() as u64) << 14);
        Self::new_with_max_window_size(data, most).map_err(std::io::Error::other)
    }

    fn rest(self) -> &'a [u8] {
        self.into_inner()
    }
}

impl<'a> Decoder<'a> for bzip2::bufread::BzDecoder<&'a [u8]> {
    fn start(data: &'a [u8]) -> std::io::Result<Self> {
        Ok(Self::new(data))
    }

    fn rest(self) -> &'a [u8] {
        self.into_inner()
    }
}

/// Compressed streams one after the other.
struct Streams<'a, D> {
    data: &'a [u8],
    stream: Option<Box<D>>,
    started: usize,
    unpacked: usize,
}

impl<'a, D> Streams<'a, D> {
    fn new(data: &'a [u8]) -> Self {
        Self { data, stream: None, started: 0, unpacked: 0 }
    }
}

impl<'a, D: Decoder<'a>> Read for Streams<'a, D> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        loop {
            if let Some(mut stream) = self.stream.take() {
                // A stream that is cut off loses at most this many bytes.
                let len = buffer.len().min(UNPACK_STEP_BYTES);
                let read = stream.read(&mut buffer[..len])?;
                self.unpacked += read;
                if read > 0 || buffer.is_empty() {
                    self.stream = Some(stream);
                    return Ok(read);
                }
                self.data = stream.rest();
            }
            if self.data.is_empty() {
                return Ok(0);
            }
            if self.started > FREE_STREAMS + self.unpacked / MIN_STREAM_BYTES {
                return Err(std::io::Error::other("it has many compressed streams with nothing in them"));
            }
            self.started += 1;
            self.stream = Some(Box::new(D::start(self.data)?));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chunk(compression: &str, data: &[u8], size: u64) -> Result<usize, String> {
        let compression = compression.to_owned();
        let chunk = Chunk { data: 0..data.len(), size, crc: 0, compression, cut: None };
        unpack(data, &chunk).map(|content| content.len())
    }

    #[test]
    fn chunks_unpack_to_what_points_could_be() {
        let packed = vec![7; 1 << 20];
        for (size, is_believed) in [(MAX_RATIO << 20, true), ((MAX_RATIO << 20) + 1, false), (u64::MAX, false)] {
            let told = chunk("zstd", &packed, size).expect_err("it is no stream");
            assert_eq!(!told.contains("is not believed"), is_believed, "{size}: {told}");
        }
        let told = chunk("bz2", &[0; 99], PLAUSIBLE_BYTES + 1).expect_err("99 bytes");
        assert!(told.contains("its 99 bytes claim to unpack to 67108865, which is not believed"), "{told}");
    }

    #[test]
    fn streams_without_content_end() {
        let empty = b"BZh9\x17\x72\x45\x38\x50\x90\0\0\0\0";
        let told = chunk("bz2", &empty.repeat(1 << 20), 5).expect_err("nothing is in it");
        assert!(told.contains("many compressed streams with nothing in them"), "{told}");
        let few = chunk("bz2", &empty.repeat(3), 5).expect_err("too little is in it");
        assert!(few.contains("unpacks to 0 bytes but claims 5"), "{few}");
    }
}
