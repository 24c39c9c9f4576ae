//! A line that this program reads: from the records of its engine to messages. Sans thread.

use motorlink_proto::time::Instant;
use motorlink_telemetry::acquisition::Rate;
use motorlink_telemetry::event::Event;
use motorlink_telemetry::plan::Wants;
use motorlink_telemetry::rows::{Item, MotorRows};
use motorlink_telemetry::share::event_text::EventText;
use motorlink_telemetry::signal::Signal;
use motorlink_telemetry::subscription::{Full, Record, Subscription};

use super::choice::Group;
use super::content::{Content, Values};
use super::frames::{Splitter, Taps};
use super::topics::Topics;
use super::wall::Anchor;
use crate::schema::Time;
use crate::write::Entry;

pub use super::content::{Counts, Line};

/// Records of a subscription that wait: a reply or an event each, of about 300 bytes. 16 motors that are
/// read twice at 100 Hz fill it in 15 s.
pub const CAPACITY: usize = 50_000;

/// The recording of a line.
#[derive(Debug)]
pub struct Track {
    content: Content,
    anchor: Anchor,
    feeds: Vec<Feed>,
    taps: Taps,
    splitter: Splitter,
    frames: usize,
    words: EventText,
    /// Losses in the queues that are counted.
    known_lost: u64,
}

/// Signals with the same period.
#[derive(Debug)]
struct Feed {
    subscription: Subscription,
    wants: Wants,
    rows: MotorRows,
}

impl Track {
    /// A line with the signals that are read. `anchor` is of its clock.
    pub fn new(
        line: Line,
        groups: Vec<Group>,
        anchor: Anchor,
        taps: Taps,
        topics: &mut Topics,
    ) -> Self {
        let feeds = groups.iter().map(Feed::new).collect();
        let (label, pairs) = (line.label.clone(), line.pairs());
        let content = Content::new(line, groups, topics);
        let frames = topics.frames(&label, pairs);
        let (splitter, words) = (Splitter::default(), EventText::default());
        Track { content, anchor, feeds, taps, splitter, frames, words, known_lost: 0 }
    }

    /// What to subscribe to. The first subscription has the events that are recorded.
    pub fn subscriptions(&self) -> impl Iterator<Item = (&Subscription, &Wants)> {
        self.feeds.iter().map(|feed| (&feed.subscription, &feed.wants))
    }

    /// What was recorded.
    pub fn counts(&self) -> Counts {
        self.content.counts
    }

    pub(super) fn content(&self) -> &Content {
        &self.content
    }

    /// The rates of the engine.
    pub fn take_rates(&mut self, rates: &[Rate]) {
        let rates: Vec<(Signal, f64)> =
            rates.iter().map(|rate| (rate.signal, rate.achieved)).collect();
        self.content.take_rates(&rates);
    }

    /// Whether a row that began before this moment of the line's clock may still be confirmed.
    pub fn is_pending_before(&self, instant: Instant) -> bool {
        self.feeds.iter().any(|feed| feed.rows.is_pending_before(instant))
    }

    /// Takes what came. `put` receives the messages.
    pub fn take(&mut self, now: Time, put: &mut dyn FnMut(Entry)) {
        for number in 0..self.feeds.len() {
            while let Some(record) = self.feeds[number].subscription.take() {
                self.record(number, &record, put);
            }
        }
        self.take_frames(put);
        self.take_losses(now, put);
        self.content.diagnose(now, put);
    }

    /// Nothing more comes.
    pub fn end(&mut self, now: Time, put: &mut dyn FnMut(Entry)) {
        self.take(now, put);
        self.content.tell_unconfirmed(now, put);
        let (topic, count) = (self.frames, &mut self.content.counts.frames);
        self.splitter.end(&mut |frame| {
            *count += 1;
            put(Entry::message(topic, frame.stamp, &frame));
        });
    }

    fn record(&mut self, number: usize, record: &Record, put: &mut dyn FnMut(Entry)) {
        let rows = &mut self.feeds[number].rows;
        rows.take(record);
        while let Some((motor, item)) = rows.next_item() {
            match item {
                Item::Row(row) => {
                    let samples = row.values.iter().map(|it| it.as_ref().ok().copied()).collect();
                    // The time of a row is in the middle.
                    let span_s = row.time.since(row.requested).0 as f64 * 2e-6;
                    let values = Values { stamp: self.anchor.wall(row.time), span_s, samples };
                    self.content.row(number, motor, &values, put);
                }
                Item::Gap(gap) => self.content.unconfirmed(gap.unconfirmed),
                // The queue counts them.
                Item::Lost(_) => {}
            }
        }
        if let Record::Event(event) = record
            && number == 0
        {
            self.event(event, put);
        }
    }

    fn event(&mut self, event: &Event, put: &mut dyn FnMut(Entry)) {
        if let Some(told) = self.words.of(self.content.line().speaks, &event.what) {
            self.content.told(self.anchor.wall(event.time), told, put);
        }
    }

    fn take_frames(&mut self, put: &mut dyn FnMut(Entry)) {
        let (topic, count) = (self.frames, &mut self.content.counts.frames);
        for seen in self.taps.take() {
            self.splitter.take(seen, &mut |frame| {
                *count += 1;
                put(Entry::message(topic, frame.stamp, &frame));
            });
        }
    }

    fn take_losses(&mut self, now: Time, put: &mut dyn FnMut(Entry)) {
        let of_feeds: u64 = self.feeds.iter().map(|feed| feed.subscription.lost()).sum();
        let lost = of_feeds + self.taps.lost();
        let new = lost - std::mem::replace(&mut self.known_lost, lost);
        self.content.lost(now, new, put);
    }
}

impl Feed {
    fn new(group: &Group) -> Self {
        let signals = || group.motors.iter().flat_map(|(_, signals)| signals).copied();
        let wants = signals().map(|signal| (signal, group.period)).collect();
        let subscription = Subscription::new(CAPACITY, Full::DropNewest);
        Feed { subscription, wants, rows: MotorRows::new(signals()) }
    }
}
