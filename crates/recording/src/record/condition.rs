//! The condition of a motor, for diagnostics.

use motorlink_proto::time::Micros;
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
    /// Whether its faults are read.
    reads_faults: bool,
    /// When the last values were read.
    at: Option<Time>,
    /// It does not answer, or its port is closed.
    pub(super) is_silent: bool,
    /// The least rate of its fast signals, Hz: asked, and reached in the last second.
    pub(super) rates: Option<(f64, f64)>,
    /// What was said last.
    said: Option<(Level, String)>,
    presence: Presence,
}

/// When there were values.
#[derive(Debug)]
struct Presence {
    /// A longer time without values is a gap, in ns.
    longest: u64,
    /// When the recording of the motor began.
    began: Option<Time>,
    /// The time of the newest values; before there are some: when it began.
    newest: Time,
    /// The gaps that are over, in ns.
    gaps: u64,
    /// Rows of the fast signals.
    rows: u64,
}

/// The shortest time without values that counts as a gap, in ns.
const GAP: u64 = 1_000_000_000;
/// A gap has so many periods at least.
const PERIODS: u64 = 3;

/// The least share of the asked rate that is not worth a warning.
const ENOUGH: f64 = 0.9;

impl Condition {
    /// `period` is that of its fastest signals.
    pub(super) fn new(motor: Motor, label: &str, port: &str, period: Micros) -> Self {
        let longest = GAP.max(PERIODS * period.0 * 1000);
        let presence = Presence { longest, began: None, newest: Time(0), gaps: 0, rows: 0 };
        Condition {
            motor,
            label: label.to_owned(),
            port: port.to_owned(),
            overview: Overview::of(motor),
            last: Vec::new(),
            reads_faults: false,
            at: None,
            is_silent: false,
            rates: None,
            said: None,
            presence,
        }
    }

    /// It is recorded from now on, if it was not before.
    pub(super) fn begin(&mut self, now: Time) {
        if self.presence.began.is_none() {
            self.presence.began = Some(now);
            self.presence.newest = self.presence.newest.max(now);
        }
    }

    /// For how long there were no values, in ns: the sum of all times that are longer than 1 s and than
    /// three periods.
    pub(super) fn without_values(&self, now: Time) -> u64 {
        self.presence.gaps + self.presence.open(now)
    }

    /// The mean rate of the fast signals since the recording began, Hz.
    pub(super) fn mean_rate(&self, now: Time) -> Option<f64> {
        let Presence { began, newest, rows, .. } = self.presence;
        let until = if self.presence.open(now) > 0 { now } else { newest };
        let span = until.0.saturating_sub(began?.0);
        (span > 0).then(|| rows as f64 * 1e9 / span as f64)
    }

