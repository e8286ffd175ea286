//! The processor's threads in equal shares, for work that is done in parallel.

use rayon::{ThreadPool, ThreadPoolBuilder};
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use tracing::dispatcher;

/// Pools of threads that do not help each other: an operation that runs on a thread of its own waits for nobody, while
/// small operations that are split over all threads spend much of their time on waking them.
#[derive(Default)]
pub struct Workers {
    /// For so many items at once as many pools: how many threads one has must not depend on what was done before, since
    /// sums of networks differ with it in their last bits.
    pools: BTreeMap<usize, Vec<ThreadPool>>,
}

impl Workers {
    /// The results of `work` on `items`, in their order, computed at once; one after the other if the system refuses more
    /// threads.
    pub fn map<I: Send, O: Send>(&mut self, items: Vec<I>, work: impl Fn(I) -> O + Sync) -> Vec<O> {
        let pools = match self.pools.entry(items.len()) {
            Entry::Occupied(known) => known.into_mut(),
            Entry::Vacant(place) => {
                let threads = (rayon::current_num_threads() / items.len().max(1)).max(1);
                let pool = |i| {
                    let name = move |thread| format!("scene-{i}-{thread}");
                    ThreadPoolBuilder::new().num_threads(threads).thread_name(name).build()
                };
                match (0..items.len()).map(pool).collect() {
                    Ok(pools) => place.insert(pools),
                    Err(_) => return items.into_iter().map(work).collect(),
                }
            }
        };
        // Spans belong to a thread: those of the workers go to whoever listens on this one.
        let listener = dispatcher::get_default(Clone::clone);
        let work = |item| dispatcher::with_default(&listener, || work(item));
        let mut results: Vec<Option<O>> = items.iter().map(|_| None).collect();
        let jobs = items.into_iter().zip(&mut results).map(|(item, result)| {
            let work = &work;
            move || *result = Some(work(item))
        });
        run_at_once(pools, jobs);
        results.into_iter().map(|result| result.expect("every job was run")).collect()
    }
}

/// The result of `work`, on one of the threads that parallel operations run on: each of them would else be handed over
/// from this one, which sleeps until it is done. A small step has hundreds.
pub fn among_workers<R: Send>(work: impl FnOnce() -> R + Send) -> R {
    let listener = dispatcher::get_default(Clone::clone);
    rayon::scope(|_| dispatcher::with_default(&listener, work))
}

/// Starts the first job in the first pool, and so on, and waits for all.
fn run_at_once<J: FnOnce() + Send>(pools: &[ThreadPool], mut jobs: impl Iterator<Item = J>) {
    if let (Some((pool, pools)), Some(job)) = (pools.split_first(), jobs.next()) {
        pool.in_place_scope(|scope| {
            scope.spawn(move |_| job());
            run_at_once(pools, jobs);
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Barrier;

    #[test]
    fn work_among_workers_is_heard_by_who_listens_here() {
        tracing::subscriber::with_default(tracing_subscriber::registry(), || {
            let is_heard =
                || dispatcher::get_default(|listener| listener.is::<tracing_subscriber::Registry>());
            assert!(among_workers(|| is_heard() && rayon::current_thread_index().is_some()));
            assert!(rayon::current_thread_index().is_none());
        });
    }

    #[test]
    fn results_come_in_order_from_threads_that_run_at_once() {
        let mut workers = Workers::default();
        for count in [3, 2, 4] {
            let all = Barrier::new(count); // passes nobody before all have come
            let results = workers.map((0..count).collect(), |i| {
                all.wait();
                (i, rayon::current_num_threads())
            });
            assert_eq!(results.iter().map(|(i, _)| *i).collect::<Vec<_>>(), (0..count).collect::<Vec<_>>());
            let share = (rayon::current_num_threads() / count).max(1);
            assert!(results.iter().all(|(_, threads)| *threads == share));
        }
    }
}
