//! The connection of a port to its share.

use std::collections::BTreeSet;
use std::os::fd::BorrowedFd;
use std::time::{Duration, Instant};

use motorlink::port::{self, Declined, FdLink, HeldLine, Holder, NotDone, PortError, RequestEnd};
use motorlink::st::Profile;

use super::line_address::{Deadlines, LineAddress};
use super::pulse::Socket;
use crate::share::VERSION;
use crate::share::client_codec::{ClientCodec, CodecError, Ended, Heard, Refusal};
use crate::share::command_kind::CommandKind;
use crate::share::drive_protocol::DriveProtocol;
use crate::share::message::{
    Answer, Ask, Ending, LONGEST_NAME, Line, MotorName, Protocol, Reason, Text,
};

/// How long a share may take for the answer to hello.
const OPENING: Duration = Duration::from_secs(5);

/// A request is not sent later than this after the program has made it.
const TIME_TO_LIVE: Duration = Duration::from_secs(1);

/// The connection to a share.
pub(super) struct Connection {
    port: LineAddress,
    socket: Socket,
    codec: ClientCodec,
    line: HeldLine,
    /// Whether requests are for motors that no other program has moved since.
    is_own: bool,
    /// Motors that this program has moved through a connection before this one.
    claims: Vec<u8>,
    /// What the share does with the motors of this program when it leaves, and what it knows of that.
    ending: Ending,
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
            line: HeldLine { patience: OPENING, profile: None },
            is_own: false,
            claims: Vec::new(),
            ending: Ending::default(),
            declared: Ending::default(),
            taken: BTreeSet::new(),
            closing: None,
        };
        opened.opening(Ask::Hello { protocol: VERSION, name: own_name(LONGEST_NAME) })?;
        let Answer::Lines { lines, .. } = opened.opening(Ask::Lines)? else {
            return Err(opened.no_share());
        };
        opened.line = opened.held_line(&lines)?;
        Ok(opened)
    }

    /// The answer to a request before the first command.
    fn opening(&mut self, ask: Ask) -> Result<Answer, PortError> {
        let id = self.ask(ask)?;
        let ended = self.next_end(Some(OPENING))?.filter(|ended| ended.id == id);
        let ended = ended.ok_or_else(|| self.no_share())?;
        ended.result.map_err(|refusal| self.port.failed(refusal.message))
    }

    fn no_share(&self) -> PortError {
        self.port.failed("nothing answers like a share: is this the socket of a share?")
    }

    /// What the share says of the line.
    fn held_line(&self, lines: &[Line]) -> Result<HeldLine, PortError> {
        let own = |it: &&Line| it.line == self.port.line && it.protocol == self.port.protocol;
        let Some(line) = lines.iter().find(own) else {
            let names: Vec<_> = lines.iter().map(|it| it.line.as_str()).collect();
            let why = format!("the share has no such line; its lines are {}", names.join(", "));
            return Err(self.port.failed(why));
        };
        let patience = line.patience();
        let Some(name) = &line.profile else { return Ok(HeldLine { patience, profile: None }) };
        let profile = Profile::ALL.into_iter().find(|profile| profile.name() == name);
        match profile {
            Some(_) => Ok(HeldLine { patience, profile }),
            None => Err(self.port.failed(format!("the share uses the unknown profile {name}"))),
        }
    }

    /// Says what the share has to know of this program before it changes something, or has changed it through
    /// an earlier connection.
    fn declare(&mut self, changes: bool) -> Result<(), PortError> {
        let claims = std::mem::take(&mut self.claims);
        if !changes && claims.is_empty() {
            return Ok(());
        }
        if !self.has_deadlines {
            self.has_deadlines = true;
            self.declare_deadlines()?;
        }
        let motion = self.ending;
        if motion != self.declared {
            self.declared = motion;
            self.ask(Ask::Ending { motion })?;
        }
        for motor in claims {
            let motor = MotorName { line: self.port.line.clone(), motor };
            self.ask(Ask::Claim { motor })?;
        }
        Ok(())
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
            Protocol::St => DriveProtocol::St(self.line.profile.unwrap_or_default()),
            Protocol::Rmd => DriveProtocol::Rmd,
        };
        CommandKind::of_bytes(speaks, motor, bytes).changes()
    }

    /// Sends a request; gives its id.
    fn ask(&mut self, ask: Ask) -> Result<u32, PortError> {
        let request = self.codec.request(ask);
        let (id, stream) = request.map_err(|error| self.port.failed(error.to_string()))?;
        match self.socket.write(&stream) {
            Ok(()) => Ok(id),
            // What came before the end says why.
            Err(error @ PortError::Closed(..)) => match self.next_end(Some(Duration::ZERO)) {
                Err(why) => Err(why),
                Ok(_) => Err(error),
            },
            Err(error) => Err(error),
        }
    }

    /// The next end of a request. Waits at most `timeout`.
    fn next_end(&mut self, timeout: Option<Duration>) -> Result<Option<Ended>, PortError> {
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
                Err(PortError::Closed(..)) => return Err(self.gone()),
                Err(error) => return Err(error),
            }
        }
    }

    fn gone(&self) -> PortError {
        self.port.missing(self.port.at.ended(self.closing.as_deref()))
    }
}

