//! `motorlink watch`: a terminal view of motors. Each port has an engine.

mod args;
mod keys;
mod model;
mod ports;
mod row;
pub mod screen;
mod settings;
mod share;
mod values;
pub mod view;
mod work;

#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

use motorlink_telemetry::acquisition::ConsumerId;
use motorlink_telemetry::runner::Runner;
use motorlink_telemetry::signal::Motor;
use motorlink_telemetry::subscription::Subscription;
use ratatui::crossterm::event::KeyEvent;

use crate::advice::STOP_AGAIN;
use crate::failure::Failure;
use crate::interrupt;
use crate::json::RmdUnits;
use crate::output::note;
use crate::st::StUnits;
pub use args::Args;
use keys::{Ask, Selection, View};
use model::{Model, Port};
use row::Row;
use screen::Screen;
use settings::{Access, Item};
use share::Share;
use values::Units;
use work::{Done, Stopping, Work};

/// The longest wait for a key.
const TICK: Duration = Duration::from_millis(50);
/// Least time between two drawings of the screen.
const PICTURE: Duration = Duration::from_millis(66);
/// Registers in view are read again after this time.
const READ_AGAIN: Duration = Duration::from_secs(1);
/// The screen is drawn at least this often: ages change each second.
const SECOND: Duration = Duration::from_secs(1);

pub fn run(args: Args) -> Result<(), Failure> {
    if args.port.iter().all(String::is_empty) {
        return Err(Failure::usage("the port is missing").trying(
            "give -p PORT, for several ports several times, or set MOTORLINK_PORT; `motorlink ports` \
             lists what is connected",
        ));
    }
    screen::require_terminal_of(
        "watch",
        "for values as lines use --every: `motorlink st get SPEED_MEAS --every 100ms` or `motorlink \
         rmd status --every 100ms`",
    )?;
    let mut watch = Watch::open(&args)?;
    interrupt::take_over();
    interrupt::hold_on(true);
    let shown = Screen::enter().and_then(|mut screen| watch.show(&mut screen));
    // The terminal is restored now. If a stop hangs, a second signal ends the program.
    interrupt::hold_on(false);
    watch.await_stops();
    let left = watch.leave();
    shown.and(left)
}

/// The view and the engines of its ports.
struct Watch {
    runners: Vec<Runner>,
    subscriptions: Vec<Subscription>,
    /// Subscriptions for motors that were found later, each with its port.
    added: Vec<(usize, Subscription)>,
    details: Option<Details>,
    shares: Vec<Share>,
    work: Work,
    model: Model,
    place: Selection,
    /// Values of registers, or why there is none.
    read: BTreeMap<(usize, Item), Result<String, String>>,
    /// When registers were last read, and whether a read is in progress.
    reading: (Option<Instant>, bool),
    has_changed: bool,
}

/// The subscription to all signals of one motor.
struct Details {
    row: usize,
    /// `None` until the engine has confirmed the subscription.
    records: Option<(ConsumerId, Subscription)>,
}

impl Watch {
    fn open(args: &Args) -> Result<Self, Failure> {
        let by: Arc<str> = format!("watch {}", std::process::id()).into();
        let work = Work::new(Arc::clone(&by));
        let mut opened = Vec::new();
        for port in args.port.iter().filter(|port| !port.is_empty()) {
            opened.extend(ports::open(args, port, &by)?);
        }
        let names: Vec<String> = opened.iter().map(|port| port.name.clone()).collect();
        let labels = ports::labels(&names);
        let (mut ports, mut rows) = (Vec::new(), Vec::new());
        let (mut runners, mut subscriptions) = (Vec::new(), Vec::new());
        for (at, (port, label)) in opened.into_iter().zip(labels).enumerate() {
            let remote = port.runner.remote();
            let records = work::subscribe(remote, &port.motors, args.rate);
            subscriptions.push(records.map_err(|ended| Failure::link(ended.to_string()))?);
            work.rates(remote, at);
            rows.extend(port.motors.iter().map(|&motor| row(at, motor, &label, args.rate)));
            ports.push(Port::new(label, port.name, port.protocol));
            runners.push(port.runner);
        }
        let units = Units {
            st: StUnits { profile: args.profile, raw: false, full_scale: args.full_scale },
            rmd: RmdUnits { raw: false, gear: args.gear_ratio, encoder_bits: None },
        };
        let place = Selection::new(rows.len());
        let model = Model::new(by, units, ports, rows, args.rate);
        Ok(Watch {
            runners,
            subscriptions,
            added: Vec::new(),
            details: None,
            shares: Share::of(&names, &work),
            work,
            model,
            place,
            read: BTreeMap::new(),
            reading: (None, false),
            has_changed: true,
        })
    }

