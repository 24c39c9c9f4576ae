//! Registers of ST drives, settings and measured values of RMD motors: what they are, and reading them.

use motorlink::settings::{Ask, Block, RmdBlock, RmdTuning, Setting, StTuning, Tuning, Writing};
use motorlink_proto::rmd::{Code, CommandInfo, Field, Meaning, MotorId};
use motorlink_proto::st::register::{Shape, Writing as Access};
use motorlink_proto::st::{
    self, Features, MotorNumber, Profile, Reading, RegisterId, Request as StRequest, find_register,
};
use motorlink_proto::units::Scale;
use serde::{Deserialize, Serialize};

use super::client::Refusal;
use super::drive_protocol::DriveProtocol;
use super::drive_settings::Tuned;
use super::message::Reason;
use super::motor_exchange::{ATTEMPTS, Exchanges, Target, is_refused_by_motor, is_worth_repeating};
use crate::line::Request;
use crate::signal::{Motor, Quantity, Source};

/// The heading of values that RMD motors measure.
const MEASURED: &str = "Measured values";

/// A register, or a setting of an RMD motor.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct Register {
    /// Its name.
    pub name: String,
    /// What it belongs to, for headings.
    pub group: String,
    /// Its meaning.
    pub doc: String,
    /// The symbol of the unit; empty without one.
    pub unit: String,
    /// Whether it can be read.
    pub readable: bool,
    /// Whether it can be written.
    pub writable: bool,
    /// Whether a write wears the ROM of the motor.
    pub wears_rom: bool,
    /// Whether a write with `to_rom` makes the value permanent, and wears the ROM. Without it the value holds
    /// until the motor loses its supply.
    pub can_keep: bool,
    /// The least and the most value, and the step between values.
    pub range: Option<[f64; 3]>,
}

/// A value that was read.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct Value {
    /// The register or the field.
    pub name: String,
    /// In its unit; `null`: there is none, or the drive gives one that is not possible, and `text` says why.
    pub value: Option<f64>,
    /// As text: a state, faults, a version, or the value with its decimals. Without a value: why.
    pub text: String,
    /// The symbol of the unit; empty without one.
    pub unit: String,
}

impl Value {
    /// A value of a register of an ST drive.
    pub fn of_register(reading: Reading) -> Self {
        let name = reading.register.to_string();
        let unit = Source::Register(reading.register).unit().to_owned();
        match reading.plausible() {
            Err(why) => Value { name, value: None, text: why.to_string(), unit },
            Ok(reading) => {
                let value = reading.value();
                let text = reading.name().unwrap_or_else(|| match reading.decimals() {
                    Some(decimals) => format!("{value:.*}", usize::from(decimals)),
                    None => (value as f32).to_string(),
                });
                Value { name, value: Some(value), text, unit }
            }
        }
    }

    /// A value of a reply of an RMD motor.
    pub fn of_field(name: String, field: &Field, data: &[u8; 8]) -> Self {
        let (scale, value) = (&field.scale, field.value(data));
        let text = match field.meaning {
            Meaning::Number => {
                format!("{:.*}", usize::from(scale.decimals), scale.value(field.raw(data)))
            }
            Meaning::Words(_) | Meaning::Bits(_) => field.shown(data).to_string(),
        };
        Value { name, value: Some(value), text, unit: scale.symbol.to_owned() }
    }

    fn of_setting(setting: &Setting, digits: i64) -> Self {
        let (name, text) = (setting.name.clone(), setting.number(digits));
        let unit = setting.scale.symbol.to_owned();
        Value { name, value: Some(setting.scale.value(digits)), text, unit }
    }

    /// A text without a number.
    pub fn text(name: &str, text: impl Into<String>) -> Self {
        Value { name: name.to_owned(), value: None, text: text.into(), unit: String::new() }
    }
}

/// The least and the most value of a request, and the step between values.
pub fn range(scale: &Scale) -> [f64; 3] {
    [scale.value(scale.least), scale.value(scale.most), scale.digit]
}

/// What a name means.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PlaceKind {
    /// A register of an ST drive.
    Register(RegisterId),
    /// A setting of an RMD motor, or a value of a phase of the rev-up of an ST motor.
    Setting,
    /// A value in the reply to a read of an RMD motor.
    Measured,
}

/// Gives the value in a reply.
type Decode = Box<dyn Fn(&[u8]) -> Option<Value> + Send + Sync>;

/// What has a name and a value.
pub struct Place {
    /// What it is.
    pub kind: PlaceKind,
    /// The request that reads it, or why it cannot be read.
    request: Result<Request, String>,
    value: Decode,
}

