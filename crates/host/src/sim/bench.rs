//! Drives on served ports, and the world around them.

use std::cell::RefCell;
use std::collections::HashMap;
use std::os::fd::BorrowedFd;
use std::rc::Rc;
use std::time::Duration;

use motorlink_proto::rmd::{CanFrame, Mode, MotorId};
use motorlink_proto::time::Instant;
use motorlink_sim::rmd::{RmdBus, RmdNode};
use motorlink_sim::st::{StMotor, StStation};
use serde_json::{Value, json};

use super::{BenchConfig, Command, ConfigError, RomError, RomFolder, world};
use crate::port::{PortError, ServeName};
use crate::serve::{ByteStation, CanStation, Served, Server, Turn};

pub(super) type Station = StStation<Vec<StMotor>>;
pub(super) type Bus = RmdBus<Vec<RmdNode>>;

/// Simulated drives, each on a served port of its own, advanced to real time.
#[derive(Default)]
pub struct Bench {
    server: Server,
    places: Vec<Place>,
    rom: Option<Rc<RomFolder>>,
    /// A ROM that could not be written.
    failure: Rc<RefCell<Option<RomError>>>,
}

struct Place {
    port: String,
    drives: Drives,
}

enum Drives {
    St(Rc<RefCell<Station>>),
    Rmd(Rc<RefCell<Bus>>),
}