    /// Shows the motors until a key or a signal ends the program.
    fn show(&mut self, screen: &mut Screen) -> Result<(), Failure> {
        let mut drawn = Instant::now();
        let theme = view::Theme::of_terminal();
        while !interrupt::interrupted() {
            self.has_changed |= screen.obey()?;
            if self.has_changed && drawn.elapsed() >= PICTURE || drawn.elapsed() >= SECOND {
                let shown =
                    view::Shown { model: &self.model, place: &self.place, read: &self.read };
                screen.terminal.draw(|frame| view::draw(frame, &shown, &theme))?;
                (drawn, self.has_changed) = (Instant::now(), false);
            }
            let input = screen.input(TICK, |screen, key| match self.press(key) {
                Some(Ask::Quit) => Ok(false),
                Some(Ask::Suspend) => screen.suspend().map(|()| true),
                _ => Ok(true),
            })?;
            let Some(is_new) = input else { return Ok(()) };
            self.has_changed |= is_new;
            self.receive()?;
            self.repeat_stops();
            self.read_registers();
        }
        Ok(())
    }

    /// Handles a key. Returns actions for the screen.
    fn press(&mut self, key: KeyEvent) -> Option<Ask> {
        let (model, before) = (&self.model, (self.place.view, self.place.row));
        let list = |row: usize| Item::of(model.rows[row].motor, &model.units);
        let (read, row) = (&self.read, self.place.row);
        let unwritable = |item: Item| {
            let unread = || match read.get(&(row, item)) {
                Some(Err(why)) => Some(format!("{} cannot be edited: {why}", item.name())),
                _ => None,
            };
            item.unwritable(&model.units).or_else(unread)
        };
        let asked = self.place.press(key, list, unwritable);
        if before != (self.place.view, self.place.row) {
            self.went();
        }
        let row = self.place.row;
        match asked? {
            Ask::StopAll => self.stop_all(),
            Ask::Stop => self.stop(row),
            Ask::Find => {
                self.model.say(None, "looking for more motors ...", false);
                for (port, runner) in self.runners.iter().enumerate() {
                    let known = self.model.motors(port);
                    let protocol = self.model.ports[port].protocol;
                    self.work.find(runner.remote(), port, protocol, known, self.model.period);
                }
            }
            Ask::Release => {
                self.shares.iter().for_each(|share| share.latch(false));
                self.runners.iter().for_each(|runner| self.work.release(runner.remote()));
            }
            Ask::Write(item, text) => self.work.write(self.access(row), row, item, text),
            ask @ (Ask::Quit | Ask::Suspend) => return Some(ask),
        }
        None
    }

    fn stop_all(&mut self) {
        self.shares.iter().for_each(|share| share.latch(true));
        for (port, runner) in self.runners.iter().enumerate() {
            let rows = 0..self.model.rows.len();
            let of_port: Vec<_> = rows.filter(|&row| self.model.rows[row].port == port).collect();
            let stops = of_port.into_iter().map(|row| stopping(&mut self.model, row)).collect();
            self.work.stop_all(runner.remote(), stops);
        }
    }

    fn stop(&mut self, row: usize) {
        let stop = stopping(&mut self.model, row);
        self.work.stop(self.remote(row), stop);
    }

    /// Stops the motors again that did not confirm a stop and reply again.
    fn repeat_stops(&mut self) {
        for row in self.model.due_stops(Instant::now()) {
            self.stop(row);
        }
    }

    /// Waits for the stops in progress. The time of each is bounded.
    fn await_stops(&mut self) {
        let motors = self.model.being_stopped();
        if motors.is_empty() {
            return;
        }
        note(format!("waiting until {motors} confirms the stop"));
        interrupt::complete_stop(motors);
        while !self.model.being_stopped().is_empty() {
            let Ok(done) = self.work.done.recv() else { break };
            self.take(done);
        }
        interrupt::stop_is_complete();
    }

    /// Changes the subscription to details after a change of page or motor.
    fn went(&mut self) {
        let wanted = (self.place.view == View::Details).then_some(self.place.row);
        if self.details.as_ref().map(|details| details.row) != wanted {
            let left = std::mem::replace(
                &mut self.details,
                wanted.map(|row| Details { row, records: None }),
            );
            if let Some(Details { row, records: Some((id, _)) }) = left {
                self.work.unwatch(self.remote(row), id);
            }
            if let Some(row) = wanted {
                let (motor, period) = (self.model.rows[row].motor, self.model.period);
                self.work.watch_details(self.remote(row), row, motor, period);
            }
        }
        if self.place.view == View::Settings {
            self.reading.0 = None;
        }
    }

    fn remote(&self, row: usize) -> &motorlink_telemetry::runner::Remote {
        self.runners[self.model.rows[row].port].remote()
    }

    fn access(&self, row: usize) -> Access {
        let (remote, by) = (self.remote(row).clone(), Arc::clone(&self.work.by));
        Access { remote, by, motor: self.model.rows[row].motor, units: self.model.units }
    }

