//! The commands of both protocols: what they are, and their requests.

use std::collections::BTreeMap;

use motorlink_proto::rmd::{COMMANDS, CommandInfo, Field as RmdField, Meaning};
use motorlink_proto::st::message::REVUP_PHASES;
use motorlink_proto::st::register::Type;
use motorlink_proto::st::{
    self, BoardInfo, FirmwareVersion, FrameCode, Profile, Ramp, Request as StRequest,
};
use motorlink_proto::units::{Rounding, Scale};
use motorlink_spec::st_messages::{self, Content, Value as StField};
use motorlink_telemetry::line::Request;
use motorlink_telemetry::share::client::Refusal;
use motorlink_telemetry::share::drive_protocol::DriveProtocol;
use motorlink_telemetry::share::drive_values::range;
use motorlink_telemetry::share::motor_exchange::Target;
use motorlink_telemetry::signal::Motor;

use crate::message::{self, Field, Value};

/// A command of a protocol.
#[derive(Clone, Copy)]
pub(super) enum Command {
    /// A command of EXECUTE_CMD.
    Execute(st::Command),
    /// Another message to an ST drive.
    Message(FrameCode, Profile),
    /// A command of the RMD protocol.
    Rmd(&'static CommandInfo),
}

impl Command {
    /// All commands of the drives of a line.
    pub(super) fn all(speaks: DriveProtocol) -> Vec<Self> {
        let DriveProtocol::St(profile) = speaks else {
            return COMMANDS.iter().map(Command::Rmd).collect();
        };
        let executed = st::Command::ALL.iter().filter(|command| command.is_in(profile));
        let messages = FrameCode::ALL.iter().filter(|code| is_listed(**code, profile));
        executed
            .map(|command| Command::Execute(*command))
            .chain(messages.map(|code| Command::Message(*code, profile)))
            .collect()
    }

    /// The command with this name.
    pub(super) fn named(target: &Target, name: &str) -> Result<Self, Refusal> {
        let all = Self::all(target.speaks);
        all.iter().find(|command| command.name() == name).copied().ok_or_else(|| {
            let names: Vec<&str> = all.iter().map(Command::name).collect();
            Refusal::usage(format!("no command `{name}`; the commands are {}", names.join(", ")))
        })
    }

    fn name(&self) -> &'static str {
        match self {
            Command::Execute(command) => command.name().unwrap_or_default(),
            Command::Message(code, _) => code.name(),
            Command::Rmd(row) => row.stem,
        }
    }

    /// Whether it wears the ROM of the motor.
    pub(super) fn wears_rom(&self) -> bool {
        matches!(self, Command::Rmd(row) if row.rom)
    }

    /// Its description for pages.
    pub(super) fn described(&self, motor: Motor) -> message::Command {
        let (doc, fields) = match self {
            Command::Execute(command) => (command.doc(), Vec::new()),
            Command::Message(code, profile) => {
                (code.doc(), st_fields(*code, *profile).iter().map(described).collect())
            }
            Command::Rmd(row) => (row.code.doc(), row.request.iter().map(rmd_described).collect()),
        };
        message::Command {
            name: self.name().to_owned(),
            doc: doc.to_owned(),
            fields,
            moves: self.plain(motor).is_some_and(|request| request.motion().may_move()),
            wears_rom: self.wears_rom(),
        }
    }

    /// The request, with 0 in all fields.
    fn plain(&self, motor: Motor) -> Option<Request> {
        let st = |request| Request::st(motor.number(), request);
        match (self, motor) {
            (Command::Execute(command), _) => Some(st(StRequest::ExecuteCommand(*command))),
            (Command::Message(code, profile), _) => {
                let payload = [0; st::MAX_PAYLOAD];
                StRequest::decode(*profile, code.number(), &payload).ok().map(st)
            }
            (Command::Rmd(row), Motor::Rmd(id)) => {
                Some(Request::Rmd(id, [u8::from(row.code), 0, 0, 0, 0, 0, 0, 0]))
            }
            (Command::Rmd(_), Motor::St(_)) => None,
        }
    }

