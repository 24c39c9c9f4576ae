//! The connection of a port to its share.

use std::cell::Cell;
use std::collections::BTreeSet;
use std::os::fd::BorrowedFd;
use std::time::{Duration, Instant};

use motorlink::port::{self, FdLink, Holder, Link, PortError};
use motorlink::st::Profile;

use super::line_address::{Deadlines, LineAddress};
use super::pulse::Socket;
use crate::share::VERSION;
use crate::share::client_codec::{ClientCodec, CodecError, Ended, Heard};
use crate::share::command_kind::CommandKind;
use crate::share::drive_protocol::DriveProtocol;
use crate::share::message::{Answer, Ask, Ending, LONGEST_NAME, Line, MotorName, Protocol, Text};

/// How long a share may take for the answer to hello.
const OPENING: Duration = Duration::from_secs(5);

/// A request is not sent later than this after the program has made it.
const TIME_TO_LIVE: Duration = Duration::from_secs(1);

/// The connection to a share.
pub(super) struct Connection {
    port: LineAddress,
    socket: Socket,
    codec: ClientCodec,
    holder: Holder,
    /// The time to live of the next request, if it is shorter.
    expires: Cell<Duration>,
    /// Whether requests are for motors that no other program has moved since.
    is_own: Cell<bool>,
    /// Motors that this program has moved through a connection before this one.
    claims: Cell<Vec<u8>>,
    /// What the share does with the motors of this program when it leaves, and what it knows of that.
    ending: Cell<Ending>,
    declared: Ending,
    /// The motors that were taken from other programs.
    taken: BTreeSet<u8>,
    /// Whether the share has the deadlines: once the program has changed something.
    has_deadlines: bool,
    /// Why the share closes the connection.
    closing: Option<String>,
}

impl Connection {
    /// Connects to a share, and looks for the line there.
    pub(super) fn open(port: &LineAddress) -> Result<Self, PortError> {
        let stream = port.at.connect().map_err(|error| port.unreachable(error))?;
        let mut opened = Connection {
            socket: Socket::new(FdLink::new(stream, port.name())?),
            has_deadlines: false,
            port: port.clone(),
            codec: ClientCodec::default(),
            holder: Holder { patience: OPENING, profile: None },
            expires: Cell::new(TIME_TO_LIVE),
            is_own: Cell::new(false),
            claims: Cell::default(),
            ending: Cell::default(),
            declared: Ending::default(),
            taken: BTreeSet::new(),
            closing: None,
        };
        opened.opening(Ask::Hello { protocol: VERSION, name: own_name() })?;
        let Answer::Lines { lines, .. } = opened.opening(Ask::Lines)? else {
            return Err(opened.no_share());
        };
        opened.holder = opened.holder_of(&lines)?;
        Ok(opened)
    }

    /// The answer to a request before the first command.
    fn opening(&mut self, ask: Ask) -> Result<Answer, PortError> {
        let id = self.ask(ask)?;
        let ended = self.receive(Some(OPENING))?.filter(|ended| ended.id == id);
        let ended = ended.ok_or_else(|| self.no_share())?;
        ended.result.map_err(|refusal| self.port.failed(refusal.message))
    }

    fn no_share(&self) -> PortError {
        self.port.failed("nothing answers like a share: is this the socket of a share?")
    }

    /// What the share says of the line.
    fn holder_of(&self, lines: &[Line]) -> Result<Holder, PortError> {
        let own = |it: &&Line| it.line == self.port.line && it.protocol == self.port.protocol;
        let Some(line) = lines.iter().find(own) else {
            let names: Vec<_> = lines.iter().map(|it| it.line.as_str()).collect();
            let why = format!("the share has no such line; its lines are {}", names.join(", "));
            return Err(self.port.failed(why));
        };
        let patience = line.patience();
        let Some(name) = &line.profile else { return Ok(Holder { patience, profile: None }) };
        let profile = Profile::ALL.into_iter().find(|profile| profile.name() == name);
        match profile {
            Some(_) => Ok(Holder { patience, profile }),
            None => Err(self.port.failed(format!("the share uses the unknown profile {name}"))),
        }
    }

