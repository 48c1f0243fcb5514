//! Available memory.

mod limits;

use std::{fs::read_to_string, path::Path, sync::OnceLock};

use self::limits::{Groups, address_space};
use crate::Error;

/// Bytes that can be allocated without swapping, and within the limits of this process: its control groups of either
/// version (containers, services, batch jobs) and its address space (`ulimit -v`). `None` if the system states nothing.
pub fn available_memory() -> Option<u64> {
    let root = Path::new("/");
    let group = groups().room().map(|[_, free]| free);
    [of_machine(root, "MemAvailable:"), group, address_space(root)].into_iter().flatten().min()
}

/// Bytes of memory of the machine, or of the control groups of this process if they allow less (Linux only).
pub fn total_memory() -> Option<u64> {
    let limit = groups().room().map(|[limit, _]| limit);
    of_machine(Path::new("/"), "MemTotal:").map(|total| limit.map_or(total, |limit| total.min(limit)))
}

/// The groups of this process. That it moves to another one while it runs is rare.
fn groups() -> &'static Groups {
    static GROUPS: OnceLock<Groups> = OnceLock::new();
    GROUPS.get_or_init(|| Groups::of_process(Path::new("/")))
}

/// A number of bytes that the system states of its memory (Linux only).
fn of_machine(root: &Path, name: &str) -> Option<u64> {
    let meminfo = read_to_string(root.join("proc/meminfo")).ok()?;
    let kibibytes = meminfo.lines().find_map(|line| line.strip_prefix(name)?.trim().strip_suffix(" kB"))?;
    kibibytes.parse::<u64>().ok()?.checked_mul(1024)
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
/// to 2 GiB. It is never more than half of what is available.
pub fn usual_memory() -> u64 {
    let available = available_memory().unwrap_or(4 * USUAL[1]);
    (available / 4).clamp(USUAL[0], USUAL[1]).min(available / 2)
}

/// Requests up to this size, in bytes, are not checked: asking the system takes longer than reading such a file.
const SMALL: u64 = 8 << 20;

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
