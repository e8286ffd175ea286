//! Time by part of a step, from the `tracing` spans of the networks and the learner.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};
use tracing::span::Id;
use tracing::{Level, Subscriber};
use tracing_subscriber::Layer;
use tracing_subscriber::filter::Targets;
use tracing_subscriber::layer::{Context, SubscriberExt};
use tracing_subscriber::registry::LookupSpan;

/// What is left of a step beside the named parts.
pub const OTHER: &str = "other";

/// The parts of a step in their order: waiting for the scene, then the spans by name, then the rest.
pub const PHASES: [&str; 12] = [
    "data wait",
    "tensors",
    "embedding",
    "vertex products",
    "draping",
    "skinning",
    "untangling",
    "energies",
    "backward",
    "clip",
    "optimiser",
    OTHER,
];

/// Seconds by span name.
pub type PhaseTimes = BTreeMap<&'static str, f64>;

/// Runs `work` and returns how long each span of the project was entered, on this thread and on those that `work` hands its
/// subscriber to.
pub fn record_phases<R>(work: impl FnOnce() -> R) -> (R, PhaseTimes) {
    let totals = Arc::new(Mutex::new(BTreeMap::<&'static str, Duration>::new()));
    let targets = Targets::new()
        .with_target("clothcombo_model", Level::TRACE)
        .with_target("clothcombo_trainer", Level::TRACE);
    let subscriber = tracing_subscriber::registry().with(SpanClock(totals.clone()).with_filter(targets));
    let result = tracing::subscriber::with_default(subscriber, work);
    let totals = totals.lock().unwrap_or_else(PoisonError::into_inner);
    (result, totals.iter().map(|(name, time)| (*name, time.as_secs_f64())).collect())
}

struct SpanClock(Arc<Mutex<BTreeMap<&'static str, Duration>>>);

struct Entered(Instant);

impl<S: Subscriber + for<'a> LookupSpan<'a>> Layer<S> for SpanClock {
    fn on_enter(&self, id: &Id, context: Context<'_, S>) {
        if let Some(span) = context.span(id) {
            span.extensions_mut().replace(Entered(Instant::now()));
        }
    }

    fn on_exit(&self, id: &Id, context: Context<'_, S>) {
        let Some(span) = context.span(id) else { return };
        if let Some(Entered(start)) = span.extensions_mut().remove() {
            let mut totals = self.0.lock().unwrap_or_else(PoisonError::into_inner);
            *totals.entry(span.name()).or_default() += start.elapsed();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spans_are_added_up_by_name() {
        let ((), times) = record_phases(|| {
            for _ in 0..2 {
                let _span = tracing::trace_span!("embedding").entered();
                std::thread::sleep(Duration::from_millis(5));
            }
            tracing::trace_span!("clip").in_scope(|| ());
        });
        assert_eq!(times.keys().copied().collect::<Vec<_>>(), ["clip", "embedding"]);
        assert!(times["embedding"] >= 0.01 && times["clip"] < times["embedding"]);
    }
}
