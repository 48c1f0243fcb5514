//! Limits of the memory of a process: of its control groups, in both versions, and of its address space.

use std::{
    fs::read_to_string,
    path::{Path, PathBuf},
};

/// Folders of the control groups that a process is in, from its own to the outermost one that is visible.
pub(super) struct Groups(Vec<Group>);

/// A control group with a limit of memory.
enum Group {
    /// Of cgroup version 1.
    First(PathBuf),
    /// Of cgroup version 2.
    Second(PathBuf),
}

impl Groups {
    /// Those of this process, as `/proc` below `root` tells.
    pub(super) fn of_process(root: &Path) -> Self {
        let text = |name: &str| read_to_string(root.join(name)).unwrap_or_default();
        let (own, mounts) = (text("proc/self/cgroup"), text("proc/self/mountinfo"));
        // Lines of `cgroup` are `number:controllers:path`, without controllers for version 2.
        let path_of = |is_wanted: fn(&str) -> bool| {
            let mut lines = own.lines().filter_map(|line| line.split_once(':')?.1.split_once(':'));
            lines.find(|(controllers, _)| is_wanted(controllers)).map(|(_, path)| path)
        };
        let first = path_of(|controllers| controllers.split(',').any(|controller| controller == "memory"));
        let second = path_of(str::is_empty);
        let mut groups = Vec::new();
        for mount in mounts.lines().filter_map(Mount::of) {
            let (path, group): (_, fn(PathBuf) -> Group) = match mount.kind {
                "cgroup2" => (second, Group::Second),
                "cgroup" if mount.options.split(',').any(|option| option == "memory") => (first, Group::First),
                _ => continue,
            };
            let Some(path) = path else { continue };
            // In a container the path may be that outside, of which only a part is mounted, or lead out of what is.
            let inner = Path::new(path).strip_prefix(mount.root).unwrap_or(Path::new(""));
            let outer = root.join(mount.point.trim_start_matches('/'));
            let inner = if path.contains("..") { Path::new("") } else { inner };
            groups.extend(inner.ancestors().map(|inner| group(outer.join(inner))));
        }
        Self(groups)
    }

    /// Bytes that all groups allow, and bytes that they leave; `None` without a limit.
    pub(super) fn room(&self) -> Option<[u64; 2]> {
        let rooms = self.0.iter().filter_map(Group::room);
        rooms.reduce(|[limit, free], [other, left]| [limit.min(other), free.min(left)])
    }
}

impl Group {
    /// Bytes of the limit, and of it what is left.
    fn room(&self) -> Option<[u64; 2]> {
        let (folder, limits, used, cached): (_, &[&str], _, _) = match self {
            Self::First(folder) => {
                (folder, &["memory.limit_in_bytes"], "memory.usage_in_bytes", "total_inactive_file ")
            }
            Self::Second(folder) => (folder, &["memory.max", "memory.high"], "memory.current", "inactive_file "),
        };
        let text = |name: &str| read_to_string(folder.join(name)).ok();
        let number = |name: &str| text(name)?.trim().parse::<u64>().ok();
        // A file says "max", or a number beyond all memory, where there is no limit.
        let limit = limits.iter().filter_map(|name| number(name)).min()?;
        // What is kept of files counts as used, but is given back when memory is short.
        let stat = text("memory.stat").unwrap_or_default();
        let cached = stat.lines().find_map(|line| line.strip_prefix(cached)?.trim().parse::<u64>().ok()).unwrap_or(0);
        Some([limit, limit.saturating_sub(number(used).unwrap_or(0).saturating_sub(cached))])
    }
}

/// A line of `mountinfo`.
struct Mount<'a> {
    /// The folder of its file system that is mounted.
    root: &'a str,
    point: &'a str,
    kind: &'a str,
    options: &'a str,
}

impl<'a> Mount<'a> {
    fn of(line: &'a str) -> Option<Self> {
        let (place, system) = line.split_once(" - ")?;
        let mut place = place.split(' ').skip(3);
        let (root, point) = (place.next()?, place.next()?);
        let mut system = system.split(' ');
        let (kind, options) = (system.next()?, system.nth(1)?);
        Some(Self { root, point, kind, options })
    }
}

