//! What a consumer got.

use motorlink_proto::time::Instant;
use motorlink_telemetry::event::What;
use motorlink_telemetry::signal::Signal;
use motorlink_telemetry::subscription::{Record, Subscription};

/// What a consumer got: times and values of a signal, and the events.
#[derive(Default)]
pub struct Got {
    pub records: Vec<Record>,
}

impl Got {
    pub fn of(subscription: &Subscription) -> Self {
        Got { records: std::iter::from_fn(|| subscription.take()).collect() }
    }

    pub fn values(&self, signal: Signal) -> Vec<(Instant, f64)> {
        let value = |record: &Record| match record {
            Record::Values(values) => Some((values.time(), values.get(signal)?.value)),
            _ => None,
        };
        self.records.iter().filter_map(value).collect()
    }

    pub fn replies(&self) -> usize {
        self.records.iter().filter(|record| matches!(record, Record::Values(_))).count()
    }

    pub fn events(&self) -> impl Iterator<Item = &What> {
        self.records.iter().filter_map(|record| match record {
            Record::Event(event) => Some(&event.what),
            _ => None,
        })
    }
}
