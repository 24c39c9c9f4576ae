//! Stops that motors have not confirmed.

use std::sync::Arc;

use motorlink::port::Place;
use motorlink_proto::time::{Instant, Micros};

/// The pause before a stop that failed is repeated.
pub(super) const AGAIN: Micros = Micros::from_millis(1_000);

/// The longest pause before a number is searched again.
pub(super) const LONGEST_PAUSE: Micros = Micros::from_millis(60_000);

/// A stop that a motor has not confirmed.
pub(super) struct PendingStop {
    pub(super) by: Arc<str>,
    /// Whether it switches an RMD motor off.
    pub(super) is_off: bool,
    next: Next,
    /// The pause before the next search.
    pause: Micros,
}

/// When a stop is sent again. If the motor answers anything, that is at once.
enum Next {
    Answer,
    Repeat(Instant),
    /// There may be no such motor: the stop is one command among others.
    Search(Instant),
}

impl PendingStop {
    /// It is asked for now.
    pub(super) fn new(by: &Arc<str>) -> Self {
        PendingStop { by: Arc::clone(by), is_off: false, next: Next::Answer, pause: AGAIN }
    }

    /// Whether it switches an RMD motor off.
    pub(super) fn off(self, is_off: bool) -> Self {
        PendingStop { is_off, ..self }
    }

    pub(super) fn await_answer(&mut self) {
        self.next = Next::Answer;
    }

    pub(super) fn repeat(&mut self, now: Instant) {
        self.next = Next::Repeat(now + AGAIN);
    }

    /// Each search waits longer than the one before it.
    pub(super) fn search(&mut self, now: Instant) {
        self.next = Next::Search(now + self.pause);
        self.pause = (self.pause + self.pause).min(LONGEST_PAUSE);
    }

    /// Whether it is repeated now.
    pub(super) fn is_due(&self, now: Instant) -> bool {
        matches!(self.next, Next::Repeat(at) if at <= now)
    }

    /// Since when the motor should be searched.
    pub(super) fn search_due(&self, now: Instant) -> Option<Instant> {
        match self.next {
            Next::Search(at) if at <= now => Some(at),
            _ => None,
        }
    }
}

/// Ports whose motors have to be stopped when they are opened, and who asked for it.
#[derive(Default)]
pub(super) struct PendingPortStops(Vec<(Place, Arc<str>)>);

impl PendingPortStops {
    pub(super) fn add(&mut self, place: Place, by: &Arc<str>) {
        self.take(&place);
        self.0.push((place, Arc::clone(by)));
    }

    /// Who asked for the stop of a port that is open now.
    pub(super) fn take(&mut self, place: &Place) -> Option<Arc<str>> {
        let taken = self.0.extract_if(.., |(other, _)| other.is(place));
        taken.map(|(_, by)| by).last()
    }
}

/// A stop of all motors while no motor of the line had ever answered.
pub(super) struct LineStop {
    pub(super) by: Arc<str>,
    /// When it is repeated.
    pub(super) next: Instant,
}

/// Why a motor is stopped.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Why {
    Asked,
    /// It is one of all that the lines can have.
    OfAll,
    /// It did not confirm an earlier stop. Stops that are asked for now go first.
    Repeated,
}
