//! Registers of ST drives, settings and measured values of RMD motors: what they are, and reading them.

use motorlink::settings::{Ask, Block, RmdBlock, RmdTuning, StTuning, Tuning, Writing};
use motorlink_proto::rmd::{Code, CommandInfo, Field};
use motorlink_proto::st::register::{Shape, Writing as Access};
use motorlink_proto::st::{
    self, Features, Profile, Reading, RegisterId, Request as StRequest, find_register,
};
use motorlink_telemetry::line::Request;
use motorlink_telemetry::share::client::Refusal;
use motorlink_telemetry::share::drive_protocol::DriveProtocol;
use motorlink_telemetry::share::message::Reason;
use motorlink_telemetry::share::motor_exchange::{
    ATTEMPTS, Exchanges, Target, is_refused_by_motor, is_worth_repeating,
};
use motorlink_telemetry::signal::{Motor, Quantity};

use super::value_format;
use crate::message::{Register, Value};

/// The heading of values that RMD motors measure.
const MEASURED: &str = "Measured values";

/// What has a name and a value.
pub(super) enum ValueSource {
    /// A register of an ST drive.
    Register(RegisterId),
    /// A phase of the rev-up, and the index of its value.
    StSetting(StTuning, Block<st::Setting>, usize),
    /// Settings of an RMD motor that one request has, and the index of one of them.
    RmdSetting(RmdTuning, Block<RmdBlock>, usize),
    /// A value in the reply to a read of an RMD motor.
    Measured(Code, &'static Field),
}

impl ValueSource {
    /// The place with this name.
    pub(super) fn named(target: &Target, name: &str) -> Result<Self, Refusal> {
        let (found, why) = match (target.motor, target.speaks) {
            (Motor::St(motor), DriveProtocol::St(profile)) => {
                let tuning = StTuning { motor, profile };
                let phase =
                    |block: &Block<st::Setting>| matches!(block.id, st::Setting::RevupPhase(_));
                match find_register(name) {
                    Ok(register) => (Some(ValueSource::Register(register)), String::new()),
                    Err(why) => {
                        let setting = setting(&tuning, name).filter(|(block, _)| phase(block));
                        let place =
                            setting.map(|(block, at)| ValueSource::StSetting(tuning, block, at));
                        (place, why.to_string())
                    }
                }
            }
            (Motor::Rmd(motor), _) => {
                let tuning = RmdTuning { motor };
                match setting(&tuning, name) {
                    Some((block, at)) => {
                        (Some(ValueSource::RmdSetting(tuning, block, at)), String::new())
                    }
                    None => match Quantity::named(name) {
                        Ok(quantity) => {
                            let (code, field) = quantity.read();
                            (Some(ValueSource::Measured(code, field)), String::new())
                        }
                        Err(_) => (None, format!("the motor has no setting or value `{name}`")),
                    },
                }
            }
            _ => (None, format!("there is no register `{name}`")),
        };
        found.ok_or_else(|| Refusal::usage(format!("{why}; nothing was sent")))
    }

    /// The request that reads it. The error says why it cannot be read.
    fn request(&self, exchanges: &Exchanges<'_>) -> Result<Request, String> {
        let motor = exchanges.target.name.motor;
        match self {
            ValueSource::Register(register) => {
                let is_readable = exchanges
                    .of_st()
                    .zip(register.shape())
                    .is_none_or(|((_, profile), shape)| is_readable(&shape, profile));
                match is_readable {
                    true => Ok(Request::st(motor, StRequest::GetRegister(*register))),
                    false => Err(format!("{register} cannot be read")),
                }
            }
            ValueSource::StSetting(tuning, block, _) => {
                let (motor, request) = tuning.request(&Ask::Read(block.id));
                Ok(Request::St(motor, request))
            }
            ValueSource::RmdSetting(tuning, block, _) => {
                Ok(Request::Rmd(tuning.motor, tuning.request(&Ask::Read(block.id))))
            }
            ValueSource::Measured(code, _) => match exchanges.of_rmd() {
                Some(id) => Ok(Request::Rmd(id, [u8::from(*code), 0, 0, 0, 0, 0, 0, 0])),
                None => Err("an ST drive has no such value".to_owned()),
            },
        }
    }