    /// Values of a row. `is_fast`: of the signals that are read most often.
    pub(super) fn take(
        &mut self,
        at: Time,
        is_fast: bool,
        values: impl Iterator<Item = (Signal, Option<Sample>)>,
    ) {
        let mut has_value = false;
        for (Signal { source, .. }, sample) in values {
            has_value |= sample.is_some();
            self.reads_faults |= source == self.overview.faults;
            self.last.retain(|(it, _)| *it != source);
            self.last.extend(sample.map(|sample| (source, sample)));
        }
        self.at = Some(at);
        if has_value {
            self.presence.take(at, is_fast);
        }
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

    fn level_and_message(&self, now: Time) -> (Level, String) {
        let (state, faults) = (self.state(), self.faults());
        let is_unknown = self.reads_faults && self.value(self.overview.faults).is_none();
        let slow = self.rates.filter(|(asked, got)| *got < asked * ENOUGH);
        let too_slow = slow.map(|(asked, got)| format!("read {got:.1} times a second of {asked}"));
        let silence = match () {
            () if self.is_silent || self.at.is_none() => Some("does not answer".to_owned()),
            () if self.presence.open(now) > 0 => Some("no new values".to_owned()),
            () => None,
        };
        let level = match () {
            () if silence.is_some() => Level::Stale,
            () if overview::is_present(self.motor, self.value(self.overview.faults)) => {
                Level::Error
            }
            () if faults.is_some() || too_slow.is_some() || is_unknown => Level::Warn,
            () => Level::Ok,
        };
        let unknown = is_unknown.then(|| "faults not known".to_owned());
        let parts = [silence, state, faults, unknown, too_slow].into_iter().flatten();
        (level, parts.collect::<Vec<_>>().join(": "))
    }

    /// Whether it is another than when it was said last.
    pub(super) fn has_changed(&self, now: Time) -> bool {
        self.said.as_ref() != Some(&self.level_and_message(now))
    }

    /// The diagnosis.
    pub(super) fn say(&mut self, now: Time) -> DiagnosticStatus {
        let (level, message) = self.level_and_message(now);
        self.said = Some((level, message.clone()));
        let age = self.at.map(|at| format!("{:.3}", now.0.saturating_sub(at.0) as f64 / 1e9));
        let rate = |which: fn((f64, f64)) -> f64| self.rates.map(|it| format!("{:.1}", which(it)));
        let faults = || self.faults().unwrap_or_else(|| "none".to_owned());
        let achieved = rate(|(_, achieved)| achieved).filter(|_| level != Level::Stale);
        let values = [
            ("state", self.state()),
            ("faults", self.value(self.overview.faults).map(|_| faults())),
            ("age of data [s]", age),
            ("asked rate [Hz]", rate(|(asked, _)| asked)),
            ("achieved rate [Hz]", achieved),
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

impl Presence {
    fn take(&mut self, at: Time, is_fast: bool) {
        self.began.get_or_insert(at);
        if self.newest.0 > 0 {
            self.gaps += self.open(at);
        }
        self.newest = self.newest.max(at);
        self.rows += u64::from(is_fast);
    }

    /// The time since the newest values, if it is a gap.
    fn open(&self, now: Time) -> u64 {
        let since = now.0.saturating_sub(self.newest.0);
        if self.began.is_some() && since > self.longest { since } else { 0 }
    }
}

#[cfg(test)]
mod tests {
    use motorlink_proto::st::MotorNumber;

    use super::*;

    const MS: u64 = 1_000_000;

    #[test]
    fn times_without_values_are_summed() {
        let motor = Motor::St(MotorNumber::FIRST);
        let signal = Signal::named(motor, "SPEED_MEAS").unwrap();
        let mut condition = Condition::new(motor, "st1", "port", Micros(10_000));
        let start = 1_000_000 * MS;
        let time = |ms: u64| Time(start + ms * MS);
        condition.begin(time(0));
        let row = |condition: &mut Condition, ms, value: Option<f64>| {
            condition.take(time(ms), true, [(signal, value.map(Sample::told))].into_iter());
        };
        for ms in (0..10_000).step_by(10) {
            row(&mut condition, ms, Some(1.0));
        }
        assert_eq!(condition.without_values(time(10_900)), 0);
        assert_eq!(condition.mean_rate(time(10_900)).map(f64::round), Some(100.0));
        // A row without a value does not end a gap.
        row(&mut condition, 20_000, None);
        assert_eq!(condition.without_values(time(97_990)), 88_000 * MS);
        for ms in (98_000..108_000).step_by(10) {
            row(&mut condition, ms, Some(1.0));
        }
        assert_eq!(condition.without_values(time(108_000)), 88_010 * MS);
        let mean = condition.mean_rate(time(108_000)).unwrap();
        assert!((18.0..19.0).contains(&mean), "{mean}");
    }

    #[test]
    fn values_that_are_old_or_were_never_read_are_not_said_to_be_live() {
        let motor = Motor::St(MotorNumber::FIRST);
        let (status, flags) = (Overview::of(motor).state.unwrap(), Overview::of(motor).faults);
        let mut condition = Condition::new(motor, "st1", "port", Micros(100_000));
        let time = |ms: u64| Time(1_000_000 * MS + ms * MS);
        let row = |condition: &mut Condition, ms, flags_are: Option<f64>| {
            let values = [(status, Some(6.0)), (flags, flags_are)];
            let values = values.map(|(source, value)| (Signal { motor, source }, value));
            let samples = values.map(|(signal, value)| (signal, value.map(Sample::told)));
            condition.take(time(ms), true, samples.into_iter());
        };
        let said = |condition: &mut Condition, ms| {
            let DiagnosticStatus { level, message, values, .. } = condition.say(time(ms));
            let faults = values.into_iter().find(|(key, _)| key == "faults").map(|(_, is)| is);
            (level, message, faults)
        };
        assert_eq!(said(&mut condition, 0), (Level::Stale, "does not answer".to_owned(), None));
        row(&mut condition, 0, None);
        let unknown = (Level::Warn, "RUN: faults not known".to_owned(), None);
        assert_eq!(said(&mut condition, 10), unknown);
        row(&mut condition, 100, Some(0.0));
        let none = Some("none".to_owned());
        assert_eq!(said(&mut condition, 110), (Level::Ok, "RUN".to_owned(), none.clone()));
        assert!(!condition.has_changed(time(1_000)));
        assert!(condition.has_changed(time(1_200)));
        let old = (Level::Stale, "no new values: RUN".to_owned(), none);
        assert_eq!(said(&mut condition, 1_200), old);
    }

    #[test]
    fn slow_signals_and_a_motor_that_gives_nothing() {
        let motor = Motor::St(MotorNumber::FIRST);
        let mut condition = Condition::new(motor, "st1", "port", Micros(10_000_000));
        assert_eq!((condition.without_values(Time(5)), condition.mean_rate(Time(5))), (0, None));
        condition.begin(Time(7));
        assert_eq!(condition.without_values(Time(7 + 29_000 * MS)), 0);
        assert_eq!(condition.without_values(Time(7 + 31_000 * MS)), 31_000 * MS);
        assert_eq!(condition.mean_rate(Time(7 + 31_000 * MS)), Some(0.0));
    }
}
