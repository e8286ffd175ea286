//! A call of the library from Python: without the interpreter's lock, with warnings and errors as Python has them.

use clothcombo_trainer::system::workers::among_workers;
use miette::{Diagnostic, Report};
use pyo3::exceptions::{PyRuntimeError, PyUserWarning};
use pyo3::prelude::*;
use std::error::Error as StdError;
use std::ffi::CString;
use std::fmt::Debug;
use std::fs::File;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::{Mutex, OnceLock, PoisonError};
use tracing::field::{Field, Visit};
use tracing::level_filters::LevelFilter;
use tracing::{Event, Subscriber};
use tracing_subscriber::layer::{Context, Layer, SubscriberExt};
use tracing_subscriber::util::SubscriberInitExt;

mod exceptions {
    #![allow(missing_docs)]
    pyo3::import_exception!(clothcombo._errors, Error);
    pyo3::import_exception!(clothcombo._errors, FileError);
}
use exceptions::{Error, FileError};

/// The result of `work`, which runs on the threads of parallel operations while Python goes on. `files` are those it reads:
/// if it fails and one of them cannot be opened, the error is one of files.
pub fn call<R: Send, E: Into<Report>>(
    py: Python<'_>,
    files: &[PathBuf],
    work: impl FnOnce() -> Result<R, E> + Send,
) -> PyResult<R> {
    check_process()?;
    let work = || work().map_err(Into::into);
    // What was computed half is dropped; what is kept beside it lies behind locks that nobody finds poisoned.
    let result = py.detach(|| catch_unwind(AssertUnwindSafe(|| among_workers(work))));
    let warnings = std::mem::take(&mut *lock(&WARNINGS));
    for text in warnings {
        let text = CString::new(text.replace('\0', " "))?;
        PyErr::warn(py, &py.get_type::<PyUserWarning>(), &text, 2)?;
    }
    match result {
        Ok(result) => result.map_err(|report| failure(&report, files)),
        Err(panic) => {
            let text = panic.downcast_ref::<&str>().copied().map(str::to_owned);
            let text = text.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_default();
            Err(PyRuntimeError::new_err(format!("a fault of clothcombo itself, please report it: {text}")))
        }
    }
}

/// Refuses calls in a process that was forked after the first call: the threads of parallel operations are not in it.
fn check_process() -> PyResult<()> {
    static FIRST: OnceLock<u32> = OnceLock::new();
    let own = std::process::id();
    match *FIRST.get_or_init(|| own) == own {
        true => Ok(()),
        false => Err(PyRuntimeError::new_err(
            "clothcombo was used before this process was forked, and its threads do not survive that; hint: start processes with \
             multiprocessing's \"spawn\", for a DataLoader multiprocessing_context=\"spawn\"",
        )),
    }
}

/// An error of the caller's input, with the text of the programs: what, why, and the hint.
pub fn refused(report: impl Into<Report>) -> PyErr {
    failure(&report.into(), &[])
}

/// The same of a plain text.
pub fn refused_text(text: impl Into<String>) -> PyErr {
    Error::new_err(text.into())
}

fn failure(report: &Report, files: &[PathBuf]) -> PyErr {
    let diagnostic: &dyn Diagnostic = report.as_ref();
    let mut text = diagnostic.to_string();
    let mut source = StdError::source(diagnostic);
    while let Some(cause) = source {
        let cause_text = cause.to_string();
        if !text.contains(&cause_text) {
            text = format!("{text}: {cause_text}");
        }
        source = cause.source();
    }
    if let Some(help) = diagnostic.help() {
        text = format!("{text}\nhelp: {help}");
    }
    let is_unreadable = |path: &PathBuf| !path.is_dir() && File::open(path).is_err();
    match files.iter().any(is_unreadable) {
        true => FileError::new_err(text),
        false => Error::new_err(text),
    }
}

static WARNINGS: Mutex<Vec<String>> = Mutex::new(Vec::new());

fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Keeps what the library warns of for the end of the call, where Python's `warnings` get it.
pub fn listen_for_warnings() {
    // Another subscriber in the process stays.
    let _ = tracing_subscriber::registry().with(Listener.with_filter(LevelFilter::WARN)).try_init();
}

struct Listener;

impl<S: Subscriber> Layer<S> for Listener {
    fn on_event(&self, event: &Event<'_>, _: Context<'_, S>) {
        let mut message = MessageText(String::new());
        event.record(&mut message);
        lock(&WARNINGS).push(message.0);
    }
}

struct MessageText(String);

impl Visit for MessageText {
    fn record_debug(&mut self, field: &Field, value: &dyn Debug) {
        if field.name() == "message" {
            self.0 = format!("{value:?}");
        }
    }
}
