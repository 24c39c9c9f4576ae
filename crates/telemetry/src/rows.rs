//! Rows: the values of several signals at one instant, once they are confirmed.

mod motors;

use std::collections::VecDeque;
use std::sync::Arc;

use litemap::LiteMap as Map;
use motorlink_proto::st::Implausible;
use motorlink_proto::time::Instant;

use crate::event::{Event, What};
use crate::line::LineError;
use crate::sample::{Sample, Values};
use crate::signal::{Motor, Signal};
use crate::subscription::Record;

pub use motors::MotorRows;

/// The values of all signals at one instant.
#[derive(Debug, Clone)]
pub struct Row {
    /// The instant that the row was planned for.
    pub instant: Instant,
    /// When the first request was sent.
    pub requested: Instant,
    /// The middle between the first request and the last reply.
    pub time: Instant,
    /// The values, in the order of the signals.
    pub values: Vec<Result<Sample, Absent>>,
    /// When the last value of each motor came.
    replied: Map<Motor, Instant>,
}

/// Why there is no value.
#[derive(Debug, Clone, thiserror::Error)]
pub enum Absent {
    /// The drive refuses to give it.
    #[error(transparent)]
    Refused(Arc<LineError>),
    /// It is possible in another profile only.
    #[error(transparent)]
    Implausible(Implausible),
}

/// What [`Rows`] gives.
#[derive(Debug, Clone)]
pub enum Item {
    /// A row whose values are confirmed.
    Row(Row),
    /// Values are missing here.
    Gap(Gap),
    /// The consumer was too slow: this number of records is lost, and the rows that needed them.
    Lost(u64),
}

/// A place where values are missing.
#[derive(Debug, Clone)]
pub struct Gap {
    /// When it began.
    pub time: Instant,
    /// Why.
    pub why: Trouble,
    /// Rows just before the gap that were complete, and are left out because nothing confirms them.
    pub unconfirmed: u64,
}

/// Why values are missing.
#[derive(Debug, Clone)]
pub enum Trouble {
    /// The motor did not answer, or the port failed.
    Failed(Arc<LineError>),
    /// A reply came twice or late, so that values of this motor may be those of other signals.
    Doubtful(Motor),
}

/// Makes rows from the records of a subscription. All signals must be wanted at the same period.
///
/// The items are in the order of time. A row waits until a confirmation behind it. If a motor falls
/// silent or the port fails before that, the row is left out, and the gap counts it.
#[derive(Debug, Default)]
pub struct Rows {
    signals: Vec<Signal>,
    partial: Option<Partial>,
    /// The instant of the last row.
    last: Option<Instant>,
    refused: Map<Signal, Arc<LineError>>,
    confirmed: Map<Motor, Instant>,
    items: VecDeque<Item>,
}

/// A row that has not all its values yet.
#[derive(Debug)]
struct Partial {
    instant: Instant,
    began: Instant,
    values: Map<Signal, Result<Sample, Absent>>,
    replied: Map<Motor, Instant>,
}

impl Rows {
    /// Rows of these signals.
    pub fn new(signals: Vec<Signal>) -> Self {
        Rows { signals, ..Rows::default() }
    }

    /// Takes the next record of the subscription.
    pub fn take(&mut self, record: &Record) {
        match record {
            Record::Values(values) => self.values(values),
            Record::Event(event) => self.event(event),
            Record::Lost(count) => {
                // A doubt may be among the lost records.
                self.partial = None;
                self.drop_unconfirmed(|_| true);
                self.items.push_back(Item::Lost(*count));
            }
        }
    }

    fn values(&mut self, values: &Values) {
        for signal in &values.poll.signals {
            self.refused.remove(signal);
        }
        let newest = self.partial.as_ref().map(|partial| partial.instant).max(self.last);
        let is_new = newest.is_none_or(|newest| values.instant > newest);
        if is_new {
            self.partial = Some(Partial {
                instant: values.instant,
                began: values.requested,
                values: Map::new(),
                replied: Map::new(),
            });
        }
        let Some(partial) = self.partial.as_mut().filter(|it| it.instant == values.instant) else {
            return;
        };
        partial.replied.insert(values.poll.motor, values.replied);
        for (signal, sample) in values.poll.signals.iter().zip(&values.samples) {
            partial.values.insert(*signal, sample.map_err(Absent::Implausible));
        }
        self.complete();
    }

