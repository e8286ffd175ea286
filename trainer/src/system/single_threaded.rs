//! Work on many items in parallel, a core for each, so that the times of the items mean something.

use miette::{IntoDiagnostic, Report};
use rayon::ThreadPoolBuilder;
use std::num::NonZero;
use std::sync::Mutex;

/// The results of `work` on `items`, in their order; as many at a time as there are cores.
///
/// Threads of their own rather than rayon's: one of rayon's that waits for an item in a pool of one thread takes up the next
/// item meanwhile, until all run at once and no time means anything.
///
/// # Errors
/// The first one of `work`, by the order of the items; and when the system refuses a thread.
pub fn map_single_threaded<I: Send, O: Send>(
    items: Vec<I>,
    work: impl Fn(I) -> Result<O, Report> + Sync,
) -> Result<Vec<O>, Report> {
    map(items, std::thread::available_parallelism().map_or(1, NonZero::get), work)
}

/// The same, `jobs` at a time.
fn map<I: Send, O: Send>(
    items: Vec<I>,
    jobs: usize,
    work: impl Fn(I) -> Result<O, Report> + Sync,
) -> Result<Vec<O>, Report> {
    let count = items.len();
    let jobs = jobs.clamp(1, count.max(1));
    // A pool of one thread for each: energies share their work among the threads of the pool they are called in.
    let pool = || ThreadPoolBuilder::new().num_threads(1).build().into_diagnostic();
    let pools = (0..jobs).map(|_| pool()).collect::<Result<Vec<_>, _>>()?;
    let waiting = Mutex::new(items.into_iter().enumerate());
    let results = Mutex::new(Vec::with_capacity(count));
    std::thread::scope(|scope| {
        for pool in &pools {
            scope.spawn(|| {
                loop {
                    // Apart from the loop's head, where the lock would be held through the work.
                    let next = waiting.lock().unwrap_or_else(|e| e.into_inner()).next();
                    let Some((i, item)) = next else { break };
                    let result = pool.install(|| work(item));
                    results.lock().unwrap_or_else(|e| e.into_inner()).push((i, result));
                }
            });
        }
    });
    let mut results = results.into_inner().unwrap_or_else(|e| e.into_inner());
    results.sort_by_key(|(i, _)| *i);
    results.into_iter().map(|(_, result)| result).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use miette::miette;
    use std::sync::atomic::{AtomicUsize, Ordering::SeqCst};
    use std::time::Duration;

    #[test]
    fn no_more_run_at_once_than_asked_for_and_each_on_one_thread() {
        for jobs in [1, 2, 3] {
            let (running, most) = (AtomicUsize::new(0), AtomicUsize::new(0));
            let results = map((0..12).collect(), jobs, |i| {
                most.fetch_max(running.fetch_add(1, SeqCst) + 1, SeqCst);
                std::thread::sleep(Duration::from_millis(5));
                running.fetch_sub(1, SeqCst);
                Ok((i, rayon::current_num_threads()))
            });
            let expected: Vec<_> = (0..12).map(|i| (i, 1)).collect();
            assert_eq!(results.unwrap(), expected);
            assert!(most.into_inner() <= jobs);
        }
    }

    #[test]
    fn the_first_failure_by_order_is_returned() {
        let results = map(vec![1, 2, 3, 4], 2, |i| if i % 2 == 0 { Err(miette!("item {i}")) } else { Ok(i) });
        assert_eq!(results.unwrap_err().to_string(), "item 2");
        assert!(map_single_threaded(Vec::<u8>::new(), Ok).unwrap().is_empty());
    }
}
