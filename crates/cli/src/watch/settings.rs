//! Registers of ST drives and gains of RMD motors: reads, and writes with a read-back. All requests
//! go through the engine.

use std::borrow::Cow;
use std::convert::Infallible;
use std::sync::Arc;

use motorlink::rmd::{
    Acceleration, Command, DpsPerSecond, Field, Payload, Pid, ReadAcceleration, ReadPid,
    WriteAccelerationRam, WritePidRam,
};
use motorlink::st::{
    Error, Feature, Features, RegisterId, Request as StRequest, Unverified, VERIFY_ATTEMPTS,
    VerifiedWrite,
};
use motorlink::time::Micros;
use motorlink_telemetry::event::CommandError;
use motorlink_telemetry::line::{LineError, Reply, Request};
use motorlink_telemetry::runner::Remote;
use motorlink_telemetry::signal::Motor;

use super::values::Units;
use crate::failure::Failure;
use crate::rmd::{GainChange, gain_alone, range};
use crate::st::reason_of_read;

/// A command that is not sent in this time is refused.
pub const TIME_TO_LIVE: Micros = Micros(2_000_000);

/// A value that can be read. Some can be written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Item {
    Register(RegisterId),
    /// A gain, by its place in the frame.
    Gain(usize),
    Acceleration,
}

impl Item {
    /// All items of a motor.
    pub fn of(motor: Motor, units: &Units) -> Vec<Item> {
        let profile = units.st.profile;
        match motor {
            Motor::St(_) => RegisterId::all()
                .filter(|register| {
                    register.shape().is_some_and(|shape| {
                        shape.read_size(profile, Features::NONE.with(shape.feature)).is_some()
                    })
                })
                .map(Item::Register)
                .collect(),
            Motor::Rmd(_) => {
                (0..Pid::FIELDS.len()).map(Item::Gain).chain([Item::Acceleration]).collect()
            }
        }
    }

    pub fn name(&self) -> String {
        match self {
            Item::Register(register) => register.to_string(),
            Item::Gain(place) => Pid::FIELDS[*place].name.to_owned(),
            Item::Acceleration => Acceleration::FIELDS[0].name.to_owned(),
        }
    }

    /// Its description.
    pub fn meaning(&self) -> Cow<'static, str> {
        match self {
            Item::Register(register) => register.text().map_or("", |text| text.doc).into(),
            Item::Gain(place) => {
                let field = &Pid::FIELDS[*place];
                format!("{}, {}", field.doc.trim_end_matches('.'), range(field)).into()
            }
            Item::Acceleration => acceleration().doc.into(),
        }
    }

    /// Why it cannot be edited; `None`: it can.
    pub fn unwritable(&self, units: &Units) -> Option<String> {
        let Item::Register(register) = self else { return None };
        let profile = units.st.profile;
        match VerifiedWrite::new::<Infallible>(profile, *register, 0) {
            Ok(_) if register.is_setting(profile) || is_of_a_measurement(*register) => None,
            Ok(_) | Err(Unverified::Acts) => {
                Some(format!("{register} makes the drive act: use `motorlink st set`"))
            }
            Err(_) => Some(format!("{register} can only be read")),
        }
    }
}

/// Whether a register is an input of the motor profiler or of the DAC.
fn is_of_a_measurement(register: RegisterId) -> bool {
    let feature = register.shape().map(|shape| shape.feature);
    matches!(feature, Some(Feature::Dac | Feature::Profiler))
}

/// Access of a thread to one motor.
#[derive(Clone)]
pub struct Access {
    pub remote: Remote,
    pub by: Arc<str>,
    pub motor: Motor,
    pub units: Units,
}

impl Access {
    /// The value with its unit, or a short reason why there is none.
    pub fn read(&self, item: Item) -> Result<String, String> {
        match item {
            Item::Register(register) => {
                let reading = self.units.st.reading(register, self.register_bits(register)?);
                let reading = reading.plausible().map_err(|why| why.to_string())?;
                Ok(self.units.st.text(&reading))
            }
            Item::Gain(place) => {
                let gains = self.ask(&ReadPid)?;
                let field = &Pid::FIELDS[place];
                Ok(self.units.rmd.field(field, field.raw(&gains)).text)
            }
            Item::Acceleration => {
                let reply = self.ask(&ReadAcceleration)?;
                let field = acceleration();
                Ok(self.units.rmd.field(field, field.raw(&reply)).text)
            }
        }
    }

    /// Writes a value and reads it back. Returns a text with the old and the new value.
    pub fn write(&self, item: Item, text: &str) -> Result<String, String> {
        if let Some(why) = item.unwritable(&self.units) {
            return Err(format!("{why}; nothing was sent"));
        }
        let (name, before) = (item.name(), self.read(item));
        let before = before.map_err(|why| format!("{name} was not written: {why}"))?;
        match item {
            Item::Register(register) => self.write_register(register, text)?,
            Item::Gain(place) => self.write_gain(place, text)?,
            Item::Acceleration => self.write_acceleration(text)?,
        }
        let unread = |why| format!("{name} was written, and could not be read back: {why}");
        let after = self.read(item).map_err(unread)?;
        self.confirm().map_err(unread)?;
        Ok(format!("{name} was {before}, is {after} (read back)"))
    }