impl Place {
    /// The place with this name.
    ///
    /// # Errors
    /// There is none.
    pub fn named(target: &Target, name: &str) -> Result<Self, Refusal> {
        let (place, why) = match (target.motor, target.speaks) {
            (Motor::St(motor), DriveProtocol::St(profile)) => match find_register(name) {
                Ok(register) => (Some(Place::of_register(motor, register, profile)), String::new()),
                Err(why) => {
                    let tuning = StTuning { motor, profile };
                    (Place::of_setting(tuning, phases(tuning), name), why.to_string())
                }
            },
            (Motor::Rmd(motor), _) => {
                let tuning = RmdTuning { motor };
                let setting = Place::of_setting(tuning, tuning.blocks(), name);
                let place = setting.or_else(|| Place::of_quantity(motor, name));
                (place, format!("the motor has no setting or value `{name}`"))
            }
            _ => (None, format!("there is no register `{name}`")),
        };
        place.ok_or_else(|| Refusal::unsent(why))
    }

    fn of_register(motor: MotorNumber, register: RegisterId, profile: Profile) -> Self {
        let is_readable = register.shape().is_none_or(|shape| is_readable(&shape, profile));
        let request = match is_readable {
            true => Ok(Request::st(motor.number(), StRequest::GetRegister(register))),
            false => Err(format!("{register} cannot be read")),
        };
        let value = move |reply: &[u8]| {
            let bits = register.decode(profile, reply)?;
            Some(Value::of_register(Reading { register, bits, profile }))
        };
        Place { kind: PlaceKind::Register(register), request, value: Box::new(value) }
    }

    fn of_setting<T: Tuned>(
        tuning: T,
        blocks: impl IntoIterator<Item = Block<T::Id>>,
        name: &str,
    ) -> Option<Self> {
        let (block, at) = blocks.into_iter().find_map(|block| {
            let at = block.settings.iter().position(|setting| setting.name == name)?;
            Some((block, at))
        })?;
        let request = Ok(tuning.line_request(&Ask::Read(block.id)));
        let value = move |reply: &[u8]| {
            let digits = tuning.answer(&Ask::Read(block.id), reply)?.digits;
            Some(Value::of_setting(block.settings.get(at)?, *digits.get(at)?))
        };
        Some(Place { kind: PlaceKind::Setting, request, value: Box::new(value) })
    }

    fn of_quantity(motor: MotorId, name: &str) -> Option<Self> {
        let (code, field) = Quantity::named(name).ok()?.read();
        let request = Ok(Request::Rmd(motor, [u8::from(code), 0, 0, 0, 0, 0, 0, 0]));
        let name = name.to_owned();
        let value =
            move |reply: &[u8]| Some(Value::of_field(name.clone(), field, reply.try_into().ok()?));
        Some(Place { kind: PlaceKind::Measured, request, value: Box::new(value) })
    }
}

/// The phases of the rev-up of an ST motor: settings that are no registers.
fn phases(tuning: StTuning) -> impl Iterator<Item = Block<st::Setting>> {
    let blocks = tuning.blocks().into_iter();
    blocks.filter(|block| matches!(block.id, st::Setting::RevupPhase(_)))
}

/// Reads values, as [`read_each`]. Those that the drive refuses have the reason as their text.
///
/// # Errors
/// A name is unknown: nothing is sent. The line fails. The values are never confirmed.
pub async fn read(exchanges: &Exchanges<'_>, names: &[String]) -> Result<Vec<Value>, Refusal> {
    let values = match read_each(exchanges, names).await {
        // The drive has no such motor.
        Err(why) if why.reason == Reason::Refused => vec![Err(why); names.len()],
        values => values?,
    };
    let or_why = |(name, value): (&String, Result<_, Refusal>)| {
        value.unwrap_or_else(|why| Value::text(name, why.message))
    };
    Ok(names.iter().zip(values).map(or_why).collect())
}

/// Reads values, in the order of their names. One that the drive refuses does not hide the others.
///
/// # Errors
/// A name is unknown: nothing is sent. The line fails. The drive has no such motor. The values are never
/// confirmed.
pub async fn read_each(
    exchanges: &Exchanges<'_>,
    names: &[String],
) -> Result<Vec<Result<Value, Refusal>>, Refusal> {
    let places = names.iter().map(|name| Place::named(exchanges.target, name));
    let places = places.collect::<Result<Vec<_>, Refusal>>()?;
    let _lane = exchanges.lane().await;
    let mut attempt = 1;
    loop {
        match read_once(exchanges, &places).await {
            Err(why) if is_worth_repeating(&why) && attempt < ATTEMPTS => attempt += 1,
            values => return values,
        }
    }
}

