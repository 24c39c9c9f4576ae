//! A line of a share: from the rows and events of the share to messages. The share reads the drives, and
//! another program may command them.

use std::sync::Arc;

use motorlink_telemetry::sample::Sample;
use motorlink_telemetry::share::address::Address;
use motorlink_telemetry::share::event_text::DescribedEvent;
use motorlink_telemetry::share::message::{Event, EventKind, SignalRate};
use motorlink_telemetry::share::stream::{Followed as Target, Item, Stream, Wanted};
use motorlink_telemetry::signal::Signal;

use super::choice::Group;
use super::content::{Content, Line, Values};
use super::wall::wall_now;
use crate::error::RecordError;
use crate::schema::Time;
use crate::write::Entry;

/// A share, and the name of a line there.
pub(super) type LineOfShare = (Arc<dyn Address>, String);

/// The recording of a line of a share.
#[derive(Debug)]
pub(super) struct Followed {
    content: Content,
    stream: Stream,
    /// Whether events of the share itself are recorded here. One line of each share has them.
    has_events_of_share: bool,
    /// When it began.
    since: Time,
}

/// The share counts values of whole seconds: before this time, in ns, also those of a second that began before
/// the recording.
const RATES_FROM: u64 = 2_100_000_000;

/// These signals of a line of a share, which has its own name for the line.
pub(super) fn target(
    (share, name): LineOfShare,
    line: &Line,
    groups: &[Group],
    by: &str,
) -> Target {
    let wanted = groups.iter().map(|group| Wanted {
        signals: group.motors.iter().flat_map(|(_, signals)| signals).copied().collect(),
        period: group.period.0 as f64 / 1e6,
    });
    let wanted = wanted.filter(|wanted| !wanted.signals.is_empty()).collect();
    Target { share, line: name, speaks: line.speaks, name: by.to_owned(), wanted }
}

/// Asks shares to read signals from now on. Each target has the name of its port.
pub(super) fn streams(targets: Vec<(String, Target)>) -> Result<Vec<Stream>, RecordError> {
    let (ports, targets): (Vec<_>, Vec<_>) = targets.into_iter().unzip();
    let opened = Stream::open_all(targets, || wall_now().0);
    opened.map_err(|(number, why)| RecordError::Share { port: ports[number].clone(), why })
}

impl Followed {
    pub(super) fn new(content: Content, stream: Stream, has_events_of_share: bool) -> Self {
        Followed { content, stream, has_events_of_share, since: wall_now() }
    }

    pub(super) fn content(&self) -> &Content {
        &self.content
    }

    pub(super) fn ask_rates(&mut self, now: Time) {
        self.stream.ask_rates(now.0);
    }

    pub(super) fn ask_last(&mut self, now: Time) {
        self.stream.ask_last(now.0);
    }

    pub(super) fn awaits_last(&self) -> bool {
        self.stream.awaits_last()
    }

    /// Takes what came. `put` receives the messages.
    pub(super) fn take(&mut self, now: Time, put: &mut dyn FnMut(Entry)) {
        for item in self.stream.take(now.0) {
            self.item(item, now, put);
        }
        self.content.diagnose(now, put);
    }

    /// Nothing more comes.
    pub(super) fn end(&mut self, now: Time, put: &mut dyn FnMut(Entry)) {
        self.take(now, put);
        self.content.tell_unconfirmed(now, put);
    }

    fn item(&mut self, item: Item, now: Time, put: &mut dyn FnMut(Entry)) {
        let of_line =
            |event, message| DescribedEvent { event, motor: None, by: None, since: None, message };
        match item {
            Item::Row { wanted, motor, time, span, values } => {
                let sample = |value: f64| (!value.is_nan()).then(|| Sample::told(value));
                let samples = values.into_iter().map(sample).collect();
                let values = Values { stamp: Time(time), span_s: span, samples };
                self.content.row(wanted, motor, &values, put);
            }
            Item::Unconfirmed(rows) => self.content.unconfirmed(rows),
            Item::Lost(count) => self.content.lost(now, count, put),
            Item::Rates(_) if now.0.saturating_sub(self.since.0) < RATES_FROM => {}
            Item::Rates(rates) => self.rates(&rates),
            Item::Event(time, event) => self.event(Time(time), event, put),
            Item::Down(why) => self.content.told(now, of_line(EventKind::Lost, why), put),
            Item::Up => {
                let back = "the share is there again".to_owned();
                self.content.told(now, of_line(EventKind::Back, back), put);
            }
            Item::Late(since) => {
                let waited = now.0.saturating_sub(since) as f64 / 1e9;
                let message =
                    format!("values of the last {waited:.1} s come late: they waited at the share");
                self.content.told(now, of_line(EventKind::Late, message), put);
            }
            Item::Clock { ahead, within } => {
                let (by, way) = (ahead.abs(), if ahead < 0.0 { "behind" } else { "ahead" });
                let message = format!(
                    "the wall clock of the share is {by:.3} s {way} (within {within:.3} s); times here \
                     are by the clock of this computer"
                );
                self.content.told(now, of_line(EventKind::Clock, message), put);
            }
        }
    }

    fn rates(&mut self, rates: &[SignalRate]) {
        let line = self.content.line();
        let signal = |rate: &SignalRate| {
            let motor = line.speaks.motor(rate.signal.motor)?;
            Some((Signal::named(motor, &rate.signal.name).ok()?, rate.achieved))
        };
        let rates: Vec<_> = rates.iter().filter_map(signal).collect();
        self.content.take_rates(&rates);
    }

    fn event(&mut self, stamp: Time, event: Event, put: &mut dyn FnMut(Entry)) {
        let Event { line, motor: number, by, event, message, .. } = event;
        if line.is_none() && !self.has_events_of_share {
            return;
        }
        // The name of the motor is in the event.
        let place = match (&line, number) {
            (Some(line), Some(number)) => format!("{line}, motor {number}: "),
            (Some(line), None) => format!("{line}: "),
            (None, _) => String::new(),
        };
        let message = message.strip_prefix(&place).unwrap_or(&message).to_owned();
        let motor = number.and_then(|number| self.content.line().speaks.motor(number));
        let by = by.map(Into::into);
        self.content.told(stamp, DescribedEvent { event, motor, by, since: None, message }, put);
    }
}
