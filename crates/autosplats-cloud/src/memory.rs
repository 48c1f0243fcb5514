//! Available memory.

use std::fs::read_to_string;

use crate::Error;

/// Bytes that can be allocated without swapping, if the system states them (Linux only).
pub fn available_memory() -> Option<u64> {
    let meminfo = read_to_string("/proc/meminfo").ok()?;
    let line = meminfo.lines().find(|line| line.starts_with("MemAvailable:"))?;
    let free = line.split_whitespace().nth(1)?.parse::<u64>().ok()?.checked_mul(1024)?;
    // A container has its own limit; the file says "max" if there is none.
    let bytes = |file: &str| read_to_string(file).ok()?.trim().parse::<u64>().ok();
    let limit = bytes("/sys/fs/cgroup/memory.max");
    let used = bytes("/sys/fs/cgroup/memory.current").unwrap_or(0);
    Some(limit.map_or(free, |limit| free.min(limit.saturating_sub(used))))
}

/// Memory of this process in bytes, now and at most since it began, if the system states it (Linux only).
pub fn own_memory() -> Option<[u64; 2]> {
    let status = read_to_string("/proc/self/status").ok()?;
    let bytes = |name: &str| {
        let kibibytes = status.lines().find_map(|line| line.strip_prefix(name)?.trim().strip_suffix(" kB"))?;
        kibibytes.parse::<u64>().ok()?.checked_mul(1024)
    };
    let now = bytes("VmRSS:")?;
    // Each processor counts some pages of its own, so the system may state less than there is now.
    Some([now, bytes("VmHWM:")?.max(now)])
}

/// Bounds of [`usual_memory`].
const USUAL: [u64; 2] = [256 << 20, 2 << 30];

/// Memory in bytes for work of any size that may choose how much it takes: a quarter of what is available, from 256 MiB
/// to 2 GiB.
pub fn usual_memory() -> u64 {
    (available_memory().unwrap_or(USUAL[1]) / 4).clamp(USUAL[0], USUAL[1])
}

/// Requests up to this size, in bytes, are not checked: asking the system takes longer than reading such a file.
const SMALL: u64 = 64 << 20;

/// Fails if more memory is needed than is available. Systems promise memory that they do not have and then kill the
/// process that touches it. Only a check in advance fails with a message.
///
/// # Errors
/// [`Error::OutOfMemory`] with `what` and `bytes`.
///
/// # Examples
///
/// ```
/// use autosplats_cloud::{available_memory, check_memory};
///
/// check_memory("a small picture", 640 * 480 * 4)?;
/// if available_memory().is_some() {
///     assert!(check_memory("all points of the world", u64::MAX).is_err());
/// }
/// # Ok::<(), autosplats_cloud::Error>(())
/// ```
pub fn check_memory(what: &str, bytes: u64) -> Result<(), Error> {
    if bytes > SMALL && available_memory().is_some_and(|available| bytes > available) {
        return Err(Error::OutOfMemory { what: what.into(), bytes: usize::try_from(bytes).unwrap_or(usize::MAX) });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn own_memory_remembers_its_peak() {
        // Other tests take and free memory meanwhile.
        let bytes = vec![1_u8; 100 << 20];
        let Some([with, _]) = own_memory() else { return };
        assert!(with > 100 << 20, "{with} bytes with a vector of {}", bytes.len());
        drop(bytes);
        let [_, peak] = own_memory().expect("as before");
        // What processors count of their own is less than this.
        let uncounted = 8 << 20;
        assert!(peak + uncounted > with, "{peak} bytes at most, but {with} at once");
    }
}