async fn read_once(
    exchanges: &Exchanges<'_>,
    places: &[Place],
) -> Result<Vec<Result<Value, Refusal>>, Refusal> {
    let mut replies: Vec<(&Request, Result<Vec<u8>, Refusal>)> = Vec::new();
    let mut values = Vec::new();
    for place in places {
        let request = match &place.request {
            Ok(request) => request,
            Err(why) => {
                values.push(Err(Refusal::usage(why)));
                continue;
            }
        };
        let known = replies.iter().position(|(known, _)| *known == request);
        let at = match known {
            Some(at) => at,
            None => {
                let reply = exchanges.request(request).await;
                replies.push((request, reply));
                replies.len() - 1
            }
        };
        values.push(match &replies[at].1 {
            Ok(reply) => Ok((place.value)(reply).ok_or_else(|| exchanges.unfit())?),
            Err(why) if is_refused_by_motor(why) => Err(why.clone()),
            Err(why) => return Err(why.clone()),
        });
    }
    if !replies.is_empty() {
        exchanges.confirm().await?;
    }
    Ok(values)
}

fn is_readable(shape: &Shape, profile: Profile) -> bool {
    shape.read_size(profile, Features::NONE.with(shape.feature)).is_some()
}

/// Whether a register can be written.
pub fn is_writable(shape: &Shape, profile: Profile) -> bool {
    matches!(shape.writing(profile, Features::NONE.with(shape.feature)), Access::Takes(_))
}

/// The registers of the motors of a line.
pub fn all(speaks: DriveProtocol) -> Vec<Register> {
    match speaks.motor(1) {
        Some(Motor::St(motor)) => {
            let profile = speaks.profile().unwrap_or_default();
            let registers = RegisterId::all().filter_map(|register| of_st(register, profile));
            let phases = phases(StTuning { motor, profile });
            registers.chain(phases.flat_map(|block| of_block(&block, |_| ""))).collect()
        }
        Some(Motor::Rmd(motor)) => {
            let tuning = RmdTuning { motor };
            let settings = tuning.blocks().into_iter().flat_map(|block| {
                let fields = written(&tuning, &block).map_or(&[][..], |row| row.request);
                of_block(&block, |at| fields.get(at).map_or("", |field| field.doc))
            });
            settings.chain(Quantity::all().map(of_quantity)).collect()
        }
        None => Vec::new(),
    }
}

/// The command that writes a block.
fn written(tuning: &RmdTuning, block: &Block<RmdBlock>) -> Option<&'static CommandInfo> {
    let [code, ..] = tuning.request(&Ask::Write(block.id, vec![0; block.settings.len()]));
    Code::from(code).info()
}

fn of_st(register: RegisterId, profile: Profile) -> Option<Register> {
    let (shape, text) = (register.shape()?, register.text()?);
    let (readable, writable) = (is_readable(&shape, profile), is_writable(&shape, profile));
    let scale = register.scale(profile).map(|scale| match shape.unit.most(profile) {
        Some(most) => Scale { most: most.into(), ..scale },
        None => scale,
    });
    (readable || writable).then(|| Register {
        name: text.name.to_owned(),
        group: shape.feature.name().to_owned(),
        doc: text.doc.to_owned(),
        unit: shape.unit.quantity().to_owned(),
        readable,
        writable,
        wears_rom: false,
        can_keep: false,
        range: scale.map(|scale| range(&scale)),
    })
}

fn of_block<Id>(block: &Block<Id>, doc: impl Fn(usize) -> &'static str) -> Vec<Register> {
    let settings = block.settings.iter().enumerate();
    let register = settings.map(|(at, setting)| Register {
        name: setting.name.clone(),
        group: block.heading.to_owned(),
        doc: doc(at).to_owned(),
        unit: setting.scale.symbol.to_owned(),
        readable: true,
        writable: block.writing != Writing::Fixed,
        wears_rom: block.writing == Writing::Permanent,
        can_keep: block.writing == Writing::Kept,
        range: Some(range(&setting.scale)),
    });
    register.collect()
}

fn of_quantity(quantity: Quantity) -> Register {
    let (_, field) = quantity.read();
    Register {
        name: quantity.name(),
        group: MEASURED.to_owned(),
        doc: field.doc.to_owned(),
        unit: field.scale.symbol.to_owned(),
        readable: true,
        writable: false,
        wears_rom: false,
        can_keep: false,
        range: None,
    }
}
