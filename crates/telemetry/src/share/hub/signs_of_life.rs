//! The signs of life of a program, and the age of its commands.

use litemap::LiteMap as Map;
use motorlink_proto::Motion;
use motorlink_proto::time::{Instant, Micros};

use crate::signal::Motor;

/// What a program has declared, and what was heard of it.
#[derive(Default)]
pub(super) struct SignsOfLife {
    /// Nothing may be missing for longer than this.
    pub(super) silence: Option<Micros>,
    /// No motor that it moves may be without a new command for longer than this.
    pub(super) motion: Option<Micros>,
    heard: Instant,
    commanded: Map<(usize, Motor), Instant>,
}

impl SignsOfLife {
    /// The program has made a request at this time.
    pub(super) fn heard(&mut self, made: Instant) {
        self.heard = self.heard.max(made);
    }

    /// The program has made a command to a motor at this time.
    pub(super) fn commanded(&mut self, made: Instant, place: (usize, Motor), motion: Motion) {
        if motion.may_be_owned() {
            let last = self.commanded.entry(place).or_insert(made);
            *last = made.max(*last);
        } else if motion.stops() {
            self.commanded.remove(&place);
        }
    }

    /// A line is gone.
    pub(super) fn forget(&mut self, line: usize) {
        self.commanded.retain(|(of, _), _| *of != line);
    }

    pub(super) fn shift(&mut self, by: Micros) {
        self.heard += by;
        self.commanded.iter_mut().for_each(|(_, at)| *at += by);
    }

    /// How long nothing was heard of it, if that is too long.
    pub(super) fn silent(&self, now: Instant) -> Option<Micros> {
        let silent = now.since(self.heard);
        self.silence.filter(|most| silent > *most).map(|_| silent)
    }

    /// The motors whose last command is too old, and its age.
    pub(super) fn late(&self, now: Instant) -> impl Iterator<Item = ((usize, Motor), Micros)> {
        let late = self.commanded.iter().map(move |(place, at)| (*place, now.since(*at)));
        late.filter(|(_, age)| self.motion.is_some_and(|most| *age > most))
    }
}
