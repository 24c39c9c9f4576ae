//! A drive that answers according to a script.

use std::marker;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use motorlink_link::serve::Station;
use motorlink_proto::Hex;
use motorlink_proto::st::{
    Command, CurrentReference, ErrorCode, Features, Frame, MotorNumber, Parse, Profile, Ramp,
    RegisterId, Request, RevupPhase, Slave, Status, Version,
};
use motorlink_proto::time::{Instant, Micros};

use crate::host::journal::Journal;
use crate::host::outbox::Outbox;
use crate::host::script::{Send, share};

/// A scenario for an ST host.
pub type Scenario = crate::host::Scenario<Script>;

pub(super) type Sends = Vec<Send<Vec<u8>>>;

/// What the drive sends after a request.
#[derive(Clone)]
pub struct Script(Arc<dyn Fn(&Turn) -> Sends + marker::Send + Sync>);

impl Script {
    pub(super) fn new(script: impl Fn(&Turn) -> Sends + marker::Send + Sync + 'static) -> Self {
        Script(Arc::new(script))
    }
}

/// A request, and the document's reply to it.
pub(super) struct Turn {
    /// The index of the speed request or of the START_MOTOR, starting at 0.
    pub asked: Option<usize>,
    pub request: Vec<u8>,
    pub reply: Vec<u8>,
    /// The speed in the reply.
    pub value: Option<i64>,
    /// Timeout of the host.
    pub timeout: Micros,
}

/// A drive with one motor and a script. Clones share the same drive.
#[derive(Clone)]
pub struct ScriptedDrive(Arc<Mutex<Inner>>);

struct Inner {
    slave: Slave,
    engine: Engine,
    incoming: Vec<u8>,
    script: Script,
    outbox: Outbox<Vec<u8>>,
    timeout: Micros,
}

impl Scenario {
    /// The drive of this scenario, for a host with this timeout.
    pub fn drive(&self, timeout: Micros) -> ScriptedDrive {
        ScriptedDrive(Arc::new(Mutex::new(Inner {
            slave: Slave::new(Profile::Spec, MotorNumber::FIRST),
            engine: Engine::default(),
            incoming: Vec::new(),
            script: self.script.clone(),
            outbox: Outbox::new(),
            timeout,
        })))
    }
}

impl ScriptedDrive {
    fn inner(&self) -> MutexGuard<'_, Inner> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The record so far.
    pub fn journal(&self) -> Journal {
        self.inner().outbox.journal.clone()
    }
}

impl Station<u8> for ScriptedDrive {
    fn receive(&mut self, now: Instant, bytes: &[u8], reply: &mut Vec<u8>) {
        let mut inner = self.inner();
        for &byte in bytes {
            inner.byte(now, byte);
        }
        inner.flush(now, reply);
    }

    fn poll(&mut self, now: Instant, reply: &mut Vec<u8>) {
        let mut inner = self.inner();
        if let Some(nack) = inner.slave.poll(now).map(<[u8]>::to_vec) {
            inner.answer(now, nack);
        }
        inner.flush(now, reply);
    }

    fn deadline(&self) -> Option<Instant> {
        let inner = self.inner();
        inner.slave.deadline().into_iter().chain(inner.outbox.deadline()).min()
    }
}

impl Inner {
    fn byte(&mut self, now: Instant, byte: u8) {
        self.incoming.push(byte);
        let reply = self.slave.receive(now, byte, &mut self.engine).map(<[u8]>::to_vec);
        if let Some(reply) = reply {
            self.answer(now, reply);
        }
    }

    fn answer(&mut self, now: Instant, reply: Vec<u8>) {
        let request = std::mem::take(&mut self.incoming);
        let patience = share(self.timeout, 1, 2);
        let shown = Hex(&request).to_string();
        self.outbox.journal.heard(now, &shown);
        let motor = MotorNumber::FIRST.number();
        let exchange = self.outbox.journal.record(now, motor, 0, &shown, patience);
        let decoded = match Frame::parse(&request) {
            Parse::Frame(frame, _) => frame.request(Profile::Spec).ok(),
            Parse::More | Parse::Bad(_) => None,
        };
        let (asked, value) = match decoded {
            Some(Request::GetRegister(RegisterId::SPEED_MEAS)) => {
                (self.engine.readings.checked_sub(1), Some(self.engine.speed()))
            }
            Some(Request::ExecuteCommand(Command::StartMotor)) => {
                (self.engine.starts.checked_sub(1), None)
            }
            _ => (None, None),
        };
        self.outbox.journal.starts = self.engine.starts;
        self.outbox.stir(now);
        let timeout = self.timeout;
        let sends =
            (self.script.0)(&Turn { asked, request, reply, value: value.map(i64::from), timeout });
        self.outbox.schedule(now, exchange, sends);
    }

    fn flush(&mut self, now: Instant, out: &mut Vec<u8>) {
        self.outbox.flush(now, |bytes| Hex(bytes).to_string(), |bytes| out.extend(bytes));
    }
}

/// The state of the drive: its numbers of readings and starts.
#[derive(Default)]
struct Engine {
    readings: usize,
    starts: usize,
}

impl Engine {
    /// The speed at the last reading, rpm. Each value is unique, and none looks like an error code,
    /// a length or a part of another value.
    fn speed(&self) -> i32 {
        1_000 + 137 * self.readings as i32
    }
}

impl motorlink_proto::st::MotorControl for Engine {
    fn features(&self, _: MotorNumber) -> Features {
        Features::NONE
    }

    fn version(&self) -> Version<'_> {
        Version { name: "Adversary", major: 1, minor: 0, patch: 0, pre_release: "" }
    }

    fn get_register(&mut self, _: MotorNumber, register: RegisterId) -> i32 {
        match register {
            RegisterId::SPEED_MEAS => {
                self.readings += 1;
                self.speed()
            }
            RegisterId::STATUS if self.starts > 0 => u8::from(Status::Run).into(),
            RegisterId::STATUS => u8::from(Status::Idle).into(),
            _ => 0,
        }
    }

    fn set_register(&mut self, _: MotorNumber, _: RegisterId, _: i32) -> Result<(), ErrorCode> {
        Ok(())
    }

    fn execute(&mut self, _: MotorNumber, command: Command) {
        if command == Command::StartMotor {
            self.starts += 1;
        }
    }

    fn set_ramp(&mut self, _: MotorNumber, _: Ramp) {}

    fn get_revup_data(&mut self, _: MotorNumber, _: u8) -> RevupPhase {
        RevupPhase::default()
    }

    fn set_revup_data(&mut self, _: MotorNumber, _: u8, _: RevupPhase) {}

    fn set_current_reference(&mut self, _: MotorNumber, _: CurrentReference) {}
}