impl Holder for Connection {
    fn line(&self) -> HeldLine {
        self.line
    }

    fn descriptor(&self) -> BorrowedFd<'_> {
        self.socket.descriptor()
    }

    fn request(
        &mut self,
        motor: u8,
        request: &[u8],
        time_to_live: Option<Duration>,
    ) -> Result<u32, PortError> {
        let changes = self.changes(motor, request);
        self.declare(changes)?;
        let line = self.port.line.clone();
        if self.port.at.takes() && changes && self.taken.insert(motor) {
            let motor = MotorName { line: line.clone(), motor };
            self.ask(Ask::Take { motor })?;
        }
        let time_to_live = time_to_live.unwrap_or(TIME_TO_LIVE).min(TIME_TO_LIVE).as_secs_f64();
        let (bytes, continues, own) = (request.to_vec(), false, self.is_own);
        self.ask(Ask::Command { line, motor, bytes, time_to_live, continues, own })
    }

    fn confirm(&mut self, motor: u8) -> Result<u32, PortError> {
        self.declare(false)?;
        self.ask(Ask::Confirm { line: self.port.line.clone(), motor })
    }

    fn receive(&mut self, timeout: Option<Duration>) -> Result<Option<RequestEnd>, PortError> {
        let Some(Ended { id, result }) = self.next_end(timeout)? else { return Ok(None) };
        let result = match result {
            Ok(Answer::Command { bytes }) => Ok(bytes),
            Ok(Answer::Confirm) => Ok(Vec::new()),
            Ok(_) => Err(Declined::unfit()),
            Err(Refusal { code: Some(code), .. }) => Err(Declined::ByDrive(code)),
            Err(Refusal { reason, message, .. }) => {
                let why = format!("`{}`: {message}", self.port.name());
                Err(Declined::ByHolder(not_done(reason), why))
            }
        };
        Ok(Some(RequestEnd { number: id, result }))
    }

    fn only_own(&mut self, is_set: bool) {
        self.is_own = is_set;
    }

    fn claim(&mut self, motors: Vec<u8>) {
        self.claims = motors;
    }

    fn end_with(&mut self, ending: port::Ending) {
        self.ending = match ending {
            port::Ending::Stop => Ending::Stop,
            port::Ending::Off => Ending::Off,
            port::Ending::Nothing => Ending::Nothing,
        };
    }
}

/// What it means to a client that a share did not carry a request out.
fn not_done(reason: Reason) -> NotDone {
    match reason {
        Reason::Usage | Reason::Version => NotDone::Usage,
        Reason::Latched => NotDone::Latched,
        Reason::Held => NotDone::Held,
        Reason::Overtaken | Reason::Refused => NotDone::Refused,
        Reason::Expired | Reason::Busy => NotDone::Unsent,
        Reason::Silent => NotDone::Silent,
        Reason::Unheard => NotDone::Unheard,
        Reason::Unconfirmed => NotDone::Unconfirmed,
        // It is unknown what the drive did.
        Reason::Displaced | Reason::Line | Reason::Forbidden | Reason::Lapsed | Reason::Later => {
            NotDone::Line
        }
    }
}

/// The name of this program in the log of a share or a node, of at most so many bytes.
pub fn own_name(most: usize) -> String {
    let program = std::env::current_exe().ok();
    let name = program.as_ref().and_then(|path| path.file_stem()?.to_str()).unwrap_or("program");
    let id = format!(" {}", std::process::id());
    let mut own = String::new();
    for character in name.chars().filter(|it| motorlink_link::is_printable(*it)) {
        if own.len() + character.len_utf8() + id.len() > most {
            break;
        }
        own.push(character);
    }
    own + &id
}
