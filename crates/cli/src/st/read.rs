//! Commands that read.

use motorlink::st::{Flags, Profile, Reading, RegisterId, Status, find_register, register};
use serde_json::{Map, Value, json};

use super::session::Session;
use crate::failure::Failure;
use crate::output::{Printer, line};
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
                "needs": shape.feature.name(), "doc": text.doc,
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
    let mut rows = vec![
        ("sdk", info.name.clone(), json!(info.name)),
        ("version", format!("{major}.{minor}.{patch}"), json!(info.version)),
    ];
    match session.client.firmware_version() {
        Ok(firmware) => {
            let text = format!("{} {}", firmware.name, firmware.version);
            rows.push(("firmware", text.clone(), json!(text)));
        }
        // Firmware 5.0 does not know the frame code.
        Err(error) if error.is_refusal() => {
            rows.push(("firmware", "does not tell its version".to_owned(), Value::Null));
        }
        Err(error) => return Err(error.into()),
    }
    session.confirmed()?.rows(&rows)
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
        let text = match register {
            RegisterId::STATUS => format!("{reading}: {}", Status::from(reading.bits as u8).doc()),
            RegisterId::FLAGS => explain(Flags(reading.bits as u32)),
            _ => shown(session, &reading),
        };
        let name = register.text().map_or("", |text| text.name);
        rows.push((name, text, value(session, &reading)));
    }
    session.output.rows(&rows)
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
    repeated(
        &session.client.clock(),
        repeat,
        || registers.iter().map(|&register| read(session, register)).collect(),
        |readings, at| print(session, readings, at),
    )
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
    let mut sample = || {
        // A drive that was restarted has forgotten the segment.
        let mut values = vec![0; registers.len()];
        if !configured || motor.segment(number, &registers, &mut values).is_err() {
            motor.configure_segment(number, &registers)?;
            motor.segment(number, &registers, &mut values)?;
            configured = true;
        }
        session.client.confirm()?;
        let profile = session.client.profile();
        let read = registers.iter().zip(values);
        Ok(read.map(|(&register, bits)| Reading { register, bits, profile }).collect())
    };
    repeated(&session.client.clock(), repeat, &mut sample, |readings, at| {
        print(session, readings, at)
    })
}

fn find_all(names: &[String]) -> Result<Vec<RegisterId>, Failure> {
    names.iter().map(|name| find_register(name).map_err(Failure::from)).collect()
}

fn read(session: &Session, register: RegisterId) -> Result<Reading, Failure> {
    let bits = session.motor()?.get_raw(register)?;
    session.client.confirm()?;
    Ok(Reading { register, bits, profile: session.client.profile() })
}

fn print(session: &Session, readings: &[Reading], at: Option<f64>) -> Result<(), Failure> {
    if session.output.json {
        let time = at.map(|at| ("t".to_owned(), json!((at * 1e6).round() / 1e6)));
        let values = readings.iter().map(|r| (r.register.to_string(), value(session, r)));
        let object: Map<String, Value> = time.into_iter().chain(values).collect();
        return line(&Value::Object(object));
    }
    if let Some(at) = at {
        let values: Vec<String> = readings
            .iter()
            .map(|reading| format!("{} {}", reading.register, shown(session, reading)))
            .collect();
        return line(&format!("{at:>9.3} s  {}", values.join("   ")));
    }
    let width = readings.iter().map(|r| r.register.to_string().len()).max().unwrap_or(0);
    for reading in readings {
        line(&format!("{:<width$}  {}", reading.register.to_string(), shown(session, reading)))?;
    }
    Ok(())
}

fn shown(session: &Session, reading: &Reading) -> String {
    match (session.raw, reading.name()) {
        (true, _) => reading.digits().to_string(),
        (false, Some(name)) if reading.register != RegisterId::TARGET_MOTOR => {
            format!("{name} ({:#x})", reading.digits())
        }
        _ => reading.to_string(),
    }
}

fn value(session: &Session, reading: &Reading) -> Value {
    if session.raw {
        return json!(reading.digits());
    }
    match reading.name() {
        Some(name) => json!({ "value": reading.digits(), "name": name }),
        None => json!({ "value": number(reading), "unit": reading.unit() }),
    }
}

/// An integer where the value is one, so that no `1500.0` is printed.
fn number(reading: &Reading) -> Value {
    let value = (reading.value() * 1e6).round() / 1e6;
    if value.fract() == 0.0 { json!(value as i64) } else { json!(value) }
}