    /// Handles records of the engines and results of the threads.
    fn receive(&mut self) -> Result<(), Failure> {
        for (port, records) in self.subscriptions.iter().enumerate() {
            while let Some(record) = records.take() {
                self.model.take(port, &record);
                self.has_changed = true;
            }
            if records.is_closed() {
                let name = &self.model.ports[port].name;
                return Err(Failure::link(format!("{name}: the engine of this port has ended")));
            }
        }
        for (port, records) in &self.added {
            while let Some(record) = records.take() {
                self.model.take_added(*port, &record);
                self.has_changed = true;
            }
        }
        if let Some(Details { row, records: Some((_, records)) }) = &self.details {
            while let Some(record) = records.take() {
                self.model.take_details(*row, &record);
                self.has_changed = true;
            }
        }
        while let Ok(done) = self.work.done.try_recv() {
            self.has_changed = true;
            self.take(done);
        }
        Ok(())
    }

    fn take(&mut self, done: Done) {
        match done {
            Done::Rates(port, rates) => self.model.rates(port, &rates),
            Done::Stopped(stop, result) => self.model.stopped(stop.row, stop.number, result),
            Done::NoMotor(stop) => self.model.has_no_motor(stop.row, stop.number),
            Done::Found(port, found) => self.found(port, found),
            Done::Latch(share, latch) => {
                let ports = &self.shares[share].ports;
                ports.iter().for_each(|&port| self.model.set_share_latch(port, latch.clone()));
            }
            Done::Details(row, id, records) => match &mut self.details {
                Some(details) if details.row == row && details.records.is_none() => {
                    details.records = Some((id, records));
                }
                // The page or the motor has changed meanwhile.
                _ => self.work.unwatch(self.remote(row), id),
            },
            Done::Read(row, item, value) => drop(self.read.insert((row, item), value)),
            Done::AllRead => self.reading = (Some(Instant::now()), false),
            Done::Written(row, item, result) => {
                let name = &self.model.rows[row].name;
                let (text, is_bad) = match result {
                    Ok(text) => (format!("{name}: {text}"), false),
                    Err(why) => (format!("{name}: {}: NOT WRITTEN: {why}", item.name()), true),
                };
                self.model.say(Some(row), text.clone(), is_bad);
                self.place.message = Some((text, is_bad));
                self.reading.0 = None;
            }
        }
    }

    /// Adds rows for the motors that a search found.
    fn found(&mut self, port: usize, found: Result<(Vec<Motor>, Subscription), String>) {
        let label = self.model.ports[port].label.clone();
        match found {
            Ok((motors, records)) => {
                // An earlier search may have added them.
                let is_new = |motor: &Motor| self.model.find(port, *motor).is_none();
                let motors: Vec<Motor> = motors.into_iter().filter(is_new).collect();
                self.model.say(None, format!("{label}: {} more motors", motors.len()), false);
                let rows = motors.into_iter().map(|it| row(port, it, &label, self.model.period));
                self.model.rows.extend(rows);
                self.place.rows = self.model.rows.len();
                self.added.push((port, records));
            }
            Err(why) => {
                self.model.say(None, format!("{label}: no motors were looked for: {why}"), true);
            }
        }
    }

    /// Reads the registers in view again when they are due.
    fn read_registers(&mut self) {
        let (since, is_reading) = self.reading;
        let is_due = since.is_none_or(|since| since.elapsed() >= READ_AGAIN);
        if self.place.view != View::Settings || is_reading || !is_due {
            return;
        }
        let row = self.place.row;
        let items = view::settings::in_view(&self.place);
        self.reading.1 = true;
        self.work.read(self.access(row), row, items);
    }

    /// Ends the engines and reports the motors that may still be turning.
    fn leave(self) -> Result<(), Failure> {
        let mut turning: Vec<(String, String)> = Vec::new();
        for row in &self.model.rows {
            turning.extend(row.unconfirmed.clone().map(|why| (row.name.clone(), why)));
        }
        for (runner, port) in self.runners.into_iter().zip(&self.model.ports) {
            for stopped in runner.end() {
                let at = self.model.rows.iter().find(|row| row.motor == stopped.motor);
                let name = at.map_or(port.label.as_str(), |row| &row.name);
                match stopped.result {
                    Ok(()) => note(format!("{name} was stopped")),
                    Err(why) => turning.push((name.to_owned(), why.to_string())),
                }
            }
        }
        let Some((_, why)) = turning.first() else { return Ok(()) };
        let names: Vec<&str> = turning.iter().map(|(name, _)| name.as_str()).collect();
        Err(Failure::link(format!(
            "{} did not confirm the stop and may still be turning: {why}",
            names.join(" ")
        ))
        .trying(STOP_AGAIN))
    }
}

/// The row of a motor, without values yet.
fn row(port: usize, motor: Motor, label: &str, period: Duration) -> Row {
    Row::new(port, motor, format!("{label}:{}", motor.number()), period)
}

/// Begins a stop in the model.
fn stopping(model: &mut Model, row: usize) -> Stopping {
    Stopping { row, motor: model.rows[row].motor, number: model.stopping(row) }
}
