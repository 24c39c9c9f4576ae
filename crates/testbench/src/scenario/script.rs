//! Plays the events of a scenario in the order of time.

use motorlink_proto::time::{Instant, Micros};
use motorlink_sim::hash;

use super::event::{Event, load};
use super::moment::seconds;
use super::profile::LoadProfile;
use super::run::{Mark, Played, Refusal};
use crate::cast::{Cast, Target};
use crate::config::ConfigError;
use crate::drives::Drives;

/// Interval at which a load profile is applied.
const LOAD_STEP: Micros = Micros(50);

/// Drives with their events.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Script {
    pub(super) cast: Cast,
    /// In the order of their time.
    pub(super) events: Vec<Event>,
    pub(super) loads: Vec<(Target, LoadProfile)>,
}

impl Script {
    /// Powers the drives on and plays all events.
    pub(super) fn play(&self, duration: Micros, sample: Micros) -> Result<Played, ConfigError> {
        let mut drives = Drives::new(&self.cast)?;
        let end = Instant(duration.0);
        let mut columns = vec![Vec::new(); self.cast.signals().len()];
        let mut refusals = Vec::new();
        let mut events = self.events.iter().peekable();
        let mut now = Instant(0);
        let mut next_sample = Instant(0);
        loop {
            drives.advance_to(now);
            for (target, profile) in &self.loads {
                let command = load(*target, profile.at(now));
                drives.change(now, *target, &command).map_err(ConfigError::Impossible)?;
            }
            if now == next_sample {
                columns.iter_mut().zip(drives.values()).for_each(|(all, value)| all.push(value));
                next_sample += sample;
            }
            while let Some(event) = events.next_if(|event| event.at <= now) {
                let reply = drives.act(now, event.target, &event.action);
                let reply = reply.map_err(ConfigError::Impossible)?;
                if reply != event.refused {
                    refusals.push(event.refusal(reply));
                }
            }
            if now == end {
                break;
            }
            let load = (!self.loads.is_empty()).then(|| now + LOAD_STEP);
            let event = events.peek().map(|event| event.at);
            let next = [load, event].into_iter().flatten().fold(next_sample, Instant::min);
            now = next.min(end);
        }
        let marked = self.events.iter().filter(|event| !event.label.is_empty());
        let marks = marked
            .map(|event| Mark { at: seconds(event.at), label: event.label.clone() })
            .collect();
        Ok(Played { columns, marks, refusals, state_hash: hash::fingerprint(&drives) })
    }
}

impl Event {
    /// The reply of the drive as an unexpected refusal.
    fn refusal(&self, reply: Option<String>) -> Refusal {
        Refusal {
            at: seconds(self.at),
            motor: self.target.to_string(),
            event: self.words.clone(),
            reply,
            announced: self.refused.clone(),
        }
    }
}