    fn event(&mut self, event: &Event) {
        match &event.what {
            What::Confirmed(motor, until) => drop(self.confirmed.insert(*motor, *until)),
            What::Doubtful(motor, since) if self.has(*motor) => {
                self.partial = None;
                let unconfirmed = self.drop_unconfirmed(|row| {
                    row.replied.get(motor).is_some_and(|replied| replied > since)
                });
                self.gap(event.time, Trouble::Doubtful(*motor), unconfirmed);
            }
            // The values come, too, each with the reason.
            What::Refused(_, why) if matches!(**why, LineError::Implausible(_)) => {}
            What::Refused(signals, why) => {
                self.refused.extend(signals.iter().map(|signal| (*signal, Arc::clone(why))));
                self.complete();
                self.refuse_all(event.time);
            }
            What::Unanswered(motor, why) if self.has(*motor) => {
                self.partial = None;
                self.gap(event.time, Trouble::Failed(Arc::clone(why)), 0);
            }
            What::Silent(motor, why) if self.has(*motor) => self.failed(event.time, why),
            What::Lost(why) => self.failed(event.time, why),
            _ => {}
        }
    }

    /// The next item, if it is known.
    pub fn next_item(&mut self) -> Option<Item> {
        let is_known = match self.items.front()? {
            Item::Row(row) => self.is_confirmed(row),
            Item::Gap(_) | Item::Lost(_) => true,
        };
        if is_known { self.items.pop_front() } else { None }
    }

    /// Whether a row of an earlier instant than this one is not complete or not confirmed.
    pub fn is_pending_before(&self, instant: Instant) -> bool {
        let is_pending = |item: &Item| matches!(item, Item::Row(row) if row.instant < instant);
        self.partial.as_ref().is_some_and(|partial| partial.instant < instant)
            || self.items.iter().any(is_pending)
    }

    fn has(&self, motor: Motor) -> bool {
        self.signals.iter().any(|signal| signal.motor == motor)
    }

    fn is_confirmed(&self, row: &Row) -> bool {
        let until = |motor| self.confirmed.get(motor).copied();
        row.replied.iter().all(|(motor, replied)| until(motor).is_some_and(|it| *replied <= it))
    }

    /// Makes a row of the partial one if nothing more is expected.
    fn complete(&mut self) {
        let Some(partial) = &self.partial else { return };
        let value = |signal: &Signal| {
            let refused = || Some(Err(Absent::Refused(Arc::clone(self.refused.get(signal)?))));
            partial.values.get(signal).cloned().or_else(refused)
        };
        let Some(values) = self.signals.iter().map(value).collect() else { return };
        let ended = partial.replied.values().max().copied().unwrap_or(partial.began);
        let time = Instant(partial.began.0.midpoint(ended.0));
        let Partial { instant, began: requested, .. } = *partial;
        let row = Row { instant, requested, time, values, replied: partial.replied.clone() };
        self.last = Some(instant);
        self.partial = None;
        self.items.push_back(Item::Row(row));
    }

    /// A row without a value: no reply would ever make one.
    fn refuse_all(&mut self, time: Instant) {
        let refused = |signal| Some(Err(Absent::Refused(Arc::clone(self.refused.get(signal)?))));
        if let Some(values) = self.signals.iter().map(refused).collect() {
            let (instant, requested) = (time, time);
            let replied = Map::new();
            self.items.push_back(Item::Row(Row { instant, requested, time, values, replied }));
        }
    }

    fn failed(&mut self, time: Instant, why: &Arc<LineError>) {
        self.partial = None;
        let unconfirmed = self.drop_unconfirmed(|_| true);
        self.gap(time, Trouble::Failed(Arc::clone(why)), unconfirmed);
    }

