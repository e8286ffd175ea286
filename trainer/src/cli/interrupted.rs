//! Ctrl-C and SIGTERM while results are made: nothing half done is left behind.

/// Removes what is not finished and ends the program with 130 when a signal comes. Without a thread or a handler, which a
/// system may refuse, it stays, and its name says that it is temporary; so it is where there are no signals to wait for (Windows).
pub fn clear_up_on_signals() {
    #[cfg(unix)]
    wait_for_signals();
}

#[cfg(unix)]
fn wait_for_signals() {
    use clothcombo_data::format::atomic::remove_temporary;
    use signal_hook::consts::{SIGINT, SIGTERM};
    use signal_hook::iterator::Signals;

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
