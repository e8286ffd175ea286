//! What happens when nobody reads the output any more: `clothcombo runs runs | head`.

/// Ends the process quietly when it writes to a pipe that was closed, as other programs do; by default Rust makes an error of
/// it, which `println!` turns into a panic. Not for training, which must not end because of what it prints.
pub fn end_quietly() {
    #[cfg(unix)]
    // SAFETY: restores the system's own handling of a signal; no handler of ours is involved.
    unsafe {
        libc::signal(libc::SIGPIPE, libc::SIG_DFL);
    }
}
