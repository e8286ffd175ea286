//! Ctrl-C and SIGTERM while results are written: nothing half done is left behind.

use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::iterator::Signals;
use std::fs;
use std::path::Path;

/// Removes `temporary` and ends the program with 130 when a signal comes. Without a thread or a handler, which a system may
/// refuse, the folder stays, and its name says that it is temporary.
pub fn remove_on_signals(temporary: &Path) {
    let temporary = temporary.to_owned();
    if let Ok(mut signals) = Signals::new([SIGINT, SIGTERM]) {
        let wait = move || {
            if signals.forever().next().is_some() {
                let _ = fs::remove_dir_all(&temporary);
                std::process::exit(130);
            }
        };
        let _ = std::thread::Builder::new().name("signals".to_owned()).spawn(wait);
    }
}