    /// The request with these values, by the names of the fields.
    pub(super) fn request(
        &self,
        target: &Target,
        values: &BTreeMap<String, f64>,
    ) -> Result<Request, Refusal> {
        let known = self.described(target.motor).fields;
        if let Some(name) =
            values.keys().find(|name| known.iter().all(|field| field.name != **name))
        {
            let names: Vec<&str> = known.iter().map(|field| field.name.as_str()).collect();
            let has = match names.is_empty() {
                true => "it has none".to_owned(),
                false => format!("its values are {}", names.join(", ")),
            };
            let command = self.name();
            return Err(Refusal::unsent(format!("{command} has no value `{name}`; {has}")));
        }
        let wanted = |name: &str| {
            values
                .get(name)
                .copied()
                .ok_or_else(|| Refusal::unsent(format!("{} needs the value `{name}`", self.name())))
        };
        match self {
            Command::Message(code, profile) => {
                let mut payload = Vec::new();
                for field in st_fields(*code, *profile) {
                    payload.extend(st_bytes(&field, wanted(field.value.name)?)?);
                }
                let request = StRequest::decode(*profile, code.number(), &payload)
                    .map_err(|error| Refusal::usage(error.doc()))?;
                let motor = match request {
                    // About the drive.
                    StRequest::GetBoardInfo | StRequest::GetFirmwareVersion => 0,
                    _ => target.name.motor,
                };
                Ok(Request::st(motor, request))
            }
            Command::Rmd(row) => {
                let Motor::Rmd(id) = target.motor else {
                    return Err(Refusal::usage("not an RMD motor"));
                };
                let mut data = [u8::from(row.code), 0, 0, 0, 0, 0, 0, 0];
                for field in row.request {
                    let name = field.name_with_unit().to_string();
                    let digits = rmd_digits(field, &name, wanted(&name)?)?;
                    let place = usize::from(field.offset)..usize::from(field.offset + field.len);
                    data[place].copy_from_slice(&digits.to_le_bytes()[..usize::from(field.len)]);
                }
                Ok(Request::Rmd(id, data))
            }
            Command::Execute(_) => {
                self.plain(target.motor).ok_or_else(|| Refusal::usage("not an ST drive"))
            }
        }
    }

    /// The values of the reply; `None` if the reply does not fit.
    pub(super) fn values(&self, reply: &[u8]) -> Option<Vec<Value>> {
        match self {
            Command::Execute(_) => Some(Vec::new()),
            Command::Rmd(row) => {
                let data: &[u8; 8] = reply.try_into().ok()?;
                // The reply to these repeats the request.
                let fields = row.reply.iter().filter(|_| !row.echo);
                let value = |field: &RmdField| {
                    Value::of_field(field.name_with_unit().to_string(), field, data)
                };
                Some(fields.map(value).collect())
            }
            Command::Message(code, _) => {
                let (_, content) = st_messages::contents(*code);
                match content {
                    Content::BoardInfo => {
                        let board = BoardInfo::decode(reply)?;
                        let [major, minor, patch] = board.version;
                        Some(vec![
                            Value::text("name", motorlink_link::printable(board.name)),
                            Value::text("version", format!("{major}.{minor}.{patch}")),
                        ])
                    }
                    Content::FirmwareVersion => {
                        let firmware = FirmwareVersion::decode(reply);
                        let text = |name, text| Value::text(name, motorlink_link::printable(text));
                        Some(vec![text("name", firmware.name), text("version", firmware.version)])
                    }
                    _ => content
                        .values()
                        .map(|(at, field)| st_value(field, reply.get(at..)?))
                        .collect(),
                }
            }
        }
    }
}

/// Whether pages have a message as a command. Registers and data segments have their own requests.
fn is_listed(code: FrameCode, profile: Profile) -> bool {
    let (request, reply) = st_messages::contents(code);
    FrameCode::from_number(code.number(), profile) == Some(code)
        && matches!(request, Content::Values(_))
        && matches!(reply, Content::Values(_) | Content::BoardInfo | Content::FirmwareVersion)
}

/// A number of a request to an ST drive, with its range in digits.
struct StNumber {
    value: &'static StField,
    scale: Scale,
}

