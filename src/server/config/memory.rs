//! The memory that this process may use by default: three quarters of its container's limit (if that is
//! less than the machine has), or else half of the machine's memory. If neither is known, as on other
//! systems than Linux, it is 4 GiB. It is at least 64 MiB.

use std::fs::read_to_string;
use std::path::{Path, PathBuf};

/// Bytes where the system says nothing.
const UNKNOWN_BYTES: u64 = 4 << 30;

/// The least that is worth a start: a small job, and room for its upload.
const LEAST_BYTES: u64 = 64 << 20;

/// Bytes for `memory-bytes`. The rest is for what no account counts: the program, connections, threads, the allocator.
pub fn memory_bytes(configured: u64) -> u64 {
    if configured > 0 {
        return configured;
    }
    let machine = machine_bytes();
    let container = cgroup_bytes(&read_to_string("/proc/self/cgroup").unwrap_or_default(), Path::new("/sys/fs/cgroup"));
    by_default(machine, container)
}

fn by_default(machine: Option<u64>, container: Option<u64>) -> u64 {
    let container = container.filter(|limit| machine.is_none_or(|machine| *limit < machine)).map(|limit| limit / 4 * 3);
    container.or(machine.map(|machine| machine / 2)).unwrap_or(UNKNOWN_BYTES).max(LEAST_BYTES)
}

/// Memory of the machine. None where the system does not say.
fn machine_bytes() -> Option<u64> {
    let text = read_to_string("/proc/meminfo").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("MemTotal:"))?;
    line.split_whitespace().next()?.parse::<u64>().ok()?.checked_mul(1024)
}

/// The smallest limit of the control groups of this process, of version 2 or 1. None: there is none. `groups` is what
/// /proc/self/cgroup says.
fn cgroup_bytes(groups: &str, root: &Path) -> Option<u64> {
    let limits = groups.lines().flat_map(|line| {
        let mut parts = line.splitn(3, ':').skip(1);
        let (controllers, path) = (parts.next().unwrap_or_default(), parts.next().unwrap_or_default());
        let (root, file) = match controllers {
            "" => (root.to_owned(), "memory.max"),
            all if all.split(',').any(|one| one == "memory") => (root.join("memory"), "memory.limit_in_bytes"),
            _ => return Vec::new(),
        };
        limits_up(&root, path.trim_start_matches('/'), file)
    });
    limits.min()
}

/// The limits of a group and of those that contain it. In a container, its own group may be the root.
fn limits_up(root: &Path, path: &str, file: &str) -> Vec<u64> {
    let group: PathBuf = root.join(path);
    let folders = group.ancestors().take_while(|folder| folder.starts_with(root));
    folders.filter_map(|folder| read_to_string(folder.join(file)).ok()?.trim().parse().ok()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_container_counts_more_than_the_machine() {
        assert_eq!(by_default(Some(16 << 30), Some(1 << 30)), 768 << 20);
        assert_eq!(by_default(Some(16 << 30), None), 8 << 30);
        // Version 1 says a huge number where there is no limit.
        assert_eq!(by_default(Some(16 << 30), Some(u64::MAX >> 1)), 8 << 30);
        assert_eq!(by_default(None, None), UNKNOWN_BYTES);
        assert_eq!(by_default(Some(1 << 20), None), LEAST_BYTES);
        assert_eq!(memory_bytes(123), 123);
    }

    #[test]
    fn the_smallest_limit_of_the_groups_counts() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        let write = |path: &str, text: &str| {
            std::fs::create_dir_all(root.join(path).parent().unwrap()).unwrap();
            std::fs::write(root.join(path), text).unwrap();
        };
        write("a/memory.max", "3000\n");
        write("a/b/memory.max", "max\n");
        write("memory/x/memory.limit_in_bytes", "5000\n");
        write("memory/memory.limit_in_bytes", "9223372036854771712\n");
        for (groups, expected) in [
            ("0::/a/b\n", Some(3000)),
            ("0::/\n", None),
            ("12:cpu,memory:/x\n", Some(5000)),
            ("12:cpu:/x\n", None),
            ("0::/a\n5:memory:/x\n", Some(3000)),
            ("0::/../../etc\n", None),
            ("nonsense", None),
        ] {
            assert_eq!(cgroup_bytes(groups, root), expected, "{groups}");
        }
    }
}
