//! Memory of this process and of the machine.

/// Memory of this process (bytes).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Memory {
    /// In use now.
    pub resident: u64,
    /// Most that was ever in use, or since [`Memory::reset_peak`].
    pub peak: u64,
}

impl Memory {
    /// What the system says now; `None` where it does not (only Linux does, in `/proc/self/status`).
    pub fn now() -> Option<Self> {
        let status = std::fs::read_to_string("/proc/self/status").ok()?;
        Some(Self { resident: kilobytes(&status, "VmRSS:")?, peak: kilobytes(&status, "VmHWM:")? })
    }

    /// Makes the peak start again from what is in use now. Whether that worked (on Linux it does).
    pub fn reset_peak() -> bool {
        std::fs::write("/proc/self/clear_refs", "5").is_ok()
    }
}

/// What the system can still give to this process (bytes): what it says is available, or what a control group (a container)
/// allows at most; `None` where it does not say.
pub fn available() -> Option<u64> {
    let free = std::fs::read_to_string("/proc/meminfo").ok();
    let free = free.and_then(|text| kilobytes(&text, "MemAvailable:"));
    let allowed = std::fs::read_to_string("/sys/fs/cgroup/memory.max").ok();
    let allowed = allowed.and_then(|text| text.trim().parse::<u64>().ok());
    free.into_iter().chain(allowed).min()
}

/// The field `name` of a text of `/proc`, which has it in kB (bytes).
fn kilobytes(text: &str, name: &str) -> Option<u64> {
    let line = text.lines().find_map(|l| l.strip_prefix(name))?;
    Some(line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()? * 1024)
}

/// Bytes as GiB or MiB.
pub(crate) fn gibibytes(bytes: u64) -> String {
    let mib = bytes as f64 / f64::from(1 << 20);
    if mib >= 1024.0 { format!("{:.2} GiB", mib / 1024.0) } else { format!("{mib:.0} MiB") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg(target_os = "linux")]
    fn the_system_says_how_much_is_in_use() {
        // Other tests of this process take and free memory meanwhile: only what is held here is sure.
        let block = vec![1_u8; 64 << 20];
        let now = Memory::now().unwrap();
        assert!(now.resident >= 60 << 20 && now.peak >= now.resident);
        assert_eq!(block.iter().map(|b| usize::from(*b)).sum::<usize>(), 64 << 20);
        assert!(available().unwrap() > 1 << 20);
    }
}