/// Bytes of address space that a limit of this process leaves (`ulimit -v`). `/proc` below `root` tells what is taken.
#[cfg(unix)]
pub(super) fn address_space(root: &Path) -> Option<u64> {
    let limit = rustix::process::getrlimit(rustix::process::Resource::As).current?;
    let status = read_to_string(root.join("proc/self/status")).ok()?;
    let taken = status.lines().find_map(|line| line.strip_prefix("VmSize:")?.trim().strip_suffix(" kB"))?;
    Some(limit.saturating_sub(taken.parse::<u64>().ok()?.saturating_mul(1024)))
}

#[cfg(not(unix))]
pub(super) fn address_space(_root: &Path) -> Option<u64> {
    None
}

#[cfg(test)]
mod tests {
    use std::fs::{create_dir_all, write};

    use super::*;

    /// What groups leave on a machine with these files.
    fn free(files: &[(&str, &str)]) -> Option<u64> {
        let root = tempfile::tempdir().expect("a folder");
        for (name, text) in files {
            let path = root.path().join(name);
            create_dir_all(path.parent().expect("a folder")).expect("made");
            write(path, text).expect("written");
        }
        Groups::of_process(root.path()).room().map(|[_, free]| free)
    }

    const SECOND: (&str, &str) =
        ("proc/self/mountinfo", "30 23 0:26 / /sys/fs/cgroup rw,nosuid shared:4 - cgroup2 cgroup2 rw,nsdelegate\n");
    const FIRST: (&str, &str) = (
        "proc/self/mountinfo",
        "31 30 0:27 / /sys/fs/cgroup/cpu rw shared:5 - cgroup cgroup rw,cpu\n\
         32 30 0:28 / /sys/fs/cgroup/memory rw shared:6 - cgroup cgroup rw,memory\n",
    );

    #[test]
    fn the_tightest_of_nested_groups_counts() {
        let own = ("proc/self/cgroup", "0::/user.slice/job.scope\n");
        let files = [
            SECOND,
            own,
            ("sys/fs/cgroup/user.slice/memory.max", "70000\n"),
            ("sys/fs/cgroup/user.slice/memory.current", "10000\n"),
            ("sys/fs/cgroup/user.slice/job.scope/memory.max", "max\n"),
            ("sys/fs/cgroup/user.slice/job.scope/memory.current", "9000\n"),
        ];
        assert_eq!(free(&files), Some(60_000), "the outer one has a limit");
        let inner = ("sys/fs/cgroup/user.slice/job.scope/memory.max", "19000\n");
        assert_eq!(free(&[&files[..4], &[inner], &files[5..]].concat()), Some(10_000), "the inner one has less");
        let high = ("sys/fs/cgroup/user.slice/memory.high", "30000\n");
        assert_eq!(free(&[&files[..], &[high]].concat()), Some(20_000), "beyond it the system slows a process down");
        let stat = ("sys/fs/cgroup/user.slice/memory.stat", "anon 1\ninactive_file 4000\n");
        assert_eq!(free(&[&files[..], &[stat]].concat()), Some(64_000), "what is kept of files");
        assert_eq!(free(&files[..2]), None, "no limit anywhere");
    }

    #[test]
    fn version_one_has_a_folder_for_memory() {
        let own = ("proc/self/cgroup", "5:cpu:/other\n4:memory,hugetlb:/docker/abc\n");
        let limit = ("sys/fs/cgroup/memory/docker/abc/memory.limit_in_bytes", "5000\n");
        let used = ("sys/fs/cgroup/memory/docker/abc/memory.usage_in_bytes", "2000\n");
        let top = ("sys/fs/cgroup/memory/memory.limit_in_bytes", "9223372036854771712\n");
        assert_eq!(free(&[FIRST, own, limit, used, top]), Some(3000), "of two controllers together");
        // In a container the group is the mount, though its path is that outside.
        let mount =
            ("proc/self/mountinfo", "32 30 0:28 /docker/abc /sys/fs/cgroup/memory rw - cgroup cgroup rw,memory");
        let limit = ("sys/fs/cgroup/memory/memory.limit_in_bytes", "5000\n");
        assert_eq!(free(&[mount, own, limit]), Some(5000), "nothing is used");
        let out = ("proc/self/cgroup", "4:memory:/../other\n");
        assert_eq!(free(&[FIRST, out, limit]), Some(5000), "a path that leads out");
    }

    #[test]
    fn systems_without_groups() {
        assert_eq!(free(&[]), None, "no /proc");
        assert_eq!(free(&[("proc/self/cgroup", "nonsense\n\n:\n"), ("proc/self/mountinfo", " - \n- cgroup2")]), None);
    }
}
