//! Simulated drives, and recordings of their signals.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use motorlink_link::Clock;
use motorlink_proto::time::{Instant, Micros};
use motorlink_sim::rmd::RmdConfig;

use super::cast::Cast;
use super::command::Command;
use super::config::{ConfigError, RmdSide, StSide};
use super::signals::{rmd_values, st_values};
use super::world;

/// An ST drive on its line, RMD motors on their bus, or both.
#[derive(Debug)]
pub(super) struct Drives {
    pub(super) st: Option<StSide>,
    pub(super) rmd: Option<RmdSide>,
}

impl Drives {
    /// Powers the drives on at time 0.
    pub(super) fn new(cast: &Cast) -> Result<Self, ConfigError> {
        let station = || cast.config.station(Instant(0));
        let bus = || cast.config.bus(Instant(0), RmdConfig::factory_rom);
        let (st, rmd) = (cast.st.then(station).transpose()?, cast.rmd.then(bus).transpose()?);
        Ok(Drives { st, rmd })
    }

    pub(super) fn advance_to(&mut self, now: Instant) {
        if let Some(station) = &mut self.st {
            station.advance_to(now);
        }
        if let Some(bus) = &mut self.rmd {
            bus.advance_to(now);
        }
    }

    /// Values of all signals, in the order of the motors and of the tables.
    pub(super) fn values(&self) -> impl Iterator<Item = f64> {
        let st = self.st.iter().flat_map(|station| station.drive().motors());
        let rmd = self.rmd.iter().flat_map(|bus| bus.nodes());
        st.flat_map(st_values).chain(rmd.flat_map(rmd_values))
    }

    /// Executes a command on the ST drive's surroundings.
    pub(super) fn change_st(&mut self, now: Instant, command: &Command) -> Result<(), String> {
        let station = self.st.as_mut().ok_or("there is no ST drive")?;
        world::st(station, now, command)
    }

    /// Executes a command on the RMD motors' surroundings.
    pub(super) fn change_rmd(&mut self, now: Instant, command: &Command) -> Result<(), String> {
        let bus = self.rmd.as_mut().ok_or("there are no RMD motors")?;
        world::rmd(bus, now, command)
    }
}

/// Drives that are shared by ports, commands and recordings.
#[derive(Clone)]
pub(super) struct Stage(Arc<Mutex<Observed>>);

/// Drives with the recordings of their signals.
pub(super) struct Observed {
    pub(super) drives: Drives,
    sheets: Vec<Sheet>,
}

/// One recording.
struct Sheet {
    key: u64,
    /// Places of the signals.
    columns: Vec<usize>,
    every: Micros,
    next: Instant,
    rows: Vec<f64>,
}

impl Stage {
    pub(super) fn new(drives: Drives) -> Self {
        Stage(Arc::new(Mutex::new(Observed { drives, sheets: Vec::new() })))
    }

    /// The drives as they are `now`.
    pub(super) fn at(&self, now: Instant) -> MutexGuard<'_, Observed> {
        let mut observed = self.last();
        observed.advance_to(now);
        observed
    }

    /// The drives at the time of the last access.
    pub(super) fn last(&self) -> MutexGuard<'_, Observed> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Starts to record the signals at `columns`. The first sample is taken now.
    pub(super) fn record(&self, clock: &Clock, columns: Vec<usize>, every: Micros) -> Recording {
        let now = clock.now();
        let mut observed = self.at(now);
        let key = observed.sheets.iter().map(|sheet| sheet.key + 1).max().unwrap_or(0);
        observed.sheets.push(Sheet { key, columns, every, next: now, rows: Vec::new() });
        Recording { stage: self.clone(), clock: clock.clone(), key, began: now, every }
    }
}

impl Observed {
    fn advance_to(&mut self, now: Instant) {
        while let Some(next) = self.sheets.iter().map(|sheet| sheet.next).min()
            && next <= now
        {
            self.drives.advance_to(next);
            let values: Vec<f64> = self.drives.values().collect();
            for sheet in self.sheets.iter_mut().filter(|sheet| sheet.next == next) {
                sheet.rows.extend(sheet.columns.iter().map(|&column| values[column]));
                sheet.next += sheet.every;
            }
        }
        self.drives.advance_to(now);
    }
}

/// Signals that are recorded at a fixed interval until this is dropped.
pub struct Recording {
    stage: Stage,
    clock: Clock,
    key: u64,
    began: Instant,
    every: Micros,
}

impl Recording {
    /// When the first sample was taken.
    pub fn began(&self) -> Instant {
        self.began
    }

    /// The interval between samples.
    pub fn every(&self) -> Micros {
        self.every
    }

    /// The samples since the last call, row by row: all signals of one moment, then those of the next. A
    /// sample is the state before the events of its moment.
    pub fn take(&self) -> Vec<f64> {
        let mut observed = self.stage.at(self.clock.now());
        let sheet = observed.sheets.iter_mut().find(|sheet| sheet.key == self.key);
        sheet.map(|sheet| std::mem::take(&mut sheet.rows)).unwrap_or_default()
    }
}

impl Drop for Recording {
    fn drop(&mut self) {
        self.stage.last().sheets.retain(|sheet| sheet.key != self.key);
    }
}
