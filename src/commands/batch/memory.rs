//! The memory of processes, as far as the system reports it.

/// Returns the memory of a process that is in RAM now, in bytes; `None` if it has ended, or the system does not report it (only
/// Linux does).
pub fn resident_bytes(process: u32) -> Option<u64> {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    let kilobytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kilobytes * 1024)
}

#[cfg(test)]
mod tests {
    #[cfg(target_os = "linux")]
    #[test]
    fn this_process_has_some_memory() {
        assert!(super::resident_bytes(std::process::id()).is_some_and(|bytes| bytes > 1 << 20));
        assert_eq!(super::resident_bytes(u32::MAX), None);
    }
}