    fn write_register(&self, register: RegisterId, text: &str) -> Result<(), String> {
        let bits = self.units.st.bits(register, text).map_err(|failure| failure.text())?;
        let write = VerifiedWrite::new::<Infallible>(self.units.st.profile, register, bits)
            .map_err(|_| format!("{register} cannot be written and read back"))?;
        let exchange = |request: &StRequest<'_>| match request {
            StRequest::GetRegister(register) => self.register_bits(*register).map(Some),
            request => self.st(*request).map(|_| None),
        };
        // Any error ends the write: the user sees it and can try again.
        match write.run(VERIFY_ATTEMPTS, exchange, |_| true) {
            Ok(_) => Ok(()),
            Err(Unverified::Differs { expected, read }) => {
                let shown = |bits| self.units.st.text(&self.units.st.reading(register, bits));
                Err(format!("{register} reads {} instead of {}", shown(read), shown(expected)))
            }
            Err(Unverified::Exchange(why)) => Err(format!("{register}: {why}")),
            Err(Unverified::NotReadable | Unverified::Acts) => {
                Err(format!("{register} cannot be written and read back"))
            }
        }
    }

    fn write_gain(&self, place: usize, text: &str) -> Result<(), String> {
        let gain = gain_alone(text).map_err(|failure| {
            format!("{}; type the number alone; nothing was sent", failure.text())
        })?;
        let wanted = GainChange::Some(vec![(place, gain)]).on(Pid::decode(&self.ask(&ReadPid)?));
        self.ask(&WritePidRam(wanted))?;
        match Pid::decode(&self.ask(&ReadPid)?) {
            read if read == wanted => Ok(()),
            _ => Err("the motor has other gains than were written".to_owned()),
        }
    }

    fn write_acceleration(&self, text: &str) -> Result<(), String> {
        let not_a_number = |_| format!("`{text}` is not a number; nothing was sent");
        let number: f64 = text.parse().map_err(not_a_number)?;
        let limit: Result<DpsPerSecond, Failure> = self.units.rmd.wanted(number);
        let wanted = Acceleration { acceleration: limit.map_err(|failure| failure.text())? };
        self.ask(&WriteAccelerationRam(wanted))?;
        match Acceleration::decode(&self.ask(&ReadAcceleration)?) {
            read if read == wanted => Ok(()),
            read => Err(format!(
                "the motor has the limit {} instead of {}",
                self.units.rmd.shown(read.acceleration),
                self.units.rmd.shown(wanted.acceleration)
            )),
        }
    }

    fn register_bits(&self, register: RegisterId) -> Result<i32, String> {
        let profile = self.units.st.profile;
        let request = StRequest::GetRegister(register);
        let payload = self.st_with(request, |error| reason_of_read(error, register, profile))?;
        let bits = register.decode(profile, &payload);
        bits.ok_or_else(|| "the reply has another size: is --profile right?".to_owned())
    }

    fn st(&self, request: StRequest<'_>) -> Result<Vec<u8>, String> {
        self.st_with(request, |_| None)
    }

    /// One exchange. `reason` may know why it was refused.
    fn st_with(
        &self,
        request: StRequest<'_>,
        reason: impl Fn(&Error) -> Option<String>,
    ) -> Result<Vec<u8>, String> {
        let Motor::St(motor) = self.motor else { return Err(LineError::Protocol.to_string()) };
        match self.send(Request::st(motor.number(), request), reason)? {
            Reply::St(payload) => Ok(payload),
            Reply::Rmd(_) | Reply::Confirmed => Err(LineError::Protocol.to_string()),
        }
    }

    fn ask(&self, command: &impl Command) -> Result<[u8; 8], String> {
        let Motor::Rmd(id) = self.motor else { return Err(LineError::Protocol.to_string()) };
        match self.send(Request::rmd(id, command), |_| None)? {
            Reply::Rmd(data) => Ok(data),
            Reply::St(_) | Reply::Confirmed => Err(LineError::Protocol.to_string()),
        }
    }

    /// Confirms that the replies belong to their requests.
    fn confirm(&self) -> Result<(), String> {
        self.send(Request::Confirm(self.motor), |_| None).map(drop)
    }

    fn send(
        &self,
        request: Request,
        reason: impl Fn(&Error) -> Option<String>,
    ) -> Result<Reply, String> {
        self.remote.command(&self.by, request, TIME_TO_LIVE).map_err(|error| match error {
            // The screen shows the motor and the register already.
            CommandError::Line(LineError::St(ref refusal @ Error::Refused { code, .. })) => {
                let why = reason(refusal).unwrap_or_else(|| code.doc().to_owned());
                format!("refused: {code}: {why}")
            }
            error => error.to_string(),
        })
    }
}

fn acceleration() -> &'static Field {
    &Acceleration::FIELDS[0]
}
