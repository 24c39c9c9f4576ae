//! Motors that answer according to a script.

use std::collections::BTreeMap;
use std::marker;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use motorlink_link::serve::Station;
use motorlink_proto::Hex;
use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::{
    Code, MotionStatus, MotorId, MotorSet, MultiTurnAngle, Payload, SingleTurnAngle, Status,
    TORQUE4_ID,
};
use motorlink_proto::time::{Instant, Micros};
use motorlink_proto::units::{
    Celsius, DeciVolts, Dps, IqFeedback, TurnCentiDegrees, WideCentiDegrees,
};

use crate::host::journal::{Exchange, Journal};
use crate::host::outbox::Outbox;
use crate::host::script::Send;

/// A scenario for an RMD host.
pub type Scenario = crate::host::Scenario<Script>;

pub(super) type Sends = Vec<Send<CanFrame>>;

/// What the motors send after a request.
#[derive(Clone)]
pub struct Script(Arc<dyn Fn(&Turn) -> Sends + marker::Send + Sync>);

impl Script {
    pub(super) fn new(script: impl Fn(&Turn) -> Sends + marker::Send + Sync + 'static) -> Self {
        Script(Arc::new(script))
    }
}

/// A request to one motor, and the document's reply to it. 0x280 counts as one request to each of
/// four motors.
pub(super) struct Turn {
    pub id: MotorId,
    pub code: Code,
    /// Number of earlier requests of this kind to this motor.
    pub asked: usize,
    pub request: CanFrame,
    pub reply: [u8; 8],
    /// The value in the reply, in digits.
    pub value: Option<i64>,
    /// Timeout of the host.
    pub timeout: Micros,
}

/// Four motors with IDs 1 to 4, and a script. Clones share the same motors.
#[derive(Clone)]
pub struct ScriptedMotors(Arc<Mutex<Inner>>);

struct Inner {
    script: Script,
    outbox: Outbox<CanFrame>,
    asked: BTreeMap<(MotorId, u8), usize>,
    readings: u16,
    timeout: Micros,
}

/// Two requests to one motor within this time are sent without waiting for a reply: no motor
/// answers faster, and no host has a shorter timeout.
const AT_ONCE: Micros = Micros(100);

impl Scenario {
    /// The motors of this scenario, for a host with this timeout.
    pub fn motors(&self, timeout: Micros) -> ScriptedMotors {
        let (asked, readings) = Default::default();
        let script = self.script.clone();
        ScriptedMotors(Arc::new(Mutex::new(Inner {
            script,
            outbox: Outbox::new(),
            asked,
            readings,
            timeout,
        })))
    }
}

impl ScriptedMotors {
    fn inner(&self) -> MutexGuard<'_, Inner> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The record so far.
    pub fn journal(&self) -> Journal {
        self.inner().outbox.journal.clone()
    }
}

impl Station<CanFrame> for ScriptedMotors {
    fn receive(&mut self, now: Instant, received: &[CanFrame], replies: &mut Vec<CanFrame>) {
        let mut inner = self.inner();
        for frame in received {
            inner.outbox.journal.heard(now, &show(frame));
            if let Some((can_id, data)) = frame.eight_bytes() {
                if let Some(id) = MotorId::from_can_id(can_id.into()) {
                    inner.request(now, id, frame, Code::from(data[0]));
                } else if can_id == TORQUE4_ID {
                    for id in MotorSet::TORQUE4 {
                        inner.request(now, id, frame, Code::SetTorque);
                    }
                }
            }
        }
        inner.flush(now, replies);
    }

    fn poll(&mut self, now: Instant, replies: &mut Vec<CanFrame>) {
        self.inner().flush(now, replies);
    }

    fn deadline(&self) -> Option<Instant> {
        self.inner().outbox.deadline()
    }
}

impl Inner {
    fn request(&mut self, now: Instant, id: MotorId, frame: &CanFrame, code: Code) {
        if !MotorSet::TORQUE4.contains(id) {
            return;
        }
        let exchange = self.record(now, id, frame, code);
        self.outbox.stir(now);
        let count = self.asked.entry((id, code.into())).or_default();
        let asked = *count;
        *count += 1;
        let (reply, value) = self.reply(code, frame);
        let (request, timeout) = (*frame, self.timeout);
        let sends = (self.script.0)(&Turn { id, code, asked, request, reply, value, timeout });
        self.outbox.schedule(now, exchange, sends);
    }

    fn record(&mut self, now: Instant, id: MotorId, frame: &CanFrame, code: Code) -> Exchange {
        self.outbox.journal.record(now, id.number(), code.into(), &show(frame), AT_ONCE)
    }

    /// The document's reply, with a unique value each time.
    fn reply(&mut self, code: Code, request: &CanFrame) -> ([u8; 8], Option<i64>) {
        let Some(row) = code.info() else { return ([0; 8], None) };
        if let Some((_, echoed)) = request.eight_bytes()
            && row.echo
        {
            return (*echoed, None);
        }
        self.readings += 1;
        let digits = 200 + 13 * self.readings;
        let temperature = Celsius(30);
        let reply = match code {
            Code::ReadMultiTurnAngle => {
                MultiTurnAngle { angle: WideCentiDegrees(digits.into()) }.encode_as(code)
            }
            Code::ReadSingleTurnAngle => {
                SingleTurnAngle { angle: TurnCentiDegrees(digits) }.encode_as(code)
            }
            Code::ReadStatus | Code::ClearErrors => {
                let (voltage, errors) = (DeciVolts(digits), Default::default());
                Status { temperature, voltage, errors }.encode_as(Code::ReadStatus)
            }
            _ if row.motion.is_owned() || code == Code::ReadMotionStatus => {
                let (iq, speed) = (IqFeedback(digits as i16), Dps(0));
                MotionStatus { temperature, iq, speed, encoder: 0 }.encode_as(code)
            }
            _ => return ([code.into(), 0, 0, 0, 0, 0, 0, 0], None),
        };
        (reply, Some(digits.into()))
    }

    fn flush(&mut self, now: Instant, replies: &mut Vec<CanFrame>) {
        self.outbox.flush(now, show, |frame| replies.push(frame));
    }
}

fn show(frame: &CanFrame) -> String {
    let kind = match (frame.is_extended(), frame.is_remote()) {
        (true, true) => " extended remote",
        (true, false) => " extended",
        (false, true) => " remote",
        (false, false) => "",
    };
    format!("{:03x}#{}{kind}", frame.id(), Hex(frame.data()))
}
