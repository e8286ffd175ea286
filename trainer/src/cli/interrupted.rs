//! Ctrl-C and SIGTERM while results are made: nothing half done is left behind.

use clothcombo_data::format::atomic::remove_temporary;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::iterator::Signals;

/// Removes what is not finished and ends the program with 130 when a signal comes. Without a thread or a handler, which a
/// system may refuse, it stays, and its name says that it is temporary.
pub fn clear_up_on_signals() {
    if let Ok(mut signals) = Signals::new([SIGINT, SIGTERM]) {
        let wait = move || {
            if signals.forever().next().is_some() {
                remove_temporary();
                std::process::exit(130);
            }
        };
        let _ = std::thread::Builder::new().name("signals".to_owned()).spawn(wait);
    }
}
