//! Makes the next items of a sequence on another thread while the current one is in use.

use std::ops::Range;
use std::sync::mpsc::{Receiver, sync_channel};
use std::thread::JoinHandle;

/// Items in order. Dropping it ends the thread.
pub struct Prefetch<T, E> {
    receiver: Option<Receiver<Result<T, E>>>,
    worker: Option<JoinHandle<()>>,
}

impl<T: Send + 'static, E: Send + 'static> Prefetch<T, E> {
    /// Starts making the items of `indices`, at most `ahead` of them in advance; the first error is the last item.
    ///
    /// # Errors
    /// When the system refuses another thread.
    pub fn start(
        name: &str,
        indices: Range<u64>,
        ahead: usize,
        make: impl Fn(u64) -> Result<T, E> + Send + 'static,
    ) -> std::io::Result<Self> {
        let (sender, receiver) = sync_channel(ahead.max(1));
        let worker = std::thread::Builder::new().name(name.into()).spawn(move || {
            for index in indices {
                let item = make(index);
                let failed = item.is_err();
                if sender.send(item).is_err() || failed {
                    return; // the receiver stopped early, or is about to
                }
            }
        })?;
        Ok(Self { receiver: Some(receiver), worker: Some(worker) })
    }
}

impl<T, E> Prefetch<T, E> {
    /// The next item; `None` after the last one.
    pub fn next_item(&self) -> Option<Result<T, E>> {
        self.receiver.as_ref()?.recv().ok()
    }
}

impl<T, E> Drop for Prefetch<T, E> {
    fn drop(&mut self) {
        self.receiver = None; // unblocks a worker waiting to send
        if let Some(worker) = self.worker.take()
            && let Err(panic) = worker.join()
            && !std::thread::panicking()
        {
            std::panic::resume_unwind(panic);
        }
    }
}
