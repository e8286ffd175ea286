//! How much the programs say: the same flags for every verb.

use crate::system::closed_pipe::print_stderr;
use clap::{ArgAction, Args, ValueEnum};
use indicatif::{ProgressBar, ProgressFinish, ProgressStyle};
use std::io::IsTerminal;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use tracing_subscriber::EnvFilter;

/// Time between two pictures of a spinner.
const TICK: Duration = Duration::from_millis(200);

/// Belongs to the process, like the log.
static QUIET: AtomicBool = AtomicBool::new(false);

/// How log lines are written.
#[derive(Clone, Copy, Debug, Default, PartialEq, ValueEnum)]
enum LogFormat {
    #[default]
    Text,
    /// One JSON object a line
    Json,
}

/// How much is said.
#[derive(Args, Clone, Copy, Debug, Default)]
#[command(next_help_heading = "Messages")]
pub struct Verbosity {
    /// No progress, only errors
    #[arg(long, short, global = true)]
    quiet: bool,
    /// More log lines; twice for debugging (RUST_LOG overrides both)
    #[arg(long, short, global = true, action = ArgAction::Count)]
    verbose: u8,
    /// How log lines are written
    #[arg(long, global = true, value_name = "FORMAT", default_value = "text")]
    log_format: LogFormat,
}

impl Verbosity {
    /// The same, or quiet.
    pub fn or_quiet(self, quiet: bool) -> Self {
        Self { quiet: self.quiet || quiet, ..self }
    }

    /// Starts the log on stderr; `usual` is its filter where no flag is given.
    pub fn apply(self, usual: &str) {
        QUIET.store(self.quiet, Ordering::Relaxed);
        let default = match (self.quiet, self.verbose) {
            (true, _) => "error",
            (false, 0) => usual,
            (false, 1) => "info,clothcombo_trainer=debug",
            (false, _) => "debug",
        };
        // Hundreds of thousands of lines about the kernels of a GPU; RUST_LOG brings them back.
        let default = match self.quiet {
            true => default.to_owned(),
            false => format!(
                "{default},naga=warn,wgpu_core=warn,wgpu_hal=warn,cubecl_wgpu=warn,cubecl_runtime=warn"
            ),
        };
        let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new(default));
        // What it warns of, characters that the font of the pictures lacks, is seen in the pictures as boxes.
        let filter = filter.add_directive("usvg=error".parse().expect("it is a directive"));
        // A second call (tests run several sessions in one process) keeps the first subscriber.
        let log = tracing_subscriber::fmt()
            .with_env_filter(filter)
            .with_ansi(std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none())
            .with_writer(std::io::stderr)
            // A log that cannot be written is no reason to stop: by default it is one to panic.
            .log_internal_errors(false);
        let _ = match self.log_format {
            LogFormat::Text => log.try_init(),
            LogFormat::Json => log.json().try_init(),
        };
    }
}

/// Whether only errors are to be said.
pub(crate) fn is_quiet() -> bool {
    QUIET.load(Ordering::Relaxed)
}

/// A bar on stderr for `length` steps, which goes when it ends; none with `--quiet` or off a terminal.
pub(crate) fn progress_bar(length: usize, template: &str) -> ProgressBar {
    if is_quiet() {
        return ProgressBar::hidden();
    }
    let style = ProgressStyle::with_template(template).expect("templates of this crate are valid");
    ProgressBar::new(length as u64).with_style(style).with_finish(ProgressFinish::AndClear)
}

/// Runs `work` under a spinner that says what is done and for how long; none with `--quiet` or off a terminal.
pub(crate) fn spinner<T>(what: &str, work: impl FnOnce() -> T) -> T {
    let bar = progress_bar(1, "{spinner} {msg} · {elapsed}");
    bar.set_message(what.to_owned());
    bar.enable_steady_tick(TICK);
    work()
}

/// One line on stderr, none with `--quiet`.
pub(crate) fn print_status(line: &str) {
    if !is_quiet() {
        print_stderr(line);
    }
}
