//! Memory that one step frees is kept for the next.

/// Makes the C allocator keep what is freed instead of giving it back to the system.
///
/// By default it asks the system for every large tensor anew, and the system hands over each page of it zeroed and by an
/// interrupt: at width 128 that is two million interrupts in forty steps and a seventh of all processor time. Only where
/// the C library is GNU's; others are left as they are. Call it before any other thread exists.
pub fn keep_freed_memory() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    // SAFETY: `mallopt` sets numbers inside the allocator and touches no memory of ours.
    unsafe {
        libc::mallopt(libc::M_MMAP_MAX, 0);
        // −1: never trim.
        libc::mallopt(libc::M_TRIM_THRESHOLD, -1);
        libc::mallopt(libc::M_TOP_PAD, 64 << 20);
    }
}

/// Gives memory that is free, but kept, back to the system: for the end of a phase that needed more than what follows.
pub fn return_freed_memory() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    // SAFETY: `malloc_trim` touches only memory that the allocator holds and nobody uses.
    unsafe {
        libc::malloc_trim(0);
    }
}
