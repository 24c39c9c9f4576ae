//! The RMD protocol.

use motorlink_proto::rmd::{
    COMMANDS, Command, CommandInfo, EncoderBits, Field, MOTOR_BASE, Meaning, MotorId, MotorSet,
    Payload, SetTorque, SetTorque4, TORQUE4_ID, Version,
};
use motorlink_proto::units::Rounding;
use serde_json::{Value, json};

use super::range::range;

pub fn tables() -> Value {
    let motors: Vec<u8> = MotorSet::ALL.map(MotorId::number).collect();
    let widths: Vec<u8> =
        (0..=u8::MAX).filter_map(EncoderBits::new).map(EncoderBits::bits).collect();
    json!({
        "protocol": "RMD motor control protocol over CAN",
        "version": Version::V1_62.name(),
        "frame": { "kind": "standard data frame", "bytes": 8, "byte_order": "little", "code_at": 0 },
        "motors": ends(&motors),
        "identifier_base": MOTOR_BASE,
        "encoder_bits": ends(&widths),
        "commands": COMMANDS.iter().map(command).collect::<Vec<_>>(),
        "torque4": {
            "identifier": TORQUE4_ID,
            "motors": ends(&MotorSet::TORQUE4.map(MotorId::number).collect::<Vec<_>>()),
            "request": SetTorque4::FIELDS.iter().map(field).collect::<Vec<_>>(),
            "reply_of": SetTorque::CODE.info().map(|row| row.stem),
        },
    })
}

fn ends(ascending: &[u8]) -> Value {
    let end = |number: Option<&u8>| number.copied().unwrap_or_default().into();
    range(end(ascending.first()), end(ascending.last()))
}

fn command(row: &CommandInfo) -> Value {
    let codes = COMMANDS.iter().map(|other| other.code);
    let replies: Vec<u8> =
        codes.filter(|&code| row.code.is_answered_by(code)).map(|code| code.number()).collect();
    json!({
        "code": row.code.number(),
        "name": row.stem,
        "title": row.code.name(),
        "description": row.code.doc(),
        "paragraph": row.paragraph,
        "versions": row.versions.iter().map(|version| version.name()).collect::<Vec<_>>(),
        "echo": row.echo,
        "writes_rom": row.rom,
        "moves": row.motion.may_move(),
        "sampled": row.sampled,
        "request": row.request.iter().map(field).collect::<Vec<_>>(),
        "reply_name": row.reply_name,
        "reply_codes": replies,
        "reply": row.reply.iter().map(field).collect::<Vec<_>>(),
    })
}

fn field(field: &Field) -> Value {
    let scale = field.scale;
    let mut object = json!({
        "name": field.name,
        "description": field.doc,
        "byte": field.offset,
        "bytes": field.len,
        "bit": u32::from(field.offset) * 8,
        "bits": u32::from(field.len) * 8,
        "signed": field.signed,
        "digit": scale.digit,
        "unit": scale.symbol,
        "unit_name": scale.suffix,
        "decimals": scale.decimals,
        "range": range(scale.least, scale.most),
        "rounding": rounding(scale.rounding),
        "encoder_counts": field.is_encoder_counts(),
    });
    let number = |(number, name): &(u8, &str)| json!({ "number": number, "name": name });
    match field.meaning {
        Meaning::Number => {}
        Meaning::Words(words) => object["values"] = words.iter().map(number).collect(),
        Meaning::Bits(bits) => {
            let bit =
                |(mask, name): &(u8, &str)| json!({ "bit": mask.trailing_zeros(), "name": name });
            object["flags"] = bits.iter().map(bit).collect();
        }
    }
    object
}

fn rounding(rounding: Rounding) -> &'static str {
    match rounding {
        Rounding::Nearest => "nearest",
        Rounding::Inward => "towards-zero",
        Rounding::NoLimitOfZero => "nearest-but-only-zero-becomes-zero",
    }
}
