//! What happens when the output cannot be written: `clothcombo runs runs | head`, or a full disk behind `>`.

use std::io::Write;

/// Prints a line on stderr. Ignores errors: the results do not depend on messages about them.
pub fn print_stderr(line: impl std::fmt::Display) {
    let _ = writeln!(std::io::stderr(), "{line}");
}

/// Ends the process quietly when it writes to a pipe that was closed, as other programs do, and with one line when the system
/// refuses the output; by default Rust makes an error of both, which `println!` turns into a panic. Not for training, which must
/// not end because of what it prints.
pub fn end_quietly() {
    #[cfg(unix)]
    // SAFETY: restores the system's own handling of a signal; no handler of ours is involved.
    unsafe {
        libc::signal(libc::SIGPIPE, libc::SIG_DFL);
    }
    let usual = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |info| match info.payload_as_str() {
        Some(text) if text.starts_with("failed printing to stdout") => {
            print_stderr(text);
            std::process::exit(1);
        }
        _ => usual(info),
    }));
}
