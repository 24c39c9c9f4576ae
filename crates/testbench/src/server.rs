//! Drives on served ports.

use std::cell::RefCell;
use std::collections::HashMap;
use std::os::fd::BorrowedFd;
use std::rc::Rc;
use std::time::Duration;

use motorlink_link::port::PortError;
use motorlink_link::printable;
use motorlink_link::serve::ServeName;
use motorlink_link::serve::{Server, Station, Turn};
use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::MotorId;
use motorlink_proto::time::Instant;
use motorlink_sim::rmd::RmdNode;
use serde_json::{Value, json};

use super::drives::{Drives, Stage};
use super::line::{RmdStage, StStage};
use super::places::{Kind, ServedDrives};
use super::{BenchConfig, Command, ConfigError, RomError, RomFolder};

/// Simulated drives, each on a served port of its own, advanced to real time.
#[derive(Default)]
pub struct SimServer {
    server: Server,
    places: ServedDrives,
    rom: Option<Rc<RomFolder>>,
    /// A ROM that could not be written.
    failure: Rc<RefCell<Option<RomError>>>,
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

impl SimServer {
    /// A server without drives. Its time begins now.
    pub fn new() -> Self {
        Self::default()
    }

    /// Keeps the ROM of RMD motors that are served from now on in `folder`.
    pub fn keep_rom(&mut self, folder: RomFolder) {
        self.rom = Some(Rc::new(folder));
    }

    /// Powers an ST drive on and serves it. Returns the announcement of the port, a JSON object.
    pub fn serve_st(
        &mut self,
        port: &ServeName,
        config: &BenchConfig,
    ) -> Result<Value, ServeError> {
        let stage = Stage::new(Drives { st: Some(config.station(self.server.now())?), rmd: None });
        let served = self.server.serve_bytes(port, Box::new(StStage(stage.clone())))?;
        let motors: Vec<usize> = (1..=config.st_motors()).collect();
        let profile = config.profile.name();
        let announcement = json!({
            "port": served.port, "protocol": "st", "path": served.path, "motors": motors,
            "profile": profile,
        });
        self.places.add(served.port, Kind::St, stage);
        Ok(announcement)
    }

    /// Powers RMD motors on and serves their bus. Returns the announcement of the port, a JSON object.
    pub fn serve_rmd(
        &mut self,
        port: &ServeName,
        config: &BenchConfig,
    ) -> Result<Value, ServeError> {
        let others = self.places.iter().filter(|place| place.kind == Kind::Rmd);
        let number = others.count() + 1;
        let mut roms = HashMap::new();
        for motor in config.rmd_motors() {
            let rom = self.rom.as_ref().map(|folder| folder.load(number, motor)).transpose()?;
            roms.insert(motor.id, rom.unwrap_or_else(|| motor.factory_rom()));
        }
        let bus = config.bus(self.server.now(), |motor| roms[&motor.id])?;
        let ids: Vec<u8> = bus.nodes().iter().map(|node| node.id().number()).collect();
        let stage = Stage::new(Drives { st: None, rmd: Some(bus) });
        let line = RmdStage(stage.clone());
        let station: Box<dyn Station<CanFrame>> = match &self.rom {
            None => Box::new(line),
            Some(folder) => {
                let (folder, failure) = (Rc::clone(folder), Rc::clone(&self.failure));
                let rom = BusRom { folder, number, seen: HashMap::new(), failure };
                Box::new(StoredLine { line, rom })
            }
        };
        let served = self.server.serve_can(port, station)?;
        let announcement = json!({
            "port": served.port, "protocol": "rmd", "path": served.path, "motors": ids,
        });
        self.places.add(served.port, Kind::Rmd, stage);
        Ok(announcement)
    }

    /// Serves the ports once. Waits at most `most` for a request, or for `extra` to be readable.
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
        for place in self.places.iter() {
            drop(place.stage.at(now));
        }
        Ok(turn)
    }

    /// Executes a command written as JSON. Returns the answer, a JSON object.
    pub fn obey(&mut self, line: &str) -> Value {
        match Command::read(line).and_then(|command| self.execute(&command)) {
            Ok(answer) => answer,
            Err(why) => {
                json!({ "ok": false, "error": { "kind": "usage", "message": printable(&why) } })
            }
        }
    }

    /// Executes a command. Returns the answer, or why the command was not executed.
    pub fn execute(&mut self, command: &Command) -> Result<Value, String> {
        if let Command::Pause {} | Command::Resume {} = command {
            self.server.hold(matches!(command, Command::Pause {}));
            return Ok(json!({ "ok": true }));
        }
        self.places.execute(self.server.now(), command)
    }
}

/// RMD motors whose ROM is on disk.
struct StoredLine {
    line: RmdStage,
    rom: BusRom,
}

/// The ROM of a bus on disk.
struct BusRom {
    folder: Rc<RomFolder>,
    /// Number of the bus, from 1.
    number: usize,
    /// Number of ROM writes of each motor at the last store.
    seen: HashMap<MotorId, u32>,
    failure: Rc<RefCell<Option<RomError>>>,
}

impl BusRom {
    /// Stores changed ROMs on the disk. Returns false if that failed.
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

impl Station<CanFrame> for StoredLine {
    /// A write to ROM is answered after it is on the disk.
    fn receive(&mut self, now: Instant, received: &[CanFrame], replies: &mut Vec<CanFrame>) {
        let before = replies.len();
        self.line.receive(now, received, replies);
        let stage = self.line.0.last();
        let kept = stage.drives.rmd.as_ref().is_none_or(|bus| self.rom.keep(bus.nodes()));
        if !kept {
            replies.truncate(before);
        }
    }

    fn poll(&mut self, now: Instant, replies: &mut Vec<CanFrame>) {
        self.line.poll(now, replies);
    }

    fn deadline(&self) -> Option<Instant> {
        self.line.deadline()
    }
}
