//! Compiled pipelines kept in a file of the user's cache, for the next start. Only Vulkan hands them out.

use std::hash::{DefaultHasher, Hasher as _};
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use autosplats_cloud::{read_small, write_whole};

/// Most bytes of a file that is read.
const MOST_BYTES: u64 = 256 << 20;
/// Begins each file; the checksum of the rest follows.
const MARK: &[u8; 8] = b"asplpipe";
/// Bytes of a checksum.
const SUM_BYTES: usize = size_of::<u64>();

/// The pipelines of a device, as its driver stores them, and their file.
#[derive(Debug)]
pub(super) struct PipelineFile {
    cache: wgpu::PipelineCache,
    path: PathBuf,
    /// Checksum of what the file has; `None` without a usable file.
    stored: Mutex<Option<u64>>,
}

impl PipelineFile {
    /// The pipelines of a device, from its file in `folder` if that is there and whole. `None` if the device does not
    /// hand them out.
    #[allow(unsafe_code, reason = "a driver takes bytes on trust")]
    pub(super) fn open(device: &wgpu::Device, folder: &Path) -> Option<Self> {
        if !device.features().contains(wgpu::Features::PIPELINE_CACHE) {
            return None;
        }
        let path = folder.join(wgpu::util::pipeline_cache_key(&device.adapter_info())?);
        let file = read_small(&path, MOST_BYTES).unwrap_or_default();
        let data = unsealed(&file);
        let descriptor = wgpu::PipelineCacheDescriptor { label: Some("autosplats.pipelines"), data, fallback: true };
        // SAFETY: the checksum shows that these are the bytes that a device gave. Those of another device or driver are
        // told by their header and left aside.
        let cache = unsafe { device.create_pipeline_cache(&descriptor) };
        Some(Self { cache, path, stored: Mutex::new(data.map(checksum)) })
    }

    pub(super) fn cache(&self) -> &wgpu::PipelineCache {
        &self.cache
    }

    /// Writes the file if there are pipelines that it does not have.
    ///
    /// # Errors
    /// Those of the operating system.
    pub(super) fn store(&self) -> std::io::Result<()> {
        let Some(data) = self.cache.get_data() else { return Ok(()) };
        let mut stored = self.stored.lock().unwrap_or_else(PoisonError::into_inner);
        let sum = checksum(&data);
        if *stored == Some(sum) {
            return Ok(());
        }
        if let Some(folder) = self.path.parent() {
            std::fs::create_dir_all(folder)?;
        }
        write_whole(
            &self.path,
            |error| error,
            |file| {
                file.write_all(MARK)?;
                file.write_all(&sum.to_le_bytes())?;
                file.write_all(&data)
            },
        )?;
        *stored = Some(sum);
        Ok(())
    }
}

/// The bytes that a file was made of; `None` if it is none of ours, or damaged.
fn unsealed(file: &[u8]) -> Option<&[u8]> {
    let (sum, data) = file.strip_prefix(MARK)?.split_at_checked(SUM_BYTES)?;
    (sum == checksum(data).to_le_bytes()).then_some(data)
}

fn checksum(data: &[u8]) -> u64 {
    let mut hasher = DefaultHasher::new();
    hasher.write(data);
    hasher.finish()
}

/// The folder of the user's cache for this program, where the system has one.
pub(super) fn cache_folder() -> Option<PathBuf> {
    let folder = |name: &str| std::env::var_os(name).map(PathBuf::from).filter(|folder| folder.is_absolute());
    let all = if cfg!(windows) {
        folder("LOCALAPPDATA")
    } else {
        folder("XDG_CACHE_HOME").or_else(|| folder("HOME").map(|home| home.join(".cache")))
    };
    all.map(|all| all.join("autosplats"))
}

#[cfg(test)]
mod tests {
    use super::super::{Library, Pass, PassSource, test_gpu};
    use super::*;

    const LIBRARY: Library = Library { files: &[], constants: &[] };
    const CODE: &str = "@group(0) @binding(0) var<storage, read_write> x: array<u32>;\n\
                        @compute @workgroup_size(1) fn count() { x[0] += 3u; }";

    #[test]
    fn only_whole_files_are_taken() {
        let data = b"compiled";
        let whole = [&MARK[..], &checksum(data).to_le_bytes(), data].concat();
        assert_eq!(unsealed(&whole), Some(&data[..]));
        for len in 0..whole.len() {
            assert_eq!(unsealed(&whole[..len]), None, "the first {len} bytes");
        }
        for at in 0..whole.len() {
            let mut damaged = whole.clone();
            damaged[at] ^= 4;
            assert_eq!(unsealed(&damaged), None, "byte {at} is another");
        }
    }

    #[test]
    fn a_file_is_made_and_damage_is_mended() {
        let Some(gpu) = test_gpu() else { return };
        if !gpu.device.features().contains(wgpu::Features::PIPELINE_CACHE) {
            return eprintln!("nothing checked: the device hands out no pipelines");
        }
        let folder = std::env::temp_dir().join(format!("autosplats-pipelines-{}", std::process::id()));
        let inner = folder.join("deep");
        let compile = || {
            let file = PipelineFile::open(&gpu.device, &inner).expect("the device hands out pipelines");
            let mut gpu = gpu.clone();
            (gpu.pipelines, gpu.compiled) = (Some(file.into()), Default::default());
            let source = PassSource { path: "count", source: CODE, needs: wgpu::Features::empty(), library: &LIBRARY };
            Pass::new(&gpu, &source, &[]).expect("a pass");
            let file = gpu.pipelines.expect("a file");
            file.store().expect("it is written");
            file.path.clone()
        };
        let path = compile();
        let whole = std::fs::read(&path).expect("a file");
        assert!(unsealed(&whole).is_some_and(|data| !data.is_empty()), "it has what the driver gave");
        // Another format, a foreign header behind a right checksum, a cut.
        let foreign = b"not what any driver gives".repeat(9);
        let sealed = [&MARK[..], &checksum(&foreign).to_le_bytes(), &foreign].concat();
        for bad in [&foreign[..], &sealed, &whole[..whole.len() / 2], &[]] {
            std::fs::write(&path, bad).expect("room");
            assert_eq!(compile(), path, "the same file");
            assert!(unsealed(&std::fs::read(&path).expect("a file")).is_some_and(|data| data != foreign), "mended");
        }
        std::fs::remove_dir_all(&folder).expect("it is ours");
    }
}