    pub(super) fn descriptor(&self) -> BorrowedFd<'_> {
        self.socket.descriptor()
    }

    /// Sends a command to a motor; gives its id.
    pub(super) fn command(&mut self, motor: u8, bytes: Vec<u8>) -> Result<u32, PortError> {
        let time_to_live = self.expires.replace(TIME_TO_LIVE).as_secs_f64();
        let line = self.port.line.clone();
        let (claims, changes) = (self.claims.take(), self.changes(motor, &bytes));
        if !self.has_deadlines && (changes || !claims.is_empty()) {
            self.has_deadlines = true;
            self.declare_deadlines()?;
        }
        let motion = self.ending.get();
        if motion != self.declared && (changes || !claims.is_empty()) {
            self.declared = motion;
            self.ask(Ask::Ending { motion })?;
        }
        for motor in claims {
            let motor = MotorName { line: line.clone(), motor };
            self.ask(Ask::Claim { motor })?;
        }
        if self.port.at.takes() && changes && self.taken.insert(motor) {
            let motor = MotorName { line: line.clone(), motor };
            self.ask(Ask::Take { motor })?;
        }
        let (continues, own) = (false, self.is_own.get());
        self.ask(Ask::Command { line, motor, bytes, time_to_live, continues, own })
    }

    /// From now on the share ends the motion of this program if it does not seem to live. One that only
    /// reads needs no thread.
    fn declare_deadlines(&mut self) -> Result<(), PortError> {
        let Deadlines { silence, motion } = self.port.deadlines;
        // Without a thread it would lapse while it does something else.
        let silence = silence.filter(|silence| self.socket.live(*silence).is_ok());
        if silence.is_none() && motion.is_none() {
            return Ok(());
        }
        let seconds = |span: Duration| span.as_secs_f64();
        let (silence, motion) = (silence.map(seconds), motion.map(seconds));
        self.ask(Ask::Deadline { silence, motion }).map(drop)
    }

    fn changes(&self, motor: u8, bytes: &[u8]) -> bool {
        let speaks = match self.port.protocol {
            Protocol::St => DriveProtocol::St(self.holder.profile.unwrap_or_default()),
            Protocol::Rmd => DriveProtocol::Rmd,
        };
        CommandKind::of_bytes(speaks, motor, bytes).changes()
    }

    /// Sends a request; gives its id.
    pub(super) fn ask(&mut self, ask: Ask) -> Result<u32, PortError> {
        let request = self.codec.request(ask);
        let (id, stream) = request.map_err(|error| self.port.failed(error.to_string()))?;
        match self.socket.write(&stream) {
            Ok(()) => Ok(id),
            // What came before the end says why.
            Err(error @ PortError::Closed { .. }) => match self.receive(Some(Duration::ZERO)) {
                Err(why) => Err(why),
                Ok(_) => Err(error),
            },
            Err(error) => Err(error),
        }
    }

    /// The next end of a request. Waits at most `timeout`.
    pub(super) fn receive(
        &mut self,
        timeout: Option<Duration>,
    ) -> Result<Option<Ended>, PortError> {
        let deadline = timeout.and_then(|timeout| Instant::now().checked_add(timeout));
        let mut bytes = [0; 4096];
        loop {
            let damaged = |error: CodecError| self.port.failed(error.to_string());
            while let Some(heard) = self.codec.hear().map_err(damaged)? {
                match heard {
                    Heard::Ended(ended) => return Ok(Some(ended)),
                    Heard::Text(Text::Closing { message }) => self.closing = Some(message),
                    Heard::Text(_) | Heard::Data(_) => {}
                }
            }
            let left = deadline.map(|at| at.saturating_duration_since(Instant::now()));
            match self.socket.read(&mut bytes, left) {
                Ok(0) => return Ok(None),
                Ok(size) => self.codec.push(&bytes[..size]),
                Err(PortError::Closed { .. }) => return Err(self.gone()),
                Err(error) => return Err(error),
            }
        }
    }

    fn gone(&self) -> PortError {
        self.port.missing(self.port.at.ended(self.closing.as_deref()))
    }
}

impl Link for Connection {
    fn holder(&self) -> Option<Holder> {
        Some(self.holder)
    }

    fn expire_next(&self, time_to_live: Duration) {
        self.expires.set(time_to_live.min(TIME_TO_LIVE));
    }

    fn claim(&self, motors: &[u8]) {
        self.claims.set(motors.to_vec());
    }

    fn only_own(&self, is_set: bool) {
        self.is_own.set(is_set);
    }

    fn end_with(&self, ending: port::Ending) {
        self.ending.set(match ending {
            port::Ending::Stop => Ending::Stop,
            port::Ending::Off => Ending::Off,
            port::Ending::Nothing => Ending::Nothing,
        });
    }
}

/// The name of this program in the log of the share.
fn own_name() -> String {
    let program = std::env::current_exe().ok();
    let name = program.as_ref().and_then(|path| path.file_stem()?.to_str()).unwrap_or("program");
    let id = format!(" {}", std::process::id());
    let mut own = String::new();
    for character in name.chars().filter(|it| motorlink_link::is_printable(*it)) {
        if own.len() + character.len_utf8() + id.len() > LONGEST_NAME {
            break;
        }
        own.push(character);
    }
    own + &id
}
