//! What this machine is and has left.

use std::fs::read_to_string;

use serde::Serialize;

use crate::exit::{Exit, Failure};

/// What a picture was rendered on.
#[derive(Debug, Serialize)]
pub(crate) struct Device {
    backend: &'static str,
    name: String,
    threads: usize,
    simd: Vec<&'static str>,
}

impl Device {
    /// This machine's processor.
    pub(crate) fn cpu() -> Self {
        let name = read_to_string("/proc/cpuinfo").ok().and_then(|info| {
            let line = info.lines().find(|line| line.starts_with("model name"))?;
            Some(line.split_once(':')?.1.trim().to_owned())
        });
        Self {
            backend: "cpu",
            name: name.unwrap_or_else(|| std::env::consts::ARCH.into()),
            threads: rayon::current_num_threads(),
            simd: simd(),
        }
    }
}

#[cfg(any(target_arch = "x86_64", target_arch = "x86"))]
fn simd() -> Vec<&'static str> {
    let found = [
        ("sse4.2", is_x86_feature_detected!("sse4.2")),
        ("avx2", is_x86_feature_detected!("avx2")),
        ("fma", is_x86_feature_detected!("fma")),
        ("avx512f", is_x86_feature_detected!("avx512f")),
    ];
    found.into_iter().filter(|(_, present)| *present).map(|(name, _)| name).collect()
}

#[cfg(target_arch = "aarch64")]
fn simd() -> Vec<&'static str> {
    vec!["neon"]
}

#[cfg(not(any(target_arch = "x86_64", target_arch = "x86", target_arch = "aarch64")))]
fn simd() -> Vec<&'static str> {
    Vec::new()
}

/// Refuses a task that needs more memory than there is. Systems promise memory they do not have and then kill whoever
/// touches it, so asking first is the only way to fail with a message.
pub(crate) fn check_memory(task: &str, needed: u64) -> Result<(), Failure> {
    match available_memory() {
        Some(available) if needed > available => Err(Failure::new(
            Exit::Memory,
            format!("{task} needs about {} of memory, {} are free", gigabytes(needed), gigabytes(available)),
        )),
        _ => Ok(()),
    }
}

fn gigabytes(bytes: u64) -> String {
    format!("{:.1} GB", bytes as f64 / 1e9)
}

/// Bytes that can be allocated now, where the system says so (Linux).
fn available_memory() -> Option<u64> {
    let meminfo = read_to_string("/proc/meminfo").ok()?;
    let line = meminfo.lines().find(|line| line.starts_with("MemAvailable:"))?;
    let free = line.split_whitespace().nth(1)?.parse::<u64>().ok()? * 1024;
    // A container's own limit, if there is one ("max" if not).
    let bytes = |file: &str| read_to_string(file).ok()?.trim().parse::<u64>().ok();
    let limit = bytes("/sys/fs/cgroup/memory.max");
    let used = bytes("/sys/fs/cgroup/memory.current").unwrap_or(0);
    Some(limit.map_or(free, |limit| free.min(limit.saturating_sub(used))))
}
