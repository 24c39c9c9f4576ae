//! Commands that read.

use motorlink::st::{
    BoardInfo, Error, FirmwareVersion, Flags, Profile, RegisterId, Status, find_register,
};
use serde_json::{Value, json};

use super::refusal;
use super::session::Session;
use crate::failure::Failure;
use crate::json::{Cell, Line};
use crate::output::note;

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
        Err(error) if error.is_refusal() => ("has no version".to_owned(), Value::Null),
        Err(error) => return Err(error.into()),
    };
    note_other_profile(session, &info);
    session.confirmed()?.result(
        format!("board     {} {major}.{minor}.{patch}\nfirmware  {text}", info.name),
        Line::about(&session.port, None).with("board", board).with("firmware", firmware),
    )
}

/// Prints a note if the drive looks like one of the other profile.
pub fn note_other_profile(session: &Session, info: &BoardInfo) {
    if info.profile != session.client.profile() {
        let looks_like = match info.profile {
            Profile::Mcsdk54 => "ST's firmware",
            Profile::Spec => "a drive that follows the document",
        };
        note(format!(
            "note: this looks like {looks_like}: add --profile {}, or set MOTORLINK_PROFILE",
            info.profile.name()
        ));
    }
}

/// What only one profile has.
pub const SEGMENTS: &str = "data segments";

/// The registers that `status` shows.
pub const STATUS: [RegisterId; 10] = [
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
    let mut cells = read_all(session, &STATUS)?;
    for (register, cell) in STATUS.into_iter().zip(&mut cells) {
        let Ok(row) = &mut cell.read else { continue };
        let Some(bits) = row.value["value"].as_i64() else { continue };
        match register {
            RegisterId::STATUS => {
                let status = Status::from(bits as u8);
                row.text = format!("{status}: {}", status.doc());
            }
            RegisterId::FLAGS => row.text = explain(Flags(bits as u32)),
            _ => {}
        }
    }
    session.output.cells(session.line(), cells)
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

pub fn get(session: &Session, names: &[String]) -> Result<(), Failure> {
    let cells = read_all(session, &find_all(names)?)?;
    session.output.cells(session.line(), cells)
}

pub fn segment(session: &Session, number: u8, names: &[String]) -> Result<(), Failure> {
    session.wants(Profile::Spec, SEGMENTS)?;
    let registers = find_all(names)?;
    let motor = session.motor()?;
    let mut values = vec![0; registers.len()];
    motor.configure_segment(number, &registers)?;
    motor.segment(number, &registers, &mut values)?;
    session.client.confirm()?;
    let read = registers.iter().zip(values);
    let cells = read.map(|(&register, bits)| session.cell(register, bits)).collect();
    session.output.cells(session.line(), cells)
}

pub fn find_all(names: &[String]) -> Result<Vec<RegisterId>, Failure> {
    names.iter().map(|name| find_register(name).map_err(Failure::from)).collect()
}

/// Reads registers, and confirms each reply. If the drive refuses one, or replies as in the other
/// profile, the others are still read.
fn read_all(session: &Session, registers: &[RegisterId]) -> Result<Vec<Cell>, Failure> {
    let motor = session.motor()?;
    registers
        .iter()
        .map(|&register| {
            let read = motor.get_raw(register);
            // After a lost exchange, the next one recovers the line first. Earlier values are confirmed.
            if !read.as_ref().is_err_and(Error::is_line_failure) {
                session.client.confirm()?;
            }
            match read {
                Ok(bits) => Ok(session.cell(register, bits)),
                Err(error) if refusal::is_about_register(&error) => {
                    let failure = refusal::of_read(error, register, session.client.profile());
                    let read = Err(session.about(failure));
                    Ok(Cell { name: register.to_string(), read })
                }
                Err(error) => Err(error.into()),
            }
        })
        .collect()
}
