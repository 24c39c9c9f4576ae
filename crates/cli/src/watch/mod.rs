//! `motorlink watch`: a terminal view of motors, on the engine of each port.

mod args;
mod keys;
mod model;
mod ports;
mod screen;
mod settings;
mod values;
mod view;
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
use ratatui::crossterm::event::{self, Event, KeyEvent};

use crate::failure::Failure;
use crate::interrupt;
use crate::json::RmdUnits;
use crate::output::note;
use crate::st::StUnits;
pub use args::Args;
use keys::{Ask, Place, View};
use model::{Model, Port, Row};
use screen::{Screen, Wait};
use settings::{Access, Item};
use values::Units;
use work::{Done, Work};

/// How long to wait for a key.
const TICK: Duration = Duration::from_millis(50);
/// Between two pictures.
const PICTURE: Duration = Duration::from_millis(66);
/// Values that nobody writes are read again after this time.
const READ_AGAIN: Duration = Duration::from_secs(1);
/// Ages are shown in seconds.
const SECOND: Duration = Duration::from_secs(1);

pub fn run(args: Args) -> Result<(), Failure> {
    if args.port.iter().all(String::is_empty) {
        return Err(Failure::usage("the port is missing").trying(
            "give -p PORT, for several ports several times, or set MOTORLINK_PORT; `motorlink ports` \
             lists what is connected",
        ));
    }
    screen::require_terminal()?;
    let mut watch = Watch::open(&args)?;
    interrupt::take_over();
    interrupt::hold_on(true);
    let shown = Screen::enter().and_then(|mut screen| watch.show(&mut screen));
    // The terminal is as before. If a stop hangs, another signal ends it.
    interrupt::hold_on(false);
    let left = watch.leave();
    shown.and(left)
}

/// The view with its engines.
struct Watch {
    runners: Vec<Runner>,
    subscriptions: Vec<Subscription>,
    details: Option<Details>,
    work: Work,
    model: Model,
    place: Place,
    /// Values of the list of registers.
    read: BTreeMap<(usize, Item), Result<String, String>>,
    /// When the list was read, and whether it is being read.
    reading: (Option<Instant>, bool),
    has_changed: bool,
}

/// The signals of the details of a motor.
struct Details {
    row: usize,
    /// None until the engine has subscribed.
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
            rows.extend(port.motors.iter().map(|&motor| {
                let number = match motor {
                    Motor::St(number) => number.number(),
                    Motor::Rmd(id) => id.number(),
                };
                Row::new(at, motor, format!("{label}:{number}"), args.rate)
            }));
            ports.push(Port::new(label, port.name));
            runners.push(port.runner);
        }
        let units = Units {
            st: StUnits { profile: args.profile, raw: false, full_scale: args.full_scale },
            rmd: RmdUnits { raw: false, gear: args.gear_ratio, encoder_bits: None },
        };
        let place = Place::new(rows.len());
        let model = Model::new(units, ports, rows, args.rate);
        Ok(Watch {
            runners,
            subscriptions,
            details: None,
            work,
            model,
            place,
            read: BTreeMap::new(),
            reading: (None, false),
            has_changed: true,
        })
    }

    /// Shows the motors until the user or a signal ends it.
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
            let waited = screen.wait(TICK)?;
            if let Wait::Gone = waited {
                return Ok(());
            }
            // A resize comes without a key.
            while event::poll(Duration::ZERO)? {
                match event::read()? {
                    Event::Key(key) => match self.press(key) {
                        Some(Ask::Quit) => return Ok(()),
                        Some(Ask::Suspend) => screen.suspend()?,
                        _ => {}
                    },
                    Event::Resize(..) => {}
                    _ => continue,
                }
                self.has_changed = true;
            }
            self.receive()?;
            self.read_registers();
        }
        Ok(())
    }

    /// Takes a key, and does what it asks for. What only the screen can do is returned.
    fn press(&mut self, key: KeyEvent) -> Option<Ask> {
        let (model, before) = (&self.model, (self.place.view, self.place.row));
        let list = |row: usize| Item::of(model.rows[row].motor, &model.units);
        let asked = self.place.press(key, list, |item| item.unwritable(&model.units));
        if before != (self.place.view, self.place.row) {
            self.went();
        }
        let row = self.place.row;
        match asked? {
            Ask::StopAll => self.stop_all(),
            Ask::Stop => {
                let (port, motor) = (self.model.rows[row].port, self.model.rows[row].motor);
                self.model.stopping(row);
                self.work.stop(self.runners[port].remote(), row, motor);
            }
            Ask::Release => {
                self.runners.iter().for_each(|runner| self.work.release(runner.remote()));
            }
            Ask::Write(item, text) => self.work.write(self.access(row), row, item, text),
            ask @ (Ask::Quit | Ask::Suspend) => return Some(ask),
        }
        None
    }

    fn stop_all(&mut self) {
        for (port, runner) in self.runners.iter().enumerate() {
            let rows = self.model.rows.iter().enumerate();
            let of_port = rows.filter(|(_, row)| row.port == port);
            let motors: Vec<_> = of_port.map(|(at, row)| (at, row.motor)).collect();
            self.work.stop_all(runner.remote(), motors);
        }
        (0..self.model.rows.len()).for_each(|row| self.model.stopping(row));
    }

    /// The view or the motor is another now.
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

    /// Takes what the engines and the threads have.
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
            Done::Stopped(row, result) => self.model.stopped(row, result),
            Done::Details(row, id, records) => match &mut self.details {
                Some(details) if details.row == row && details.records.is_none() => {
                    details.records = Some((id, records));
                }
                // The user has gone on meanwhile.
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

    /// Reads the registers that are in view, from time to time.
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

    /// Ends the engines: they stop the motors that were started through them, and say which.
    fn leave(self) -> Result<(), Failure> {
        let mut result = Ok(());
        for (runner, port) in self.runners.into_iter().zip(&self.model.ports) {
            for stopped in runner.end() {
                let at = self.model.rows.iter().find(|row| row.motor == stopped.motor);
                let name = at.map_or(port.label.as_str(), |row| &row.name);
                match stopped.result {
                    Ok(()) => note(format!("{name} was stopped")),
                    Err(why) => {
                        let text = format!("{name} did not confirm its stop and may still turn");
                        result = Err(Failure::link(format!("{text}: {why}")));
                    }
                }
            }
        }
        result
    }
}
