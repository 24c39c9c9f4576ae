//! Commands that read.

use motorlink::st::{
    FirmwareVersion, Flags, Profile, Reading, RegisterId, Status, find_register, register,
};
use serde_json::{Value, json};

use super::session::Session;
use crate::failure::Failure;
use crate::json::{self, Line, Row};
use crate::output::Printer;
use crate::repeat::{Repeat, repeated};

pub fn registers(output: Printer) -> Result<(), Failure> {
    for id in RegisterId::all() {
        let (Some(shape), Some(text)) = (id.shape(), id.text()) else { continue };
        let origin = match shape.origin {
            register::Origin::Table3 => "",
            register::Origin::Firmware => " (mcsdk-5.4)",
        };
        let unit = shape.unit.symbol();
        let [ty, mcsdk] = [Profile::Spec, Profile::Mcsdk54].map(|profile| shape.ty(profile).name());
        let differs = if ty == mcsdk { String::new() } else { format!(" (mcsdk-5.4: {mcsdk})") };
        let (access, name) = (shape.access.name(), text.name);
        output.result(
            format!(
                "{:#04x}  {name:<21} {ty:<3}  {access:<2}  {unit:<11} {}{origin}{differs}",
                id.0, text.doc
            ),
            json!({
                "id": id.0, "name": name, "type": ty, "mcsdk_type": mcsdk, "access": access, "unit": unit,
                "feature": shape.feature.name(), "doc": text.doc,
                "profile": if origin.is_empty() { Value::Null } else { "mcsdk-5.4".into() },
            }),
        )?;
    }
    Ok(())
}

pub fn info(session: &Session) -> Result<(), Failure> {
    let info = session.client.board_info()?;
    session.client.confirm()?;
    let [major, minor, patch] = info.version;
    let board = json!({ "name": info.name, "version": info.version });
    let (text, firmware) = match session.client.firmware_version() {
        Ok(FirmwareVersion { name, version }) => {
            (format!("{name} {version}"), json!({ "name": name, "version": version }))
        }
        // Firmware 5.0 does not know the frame code.
        Err(error) if error.is_refusal() => ("does not tell its version".to_owned(), Value::Null),
        Err(error) => return Err(error.into()),
    };
    session.confirmed()?.result(
        format!("board     {} {major}.{minor}.{patch}\nfirmware  {text}", info.name),
        Line::about(&session.port, None).with("board", board).with("firmware", firmware),
    )
}

/// The registers that `status` shows.
const STATUS: [RegisterId; 10] = [
    RegisterId::STATUS,
    RegisterId::FLAGS,
    RegisterId::CONTROL_MODE,
    RegisterId::SPEED_REF,
    RegisterId::SPEED_MEAS,
    RegisterId::TORQUE_REF,
    RegisterId::TORQUE_MEAS,
    RegisterId::BUS_VOLTAGE,
    RegisterId::HEATS_TEMP,
    RegisterId::MOTOR_POWER,
];

pub fn status(session: &Session) -> Result<(), Failure> {
    let mut rows = Vec::new();
    for register in STATUS {
        let reading = read(session, register)?;
        let mut row = row(session, &reading);
        match register {
            _ if session.raw => {}
            RegisterId::STATUS => {
                row.text = format!("{reading}: {}", Status::from(reading.bits as u8).doc());
            }
            RegisterId::FLAGS => row.text = explain(Flags(reading.bits as u32)),
            _ => {}
        }
        rows.push(row);
    }
    session.output.rows(session.line(), &rows)
}

/// Fault bits spelled out.
pub fn explain(flags: Flags) -> String {
    let all = flags.occurred() | flags.present();
    let mut text = flags.to_string();
    for (bit, name, doc) in Flags::NAMES {
        if all & bit != 0 {
            text += &format!("\n    {name}: {doc}");
        }
    }
    text
}

pub fn get(session: &Session, names: &[String], repeat: Repeat) -> Result<(), Failure> {
    let registers = find_all(names)?;
    show(session, repeat, || {
        registers.iter().map(|&register| Ok(row(session, &read(session, register)?))).collect()
    })
}

pub fn segment(
    session: &Session,
    number: u8,
    names: &[String],
    repeat: Repeat,
) -> Result<(), Failure> {
    session.wants(Profile::Spec, "data segments")?;
    let registers = find_all(names)?;
    let motor = session.motor()?;
    let mut configured = false;
    show(session, repeat, || {
        // A drive that was restarted has forgotten the segment.
        let mut values = vec![0; registers.len()];
        if !configured || motor.segment(number, &registers, &mut values).is_err() {
            motor.configure_segment(number, &registers)?;
            motor.segment(number, &registers, &mut values)?;
            configured = true;
        }
        session.client.confirm()?;
        let read = registers.iter().zip(values);
        Ok(read.map(|(&register, bits)| row(session, &session.reading(register, bits))).collect())
    })
}

fn show(
    session: &Session,
    repeat: Repeat,
    sample: impl FnMut() -> Result<Vec<Row>, Failure>,
) -> Result<(), Failure> {
    let (clock, output, object) = (session.client.clock(), session.output, session.line());
    repeated(&clock, repeat, output, &object, sample, |rows, at| {
        output.sample(object.clone(), rows, at)
    })
}

fn find_all(names: &[String]) -> Result<Vec<RegisterId>, Failure> {
    names.iter().map(|name| find_register(name).map_err(Failure::from)).collect()
}

fn read(session: &Session, register: RegisterId) -> Result<Reading, Failure> {
    let bits = session.motor()?.get_raw(register)?;
    session.client.confirm()?;
    Ok(session.reading(register, bits))
}

/// A register with its value as people read it.
fn row(session: &Session, reading: &Reading) -> Row {
    json::register(reading, session.text(reading), session.raw)
}
