//! Signals that ask a run to stop: the current step finishes, a checkpoint is saved, the program exits 0.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// A request to stop, set by a signal or by a test.
#[derive(Clone, Debug, Default)]
pub struct StopFlag(Arc<AtomicBool>);

impl StopFlag {
    /// A flag that Ctrl-C, SIGTERM, SIGHUP and SIGUSR1 set. A second Ctrl-C or SIGTERM ends the program at once; what
    /// comes before them, a terminal that closes or a cluster that is about to take the machine away, does not count.
    /// SIGHUP stays ignored where it was at the start, as under `nohup`.
    ///
    /// # Errors
    /// When the system refuses a signal handler.
    pub fn on_signals() -> io::Result<Self> {
        use signal_hook::consts::{SIGINT, SIGTERM};
        let (flag, impatience) = (Self::default(), Arc::new(AtomicBool::new(false)));
        for signal in [SIGINT, SIGTERM] {
            // In this order: the second signal finds the flag set and exits, the first one only sets it.
            signal_hook::flag::register_conditional_shutdown(signal, 130, impatience.clone())?;
            signal_hook::flag::register(signal, impatience.clone())?;
            signal_hook::flag::register(signal, flag.0.clone())?;
        }
        #[cfg(unix)]
        for signal in [signal_hook::consts::SIGHUP, signal_hook::consts::SIGUSR1] {
            if !is_ignored(signal) {
                signal_hook::flag::register(signal, flag.0.clone())?;
            }
        }
        Ok(flag)
    }

    /// Asks the run to stop.
    pub fn request(&self) {
        self.0.store(true, Ordering::SeqCst);
    }

    /// Whether a stop was asked for.
    pub fn requested(&self) -> bool {
        self.0.load(Ordering::SeqCst)
    }
}

/// Whether the process was started with this signal ignored.
#[cfg(unix)]
fn is_ignored(signal: i32) -> bool {
    // SAFETY: with no new action sigaction only writes the present one into `action`, for which all zeros are a valid value.
    unsafe {
        let mut action: libc::sigaction = std::mem::zeroed();
        libc::sigaction(signal, std::ptr::null(), &raw mut action) == 0
            && action.sa_sigaction == libc::SIG_IGN
    }
}
