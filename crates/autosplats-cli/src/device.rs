//! Devices of this machine.

use std::fs::read_to_string;

use autosplats::{AdapterSummary, Renderer};
use serde::Serialize;

/// Device that a picture was rendered on.
#[derive(Debug, Serialize)]
pub(crate) struct Device {
    pub(crate) backend: &'static str,
    pub(crate) name: String,
    pub(crate) threads: usize,
    pub(crate) simd: Vec<&'static str>,
    /// The graphics device; `None` on the CPU.
    pub(crate) adapter: Option<AdapterSummary>,
}

impl Device {
    /// The device of `renderer`.
    pub(crate) fn of(renderer: &Renderer) -> Self {
        match renderer.adapter() {
            Some(adapter) => Self { backend: "gpu", name: adapter.name.clone(), adapter: Some(adapter), ..Self::cpu() },
            None => Self::cpu(),
        }
    }

    /// The device in one line, for people.
    pub(crate) fn describe(&self) -> String {
        let Self { backend, name, threads, adapter, .. } = self;
        match adapter {
            None => format!("{backend}: {name}, {threads} threads"),
            Some(AdapterSummary { backend: api, driver, software, .. }) => {
                let timed = if *software { "; software on the CPU, waits after what is timed" } else { "" };
                format!("{backend}: {name}, {api}, driver {driver}{timed}")
            }
        }
    }

    /// The processor of this machine.
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
            adapter: None,
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
