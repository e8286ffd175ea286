//! The most memory the process has held.

/// Largest resident memory of the process since its start or [`reset_peak_memory`] [bytes]; `None` where the system does not
/// tell (it does on Linux).
pub fn peak_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kib: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kib * 1024)
}

/// Makes [`peak_memory`] start again from what is held now. Whether that worked.
pub fn reset_peak_memory() -> bool {
    std::fs::write("/proc/self/clear_refs", "5").is_ok()
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn the_peak_grows_with_what_is_held() {
        let before = peak_memory().expect("Linux tells");
        let held = std::hint::black_box(vec![1u8; 64 << 20]);
        // The system counts in batches of pages per thread.
        assert!(peak_memory().expect("Linux tells") > before.max(held.len() as u64) * 9 / 10);
    }
}
