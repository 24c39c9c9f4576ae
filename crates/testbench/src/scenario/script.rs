//! What drives are told and what happens to them, in the order of time.

use motorlink_proto::rmd::MotorId;
use motorlink_proto::stmcp::Motor;
use motorlink_proto::time::{Duration, Instant};
use motorlink_sim::hash;

use super::event::load;
use super::profile::LoadProfile;
use super::run::Played;
use super::signals::{RMD, ST, Signal};
use super::{Event, Mark, Refusal, Target, seconds};
use crate::drives::Drives;
use crate::{BenchConfig, ConfigError};

/// How often a load that changes all the time is set.
const LOAD_STEP: Duration = Duration(50);

/// Drives with their script.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Script {
    pub(super) cast: Cast,
    /// In the order of their time.
    pub(super) events: Vec<Event>,
    pub(super) loads: Vec<(Target, LoadProfile)>,
}

/// The drives that are there.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Cast {
    pub(crate) config: BenchConfig,
    /// Whether there is an ST drive.
    pub(crate) st: bool,
    /// Whether there is a bus of RMD motors.
    pub(crate) rmd: bool,
}

impl Cast {
    /// The motors, in the order of their signals.
    pub(super) fn targets(&self) -> Vec<Target> {
        let st = (1..).map_while(Motor::new).take(self.config.st_motors()).map(Target::St);
        let ids = self.config.rmd_motors().iter().filter_map(|motor| MotorId::new(motor.id));
        let mut ids: Vec<MotorId> = ids.collect();
        ids.sort_unstable();
        let rmd = ids.into_iter().map(Target::Rmd);
        st.filter(|_| self.st).chain(rmd.filter(|_| self.rmd)).collect()
    }

    /// What can be looked at.
    pub(crate) fn signals(&self) -> Vec<Signal> {
        let of = |target: Target| -> Vec<Signal> {
            let name = target.to_string();
            match target {
                Target::St(_) => ST.iter().map(|row| row.signal(&name)).collect(),
                Target::Rmd(_) => RMD.iter().map(|row| row.signal(&name)).collect(),
            }
        };
        self.targets().into_iter().flat_map(of).collect()
    }
}

impl Script {
    /// Powers the drives on and lets everything happen.
    pub(super) fn play(&self, duration: Duration, sample: Duration) -> Result<Played, ConfigError> {
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
    /// That the drive replied so, which was not announced.
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
