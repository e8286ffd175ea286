//! Time by part of a step, from the `tracing` spans of the networks and the learner.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;
use tracing::span::Id;
use tracing::{Level, Subscriber};
use tracing_subscriber::Layer;
use tracing_subscriber::filter::Targets;
use tracing_subscriber::layer::{Context, SubscriberExt};
use tracing_subscriber::registry::LookupSpan;

/// The rest of a step.
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
pub type SpanSeconds = BTreeMap<&'static str, f64>;

/// Runs `work` and returns how long each span of the project was entered, on this thread and on those that `work` hands
/// its subscriber to. The time of a span excludes that of the spans within it. `settle` runs at the end of each: it
/// waits for a device that computes on its own, whose time would else be in the next span that reads a result.
pub fn record_phases<R>(
    settle: impl Fn() + Send + Sync + 'static,
    work: impl FnOnce() -> R,
) -> (R, SpanSeconds) {
    let totals = Arc::new(Mutex::new(SpanSeconds::new()));
    let targets = Targets::new()
        .with_target("clothcombo_model", Level::TRACE)
        .with_target("clothcombo_trainer", Level::TRACE);
    let subscriber = tracing_subscriber::registry()
        .with(SpanClock { totals: totals.clone(), settle }.with_filter(targets));
    let result = tracing::subscriber::with_default(subscriber, work);
    let totals = totals.lock().unwrap_or_else(PoisonError::into_inner);
    (result, totals.clone())
}

struct SpanClock<F> {
    totals: Arc<Mutex<SpanSeconds>>,
    settle: F,
}

struct Entered(Instant);

impl<S: Subscriber + for<'a> LookupSpan<'a>, F: Fn() + Send + Sync + 'static> Layer<S> for SpanClock<F> {
    fn on_enter(&self, id: &Id, context: Context<'_, S>) {
        if let Some(span) = context.span(id) {
            // What was asked of the device before is not this span's.
            (self.settle)();
            span.extensions_mut().replace(Entered(Instant::now()));
        }
    }

    fn on_exit(&self, id: &Id, context: Context<'_, S>) {
        let Some(span) = context.span(id) else { return };
        (self.settle)();
        if let Some(Entered(start)) = span.extensions_mut().remove() {
            let mut totals = self.totals.lock().unwrap_or_else(PoisonError::into_inner);
            let seconds = start.elapsed().as_secs_f64();
            *totals.entry(span.name()).or_default() += seconds;
            if let Some(outer) = span.parent() {
                *totals.entry(outer.name()).or_default() -= seconds;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn spans_are_added_up_by_name() {
        let ((), times) = record_phases(
            || (),
            || {
                for _ in 0..2 {
                    let _span = tracing::trace_span!("embedding").entered();
                    std::thread::sleep(Duration::from_millis(5));
                }
                tracing::trace_span!("clip").in_scope(|| ());
            },
        );
        assert_eq!(times.keys().copied().collect::<Vec<_>>(), ["clip", "embedding"]);
        assert!(times["embedding"] >= 0.01 && times["clip"] < times["embedding"]);
    }

    #[test]
    fn a_span_within_another_one_counts_once() {
        let ((), times) = record_phases(
            || (),
            || {
                let _outer = tracing::trace_span!("untangling").entered();
                tracing::trace_span!("skinning").in_scope(|| std::thread::sleep(Duration::from_millis(20)));
            },
        );
        assert!(times["untangling"] >= 0.0 && times["untangling"] < times["skinning"], "{times:?}");
    }
}