fn st_fields(code: FrameCode, profile: Profile) -> Vec<StNumber> {
    let (content, _) = st_messages::contents(code);
    let number = |(at, value): (usize, &'static StField)| {
        let bits = 8 * u32::from(value.ty.size());
        let (least, most) = match value.ty.signed() {
            true => (-(1_i64 << (bits - 1)), (1_i64 << (bits - 1)) - 1),
            false => (0, (1_i64 << bits) - 1),
        };
        let (least, most) = match code {
            FrameCode::SetRamp if at == 0 => {
                (-i64::from(Ramp::MAX_SPEED_RPM), i64::from(Ramp::MAX_SPEED_RPM))
            }
            FrameCode::GetRevupData | FrameCode::SetRevupData if at == 0 => {
                (0, i64::from(REVUP_PHASES) - 1)
            }
            _ => (least, most),
        };
        let scale = Scale {
            digit: value.unit.scale(profile),
            symbol: value.unit.quantity(),
            rounding: Rounding::Nearest,
            ..Scale::plain(least, most)
        };
        StNumber { value, scale }
    };
    content.values().map(number).collect()
}

fn described(field: &StNumber) -> Field {
    let range = match field.value.ty {
        Type::F32 => [f32::MIN.into(), f32::MAX.into(), 0.0],
        _ => range(&field.scale),
    };
    let (name, doc) = (field.value.name.to_owned(), field.value.label.to_owned());
    Field { name, doc, unit: field.scale.symbol.to_owned(), range, words: Vec::new() }
}

fn st_bytes(field: &StNumber, wanted: f64) -> Result<Vec<u8>, Refusal> {
    let name = field.value.name;
    if field.value.ty == Type::F32 {
        let value = wanted as f32;
        // A negative duration or angle beyond all bounds is checked with the whole request.
        return match value.is_finite() {
            true => Ok(value.to_le_bytes().to_vec()),
            false => Err(Refusal::unsent(format!("{name}: {wanted} is not a number"))),
        };
    }
    let digits = exactly(&field.scale, name, wanted)?;
    Ok(digits.to_le_bytes()[..usize::from(field.value.ty.size())].to_vec())
}

fn st_value(field: &StField, bytes: &[u8]) -> Option<Value> {
    let size = usize::from(field.ty.size());
    let bytes = bytes.get(..size)?;
    let mut word = [if field.ty.signed() && bytes[size - 1] & 0x80 != 0 { 0xFF } else { 0 }; 8];
    word[..size].copy_from_slice(bytes);
    let number = match field.ty {
        Type::F32 => f64::from(f32::from_le_bytes(bytes.try_into().ok()?)),
        _ => i64::from_le_bytes(word) as f64,
    };
    Some(Value {
        name: field.name.to_owned(),
        value: Some(number),
        text: number.to_string(),
        unit: field.unit.quantity().to_owned(),
    })
}

fn rmd_described(field: &RmdField) -> Field {
    let words = match field.meaning {
        Meaning::Words(words) => words.iter().map(|(_, word)| (*word).to_owned()).collect(),
        Meaning::Number | Meaning::Bits(_) => Vec::new(),
    };
    let mut range = range(&field.scale);
    if let Some(most) = words.len().checked_sub(1) {
        range[1] = most as f64;
    }
    Field {
        name: field.name_with_unit().to_string(),
        doc: field.doc.to_owned(),
        unit: field.scale.symbol.to_owned(),
        range,
        words,
    }
}

fn rmd_digits(field: &RmdField, name: &str, wanted: f64) -> Result<i64, Refusal> {
    let digits = exactly(&field.scale, name, wanted)?;
    if let Meaning::Words(words) = field.meaning
        && words.iter().all(|(number, _)| i64::from(*number) != digits)
    {
        let all: Vec<_> = words.iter().map(|(number, word)| format!("{number} ({word})")).collect();
        let all = all.join(", ");
        return Err(Refusal::unsent(format!("{name}: {wanted} is none of {all}")));
    }
    Ok(digits)
}

/// The digits of a value in its range.
fn exactly(scale: &Scale, name: &str, wanted: f64) -> Result<i64, Refusal> {
    scale.wanted(wanted).map_err(|why| Refusal::unsent(format!("{name}: {why}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_of_st_are_read_as_they_are_written() {
        for (code, at, wanted) in [
            (FrameCode::SetRamp, 0, -1000.0),
            (FrameCode::SetRamp, 1, 65_535.0),
            (FrameCode::SetPositionCmd, 0, -0.5),
        ] {
            let field = &st_fields(code, Profile::Mcsdk54)[at];
            let bytes = st_bytes(field, wanted).unwrap();
            assert_eq!(st_value(field.value, &bytes).unwrap().value, Some(wanted));
        }
    }
}