    fn gap(&mut self, time: Instant, why: Trouble, unconfirmed: u64) {
        match self.items.back_mut() {
            Some(Item::Gap(gap)) => gap.unconfirmed += unconfirmed,
            _ => self.items.push_back(Item::Gap(Gap { time, why, unconfirmed })),
        }
    }

    /// Leaves out the rows that are not confirmed, of those that `is_concerned` names.
    fn drop_unconfirmed(&mut self, is_concerned: impl Fn(&Row) -> bool) -> u64 {
        let before = self.items.len();
        let mut items = std::mem::take(&mut self.items);
        items.retain(|item| match item {
            Item::Row(row) => self.is_confirmed(row) || !is_concerned(row),
            Item::Gap(_) | Item::Lost(_) => true,
        });
        self.items = items;
        (before - self.items.len()) as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::{Poll, Read};
    use motorlink_proto::rmd::{Code, MotorId};
    use motorlink_proto::st::{Profile, Reading, RegisterId};
    use motorlink_proto::time::Micros;

    const READS: [(&str, Code); 2] =
        [("speed_dps", Code::ReadMotionStatus), ("voltage_volts", Code::ReadStatus)];

    fn motor() -> Motor {
        Motor::Rmd(MotorId::new(1).unwrap())
    }

    fn signals() -> Vec<Signal> {
        READS.map(|(name, _)| Signal::named(motor(), name).unwrap()).to_vec()
    }

    /// Values of one of the signals, from an exchange that begins `after` the instant and takes 10.
    fn values(read: usize, instant: u64, after: u64, value: f64) -> Record {
        let read = Poll {
            motor: motor(),
            period: Micros(100),
            read: Read::Command(READS[read].1),
            signals: vec![signals()[read]],
        };
        Record::Values(Arc::new(Values {
            poll: Arc::new(read),
            instant: Instant(instant),
            requested: Instant(instant + after),
            replied: Instant(instant + after + 10),
            samples: vec![Ok(Sample { digits: 0, value })],
        }))
    }

    fn event(time: u64, what: What) -> Record {
        Record::Event(Arc::new(Event { time: Instant(time), what }))
    }

    fn confirmed(until: u64) -> Record {
        event(until, What::Confirmed(motor(), Instant(until)))
    }

    fn trouble() -> Arc<LineError> {
        Arc::new(LineError::Closed)
    }

    /// The replies of a row.
    fn row(instant: u64) -> [Record; 2] {
        [values(0, instant, 0, 1.0), values(1, instant, 20, 2.0)]
    }

    fn text(item: Item) -> String {
        match item {
            Item::Row(row) => {
                let value = |it: &Result<Sample, Absent>| {
                    it.as_ref().map_or("-".to_owned(), |sample| sample.value.to_string())
                };
                let values: Vec<_> = row.values.iter().map(value).collect();
                format!("{} {}", row.time.0, values.join(" "))
            }
            Item::Gap(gap) => format!("{} gap {}", gap.time.0, gap.unconfirmed),
            Item::Lost(count) => format!("lost {count}"),
        }
    }

    fn taken(rows: &mut Rows, records: impl IntoIterator<Item = Record>) -> Vec<String> {
        let mut texts = Vec::new();
        for record in records {
            rows.take(&record);
            texts.extend(std::iter::from_fn(|| rows.next_item()).map(text));
        }
        texts
    }

    #[test]
    fn a_row_is_given_when_it_is_complete_and_confirmed() {
        let mut rows = Rows::new(signals());
        assert!(taken(&mut rows, row(100)).is_empty());
        assert!(taken(&mut rows, [confirmed(129)]).is_empty());
        assert_eq!(taken(&mut rows, [confirmed(130)]), ["115 1 2"]);
        assert!(taken(&mut rows, row(200).into_iter().chain(row(300))).is_empty());
        assert_eq!(taken(&mut rows, [confirmed(340)]), ["215 1 2", "315 1 2"]);
    }

    #[test]
    fn an_instant_with_a_missing_value_gives_no_row() {
        let mut rows = Rows::new(signals());
        let [speed, _] = row(100);
        let records = [speed].into_iter().chain(row(200)).chain([confirmed(250)]);
        assert_eq!(taken(&mut rows, records), ["215 1 2"]);
    }

    #[test]
    fn a_signal_that_is_refused_is_not_waited_for() {
        let mut rows = Rows::new(signals());
        let [speed, voltage] = row(100);
        let refusal = event(125, What::Refused(vec![signals()[1]], trouble()));
        assert_eq!(taken(&mut rows, [speed, refusal, confirmed(140)]), ["105 1 -"]);
        // It comes too late for this row, and is expected in the next one.
        assert!(taken(&mut rows, [voltage]).is_empty());
        let records = row(200).into_iter().chain([confirmed(250)]);
        assert_eq!(taken(&mut rows, records), ["215 1 2"]);
    }

    #[test]
    fn a_value_that_is_not_plausible_comes_in_its_row() {
        let mut rows = Rows::new(signals());
        let reading =
            Reading { register: RegisterId::HEATS_TEMP, bits: 0xFFF6, profile: Profile::Spec };
        let why = Arc::new(LineError::from(reading.plausible().unwrap_err()));
        let refusal = event(7, What::Refused(signals(), why));
        assert!(taken(&mut rows, [refusal]).is_empty());
        let records = row(100).into_iter().chain([confirmed(140)]);
        assert_eq!(taken(&mut rows, records), ["115 1 2"]);
    }

    #[test]
    fn a_row_without_any_value_is_given_at_once() {
        let mut rows = Rows::new(signals());
        let refusal = event(7, What::Refused(signals(), trouble()));
        assert_eq!(taken(&mut rows, [refusal]), ["7 - -"]);
    }

    #[test]
    fn a_missing_answer_is_in_the_order_of_time() {
        let mut rows = Rows::new(signals());
        let missing = event(210, What::Unanswered(motor(), trouble()));
        assert!(taken(&mut rows, row(100).into_iter().chain([missing])).is_empty());
        assert_eq!(taken(&mut rows, [confirmed(300)]), ["115 1 2", "210 gap 0"]);
    }

    #[test]
    fn rows_that_nothing_confirms_before_a_silence_are_left_out_and_counted() {
        let mut rows = Rows::new(signals());
        let records = row(100).into_iter().chain([
            event(210, What::Unanswered(motor(), trouble())),
            event(310, What::Silent(motor(), trouble())),
        ]);
        assert_eq!(taken(&mut rows, records), ["210 gap 1"]);
        let records = row(400).into_iter().chain([event(450, What::Lost(trouble()))]);
        assert_eq!(taken(&mut rows, records), ["450 gap 1"]);
    }

    #[test]
    fn a_doubt_takes_the_rows_since_the_last_confirmation() {
        let mut rows = Rows::new(signals());
        let doubt = event(350, What::Doubtful(motor(), Instant(240)));
        let records = row(100)
            .into_iter()
            .chain(row(200))
            .chain([confirmed(240)])
            .chain(row(300))
            .chain([doubt]);
        assert_eq!(taken(&mut rows, records), ["115 1 2", "215 1 2", "350 gap 1"]);
    }

    #[test]
    fn the_doubt_of_another_motor_takes_nothing() {
        let mut rows = Rows::new(signals());
        let other = Motor::Rmd(MotorId::new(2).unwrap());
        let records = row(100).into_iter().chain([
            event(135, What::Doubtful(other, Instant(0))),
            event(136, What::Silent(other, trouble())),
            confirmed(140),
        ]);
        assert_eq!(taken(&mut rows, records), ["115 1 2"]);
    }

    #[test]
    fn rows_around_lost_records_are_not_trusted() {
        let mut rows = Rows::new(signals());
        let records = row(100).into_iter().chain([Record::Lost(3), confirmed(140)]);
        assert_eq!(taken(&mut rows, records), ["lost 3"]);
    }
}