/// Why a port is not served.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ServeError {
    /// The port.
    #[error(transparent)]
    Port(#[from] PortError),
    /// The configuration.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The ROM on disk.
    #[error(transparent)]
    Rom(#[from] RomError),
}

impl Bench {
    /// A bench without drives, whose time begins now.
    pub fn new() -> Self {
        Self::default()
    }

    /// Keeps the ROM of RMD motors that are served from now on in `folder`.
    pub fn keep_rom(&mut self, folder: RomFolder) {
        self.rom = Some(Rc::new(folder));
    }

    /// Powers an ST drive on and serves it; gives what the port is, for programs to read.
    pub fn serve_st(
        &mut self,
        port: &ServeName,
        config: &BenchConfig,
    ) -> Result<Value, ServeError> {
        let station = Rc::new(RefCell::new(config.station(self.server.now())?));
        let served = self.server.serve_bytes(port, Box::new(StLine(Rc::clone(&station))))?;
        let motors = station.borrow().drive().motors().len();
        let profile = config.profile.name();
        let announcement = json!({
            "port": served.port, "protocol": "stmcp", "path": served.path, "motors": motors,
            "profile": profile,
        });
        self.places.push(Place::new(served, Drives::St(station)));
        Ok(announcement)
    }

    /// Powers RMD motors on and serves their bus; gives what the port is, for programs to read.
    pub fn serve_rmd(
        &mut self,
        port: &ServeName,
        config: &BenchConfig,
    ) -> Result<Value, ServeError> {
        let others = self.places.iter().filter(|place| matches!(place.drives, Drives::Rmd(_)));
        let number = others.count() + 1;
        let mut roms = HashMap::new();
        for motor in config.rmd_motors() {
            let rom = self.rom.as_ref().map(|folder| folder.load(number, motor)).transpose()?;
            roms.insert(motor.id, rom.unwrap_or_else(|| motor.factory_rom()));
        }
        let bus = config.bus(self.server.now(), |motor| roms[&motor.id])?;
        let bus = Rc::new(RefCell::new(bus));
        let rom = self.rom.as_ref().map(|folder| BusRom {
            folder: Rc::clone(folder),
            number,
            seen: HashMap::new(),
            failure: Rc::clone(&self.failure),
        });
        let served =
            self.server.serve_can(port, Box::new(RmdLine { bus: Rc::clone(&bus), rom }))?;
        let ids: Vec<u8> = bus.borrow().nodes().iter().map(|node| node.id().number()).collect();
        let announcement = json!({
            "port": served.port, "protocol": "rmd", "path": served.path, "motors": ids.len(),
            "ids": ids,
        });
        self.places.push(Place::new(served, Drives::Rmd(bus)));
        Ok(announcement)
    }

    /// Serves the ports once; waits at most `most` for something to do. `extra` is waited for too.
    ///
    /// # Errors
    /// A ROM that could not be written to its folder. The write is not acknowledged to the host.
    pub fn turn(
        &mut self,
        most: Duration,
        extra: Option<BorrowedFd<'_>>,
    ) -> Result<Turn, ServeError> {
        let turn = self.server.turn(most, extra)?;
        if let Some(failure) = self.failure.take() {
            return Err(failure.into());
        }
        let now = self.server.now();
        for place in &self.places {
            match &place.drives {
                Drives::St(station) => station.borrow_mut().advance_to(now),
                Drives::Rmd(bus) => bus.borrow_mut().advance_to(now),
            }
        }
        Ok(turn)
    }

    /// Obeys a command written as JSON; gives the answer, one line of JSON.
    pub fn obey(&mut self, line: &str) -> Value {
        let done = serde_json::from_str::<Command>(line)
            .map_err(|error| format!("not a command: {error}"))
            .and_then(|command| self.execute(&command));
        match done {
            Ok(answer) => answer,
            Err(why) => json!({ "ok": false, "error": why }),
        }
    }

    /// Executes a command; gives the answer, or why nothing was done.
    pub fn execute(&mut self, command: &Command) -> Result<Value, String> {
        let now = self.server.now();
        match command {
            Command::State { port } => {
                let wanted = |place: &&Place| port.as_ref().is_none_or(|port| *port == place.port);
                let places = self.places.iter().filter(wanted);
                let states: Vec<Value> = places.map(Place::state).collect();
                if states.is_empty() {
                    return Err(self.which_port(port.as_deref()));
                }
                return Ok(json!({ "ok": true, "time": now.0 as f64 / 1e6, "state": states }));
            }
            Command::Pause {} | Command::Resume {} => {
                self.server.hold(matches!(command, Command::Pause {}));
                return Ok(json!({ "ok": true }));
            }
            _ => command.check()?,
        }
        match &self.place(command)?.drives {
            Drives::St(station) => world::st(&mut station.borrow_mut(), now, command)?,
            Drives::Rmd(bus) => world::rmd(&mut bus.borrow_mut(), now, command)?,
        }
        Ok(json!({ "ok": true }))
    }

    fn place(&self, command: &Command) -> Result<&Place, String> {
        let found = match (command.port(), &self.places[..]) {
            (None, [only]) => Some(only),
            (None, _) => None,
            (Some(port), places) => places.iter().find(|place| place.port == port),
        };
        found.ok_or_else(|| self.which_port(command.port()))
    }

    fn which_port(&self, asked: Option<&str>) -> String {
        let ports: Vec<&str> = self.places.iter().map(|place| place.port.as_str()).collect();
        let ports = ports.join(", ");
        match asked {
            Some(port) => format!("`{port}` is not served; these are: {ports}"),
            None => format!("which port? these are served: {ports}"),
        }
    }
}

impl Place {
    fn new(served: Served, drives: Drives) -> Self {
        Place { port: served.port, drives }
    }

    fn state(&self) -> Value {
        let motors: Vec<Value> = match &self.drives {
            Drives::St(station) => {
                let station = station.borrow();
                let motors = station.drive().motors().iter().zip(1..);
                motors.map(|(motor, number)| st_state(motor, number)).collect()
            }
            Drives::Rmd(bus) => bus.borrow().nodes().iter().map(rmd_state).collect(),
        };
        json!({ "port": self.port, "motors": motors })
    }
}

fn st_state(motor: &StMotor, number: u8) -> Value {
    let truth = motor.truth();
    let plant = &truth.plant;
    json!({
        "motor": number,
        "status": truth.status.to_string(),
        "faults": truth.flags.to_string(),
        "speed_rpm": truth.speed_rpm,
        "speed_reference_rpm": truth.speed_reference_rpm,
        "angle_degrees": plant.angle_degrees,
        "iq_amps": plant.iq,
        "id_amps": plant.id,
        "iq_reference_amps": truth.iq_reference,
        "id_reference_amps": truth.id_reference,
        "phase_amps": plant.phase_currents,
        "torque_newton_metres": plant.torque,
        "bus_volts": plant.bus_voltage,
        "chopping": plant.chopping,
        "celsius": truth.temperature,
        "winding_celsius": plant.winding_temperature,
        "load_newton_metres": motor.plant().machine().load().brake,
        "locked": plant.locked,
    })
}

fn rmd_state(node: &RmdNode) -> Value {
    let motor = node.motor();
    let truth = motor.truth();
    let plant = &truth.plant;
    json!({
        "motor": node.id().number(),
        "mode": mode(truth.mode),
        "errors": node.drive().errors().to_string(),
        "speed_dps": truth.speed_dps,
        "speed_reference_dps": truth.speed_reference_dps,
        "angle_degrees": plant.angle_degrees,
        "output_degrees": plant.output_degrees,
        "iq_amps": plant.iq,
        "id_amps": plant.id,
        "phase_amps": plant.phase_currents,
        "torque_newton_metres": plant.torque,
        "supply_volts": plant.bus_voltage,
        "chopping": plant.chopping,
        "celsius": truth.temperature,
        "winding_celsius": plant.winding_temperature,
        "load_newton_metres": motor.plant().machine().load().brake,
        "locked": plant.locked,
        "rom_writes": motor.rom_writes(),
    })
}

fn mode(mode: Mode) -> &'static str {
    match mode {
        Mode::Off => "off",
        Mode::Stopped => "stopped",
        Mode::Torque(_) => "torque",
        Mode::Speed(_) => "speed",
        Mode::Position { .. } => "position",
    }
}