    /// Its value in the reply.
    fn value(&self, name: &str, exchanges: &Exchanges<'_>, reply: &[u8]) -> Option<Value> {
        match self {
            ValueSource::Register(register) => {
                let (_, profile) = exchanges.of_st()?;
                let bits = register.decode(profile, reply)?;
                let reading = Reading { register: *register, bits, profile };
                Some(value_format::of_register(&register.to_string(), reading))
            }
            ValueSource::StSetting(tuning, block, at) => setting_value(tuning, block, *at, reply),
            ValueSource::RmdSetting(tuning, block, at) => setting_value(tuning, block, *at, reply),
            ValueSource::Measured(_, field) => {
                Some(value_format::of_field(name.to_owned(), field, reply.try_into().ok()?))
            }
        }
    }
}

/// The block with the setting of this name, and the index in it.
fn setting<T: Tuning>(tuning: &T, name: &str) -> Option<(Block<T::Id>, usize)> {
    tuning.blocks().into_iter().find_map(|block| {
        let at = block.settings.iter().position(|setting| setting.name == name)?;
        Some((block, at))
    })
}

fn setting_value<T: Tuning>(
    tuning: &T,
    block: &Block<T::Id>,
    at: usize,
    reply: &[u8],
) -> Option<Value> {
    let digits = tuning.answer(&Ask::Read(block.id), reply)?.digits;
    Some(value_format::of_setting(block.settings.get(at)?, *digits.get(at)?))
}

/// Reads values, as [`read_each`]. Those that the drive refuses have the reason as their text.
pub(super) async fn read(
    exchanges: &Exchanges<'_>,
    names: &[String],
) -> Result<Vec<Value>, Refusal> {
    let values = match read_each(exchanges, names).await {
        // The drive has no such motor.
        Err(why) if why.reason == Reason::Refused => vec![Err(why); names.len()],
        values => values?,
    };
    let or_why = |(name, value): (&String, Result<_, Refusal>)| {
        value.unwrap_or_else(|why| value_format::text(name, why.message))
    };
    Ok(names.iter().zip(values).map(or_why).collect())
}

/// Reads values, in the order of their names. One that the drive refuses does not hide the others.
///
/// # Errors
/// A name is unknown: nothing is sent. The line fails. The drive has no such motor. The values are never
/// confirmed.
pub(super) async fn read_each(
    exchanges: &Exchanges<'_>,
    names: &[String],
) -> Result<Vec<Result<Value, Refusal>>, Refusal> {
    let places = names.iter().map(|name| Ok((name, ValueSource::named(exchanges.target, name)?)));
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
    places: &[(&String, ValueSource)],
) -> Result<Vec<Result<Value, Refusal>>, Refusal> {
    let mut replies: Vec<(Request, Result<Vec<u8>, Refusal>)> = Vec::new();
    let mut values = Vec::new();
    for (name, place) in places {
        let request = match place.request(exchanges) {
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
                let reply = exchanges.request(&request).await;
                replies.push((request, reply));
                replies.len() - 1
            }
        };
        values.push(match &replies[at].1 {
            Ok(reply) => {
                Ok(place.value(name, exchanges, reply).ok_or_else(|| exchanges.unfit())?)
            }
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

pub(super) fn is_writable(shape: &Shape, profile: Profile) -> bool {
    matches!(shape.writing(profile, Features::NONE.with(shape.feature)), Access::Takes(_))
}

/// The registers of the motors of a line.
pub(super) fn all(speaks: DriveProtocol) -> Vec<Register> {
    match speaks.motor(1) {
        Some(Motor::St(motor)) => {
            let profile = speaks.profile().unwrap_or_default();
            let registers = RegisterId::all().filter_map(|register| of_st(register, profile));
            let tuning = StTuning { motor, profile };
            let phases = tuning
                .blocks()
                .into_iter()
                .filter(|block| matches!(block.id, st::Setting::RevupPhase(_)));
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
        Some(most) => motorlink_proto::units::Scale { most: most.into(), ..scale },
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
        range: scale.map(|scale| value_format::range(&scale)),
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
        range: Some(value_format::range(&setting.scale)),
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
