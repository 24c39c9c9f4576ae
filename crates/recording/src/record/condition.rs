//! The condition of a motor, for diagnostics.

use motorlink_telemetry::overview::{self, Overview};
use motorlink_telemetry::sample::Sample;
use motorlink_telemetry::signal::{Motor, Signal, Source};

use crate::schema::{DiagnosticStatus, Level, Time, name};

/// What is known of a motor.
#[derive(Debug)]
pub(super) struct Condition {
    motor: Motor,
    label: String,
    port: String,
    overview: Overview,
    /// The last value of each signal.
    last: Vec<(Source, Sample)>,
    /// When the last values were read.
    at: Option<Time>,
    /// It does not answer, or its port is closed.
    pub(super) is_silent: bool,
    /// The least rate of its fast signals, Hz: asked, and reached in the last second.
    pub(super) rates: Option<(f64, f64)>,
    /// What was said last.
    said: Option<(Level, String)>,
}

/// The least share of the asked rate that is not worth a warning.
const ENOUGH: f64 = 0.9;

impl Condition {
    pub(super) fn new(motor: Motor, label: &str, port: &str) -> Self {
        Condition {
            motor,
            label: label.to_owned(),
            port: port.to_owned(),
            overview: Overview::of(motor),
            last: Vec::new(),
            at: None,
            is_silent: false,
            rates: None,
            said: None,
        }
    }

    /// Values of a row.
    pub(super) fn take(
        &mut self,
        at: Time,
        values: impl Iterator<Item = (Signal, Option<Sample>)>,
    ) {
        for (Signal { source, .. }, sample) in values {
            self.last.retain(|(it, _)| *it != source);
            self.last.extend(sample.map(|sample| (source, sample)));
        }
        self.at = Some(at);
    }

    /// Whether there was a row.
    pub(super) fn has_row(&self) -> bool {
        self.at.is_some()
    }

    fn value(&self, source: Source) -> Option<Sample> {
        self.last.iter().find(|(it, _)| *it == source).map(|(_, sample)| *sample)
    }

    fn state(&self) -> Option<String> {
        overview::state(&self.overview, |source| self.value(source))
    }

    fn faults(&self) -> Option<String> {
        overview::faults(self.motor, self.value(self.overview.faults)?)
    }

    fn level_and_message(&self) -> (Level, String) {
        let (state, faults) = (self.state(), self.faults());
        let slow = self.rates.filter(|(asked, got)| *got < asked * ENOUGH);
        let too_slow = slow.map(|(asked, got)| format!("read {got:.1} times a second of {asked}"));
        let level = match () {
            () if self.is_silent || self.at.is_none() => Level::Stale,
            () if overview::is_present(self.motor, self.value(self.overview.faults)) => {
                Level::Error
            }
            () if faults.is_some() || too_slow.is_some() => Level::Warn,
            () => Level::Ok,
        };
        let silence = (level == Level::Stale).then(|| "does not answer".to_owned());
        let parts = [silence, state, faults, too_slow].into_iter().flatten();
        (level, parts.collect::<Vec<_>>().join(": "))
    }

    /// Whether it is another than when it was said last.
    pub(super) fn has_changed(&self) -> bool {
        self.said.as_ref() != Some(&self.level_and_message())
    }

    /// The diagnosis.
    pub(super) fn say(&mut self, now: Time) -> DiagnosticStatus {
        let (level, message) = self.level_and_message();
        self.said = Some((level, message.clone()));
        let age = self.at.map(|at| format!("{:.3}", now.0.saturating_sub(at.0) as f64 / 1e9));
        let rate = |which: fn((f64, f64)) -> f64| self.rates.map(|it| format!("{:.1}", which(it)));
        let values = [
            ("state", self.state()),
            ("faults", Some(self.faults().unwrap_or_else(|| "none".to_owned()))),
            ("age of data [s]", age),
            ("asked rate [Hz]", rate(|(asked, _)| asked)),
            ("achieved rate [Hz]", rate(|(_, achieved)| achieved)),
        ];
        let known = values.into_iter().filter_map(|(key, value)| Some((key.to_owned(), value?)));
        DiagnosticStatus {
            level,
            name: name::path(&self.label, self.motor),
            message,
            hardware_id: self.port.clone(),
            values: known.collect(),
        }
    }
}