struct StLine(Rc<RefCell<Station>>);

impl ByteStation for StLine {
    fn receive(&mut self, now: Instant, bytes: &[u8], reply: &mut Vec<u8>) {
        self.0.borrow_mut().receive(now, bytes, |bytes| reply.extend_from_slice(bytes));
    }

    fn poll(&mut self, now: Instant, reply: &mut Vec<u8>) {
        self.0.borrow_mut().poll(now, |bytes| reply.extend_from_slice(bytes));
    }

    fn deadline(&self) -> Option<Instant> {
        self.0.borrow().deadline()
    }
}

struct RmdLine {
    bus: Rc<RefCell<Bus>>,
    rom: Option<BusRom>,
}

/// The ROM of a bus on disk.
struct BusRom {
    folder: Rc<RomFolder>,
    /// Which bus of the bench, from 1.
    number: usize,
    /// How often each motor's ROM had been written when it was brought to the disk.
    seen: HashMap<MotorId, u32>,
    failure: Rc<RefCell<Option<RomError>>>,
}

impl BusRom {
    /// Brings what was written to the disk; false when that failed.
    fn keep(&mut self, nodes: &[RmdNode]) -> bool {
        for node in nodes {
            let writes = node.motor().rom_writes();
            let seen = self.seen.entry(node.id()).or_default();
            if *seen == writes {
                continue;
            }
            match self.folder.store(self.number, node.motor().config(), node.drive().rom()) {
                Ok(()) => *seen = writes,
                Err(error) => {
                    *self.failure.borrow_mut() = Some(error);
                    return false;
                }
            }
        }
        true
    }
}

impl CanStation for RmdLine {
    /// A write to ROM is answered when it is on the disk.
    fn receive(&mut self, now: Instant, frame: &CanFrame, replies: &mut Vec<CanFrame>) {
        let before = replies.len();
        let mut bus = self.bus.borrow_mut();
        bus.receive(now, frame, |reply| replies.push(reply));
        if self.rom.as_mut().is_some_and(|rom| !rom.keep(bus.nodes())) {
            replies.truncate(before);
        }
    }

    fn poll(&mut self, _now: Instant, _replies: &mut Vec<CanFrame>) {}

    fn deadline(&self) -> Option<Instant> {
        None
    }
}
