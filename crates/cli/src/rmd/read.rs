//! Commands that read.

use motorlink::rmd::{
    Celsius, Errors, Found, MotionStatus, MotorId, MotorSet, PhaseCurrents, Status,
};
use serde_json::{Value, json};

use super::session::Session;
use crate::failure::Failure;
use crate::output::{line, progress};
use crate::repeat::{Repeat, repeated};

/// One value: name, text for people, value for programs.
pub type Row = (&'static str, String, Value);

pub fn scan(session: &Session, ids: Vec<u8>) -> Result<(), Failure> {
    let wanted: MotorSet = ids.iter().copied().filter_map(MotorId::new).collect();
    let wanted = if wanted.is_empty() { MotorSet::ALL } else { wanted };
    let bar = progress(wanted.len());
    let mut found = Vec::new();
    session.bus.scan(wanted, |motor| found.push(motor), |done| bar.set_position(done as u64))?;
    bar.finish_and_clear();
    found.sort_by_key(|found| match found {
        Found::Motor(id, _) | Found::Foreign(id, _) | Found::Echo(id) | Found::Shared(id) => *id,
    });
    if found.iter().any(|found| matches!(found, Found::Echo(_))) {
        return Err(Failure::Line(
            "what was sent came back: the adapter echoes, which looks like motors that answer; add \
             echo=1 to the port, as in slcan:/dev/ttyACM0?echo=1"
                .to_owned(),
        ));
    }
    for motor in &found {
        match motor {
            Found::Motor(id, status) => session.output.result(
                format!(
                    "motor {id:<2}  V1.62  {:>5.1} V  {:>3} °C  errors: {}",
                    status.voltage.volts(),
                    status.temperature.0,
                    status.errors
                ),
                json!({
                    "id": id.number(), "protocol": "V1.62",
                    "voltage": rounded(status.voltage.volts(), 1),
                    "temperature": status.temperature.0, "errors": names(status.errors),
                }),
            )?,
            Found::Foreign(id, dialect) => session.output.result(
                format!("motor {id:<2}  speaks {dialect}: it is not driven with this protocol"),
                json!({ "id": id.number(), "protocol": dialect.to_string() }),
            )?,
            Found::Shared(id) => session.output.result(
                format!("motor {id:<2}  answers another program or host, too"),
                json!({ "id": id.number(), "shared": true }),
            )?,
            Found::Echo(_) => {}
        }
    }
    if let (true, Some(trouble)) = (found.is_empty(), session.bus.trouble()) {
        return Err(Failure::Line(format!(
            "no motor answered, and the adapter may be the cause: {trouble}"
        )));
    }
    if found.is_empty() {
        return Err(Failure::Line(
            "no motor answered; is the supply on, the bus terminated, the bitrate 1 Mbit/s?".into(),
        ));
    }
    Ok(())
}

pub fn status(session: &Session, repeat: Repeat) -> Result<(), Failure> {
    show(session, repeat, |session| {
        let motor = session.motor()?;
        let mut rows = vec![("id", motor.id().to_string(), json!(motor.id().number()))];
        rows.extend(status1(session, &motor.status()?));
        rows.extend(motion(session, &motor.motion_status()?).into_iter().skip(1));
        rows.extend(phases(session, &motor.phase_currents()?));
        rows.extend(angles(session)?);
        Ok(rows)
    })
}

pub fn angle(session: &Session, repeat: Repeat) -> Result<(), Failure> {
    show(session, repeat, angles)
}

fn show(
    session: &Session,
    repeat: Repeat,
    mut sample: impl FnMut(&Session) -> Result<Vec<Row>, Failure>,
) -> Result<(), Failure> {
    repeated(
        &session.bus.clock(),
        repeat,
        || {
            let rows = sample(session)?;
            session.confirmed()?;
            Ok(rows)
        },
        |rows, at| match at {
            None => session.output.rows(rows),
            Some(at) if session.output.json => {
                let mut rows = rows.to_vec();
                rows.insert(0, ("t", String::new(), json!(rounded(at, 6))));
                session.output.rows(&rows)
            }
            Some(at) => {
                let values: Vec<String> = rows
                    .iter()
                    .map(|(name, text, _)| format!("{} {text}", name.replace('_', " ")))
                    .collect();
                line(&format!("{at:>9.3} s  {}", values.join("   ")))
            }
        },
    )
}

fn angles(session: &Session) -> Result<Vec<Row>, Failure> {
    let motor = session.motor()?;
    let (multi, circle) = (motor.multi_turn_angle()?, motor.single_turn_angle()?);
    Ok(vec![
        value(session, "angle", multi.0, multi.degrees(), 2, "°"),
        value(session, "circle_angle", circle.0.into(), circle.degrees(), 2, "°"),
    ])
}

pub fn status1(session: &Session, status: &Status) -> Vec<Row> {
    let errors = if session.raw { json!(status.errors.0) } else { names(status.errors) };
    vec![
        temperature(session, status.temperature),
        value(session, "voltage", status.voltage.0.into(), status.voltage.volts(), 1, "V"),
        ("errors", status.errors.to_string(), errors),
    ]
}

pub fn motion(session: &Session, status: &MotionStatus) -> Vec<Row> {
    vec![
        temperature(session, status.temperature),
        value(session, "torque_current", status.iq.0.into(), status.iq.amps(), 3, "A"),
        value(session, "speed", status.speed.0.into(), status.speed.dps(), 0, "°/s"),
        ("encoder", status.encoder.to_string(), json!(status.encoder)),
    ]
}

fn temperature(session: &Session, temperature: Celsius) -> Row {
    value(session, "temperature", temperature.0.into(), temperature.celsius(), 0, "°C")
}

fn phases(session: &Session, currents: &PhaseCurrents) -> Vec<Row> {
    [("phase_a", currents.phase_a), ("phase_b", currents.phase_b), ("phase_c", currents.phase_c)]
        .map(|(name, current)| value(session, name, current.0.into(), current.amps(), 3, "A"))
        .into()
}

/// A wire integer as digits or in its physical unit.
pub fn value(
    session: &Session,
    name: &'static str,
    digits: i64,
    physical: f64,
    decimals: u8,
    unit: &str,
) -> Row {
    if session.raw {
        return (name, digits.to_string(), json!(digits));
    }
    let decimals_wide = usize::from(decimals);
    let text = format!("{physical:.decimals_wide$} {unit}");
    let number = match decimals {
        0 => json!(physical.round() as i64),
        _ => json!(rounded(physical, decimals)),
    };
    (name, text, number)
}

fn rounded(value: f64, decimals: u8) -> f64 {
    let scale = 10f64.powi(decimals.into());
    (value * scale).round() / scale
}

fn names(errors: Errors) -> Value {
    let active = Errors::NAMES.iter().filter(|(bit, _)| errors.contains(*bit));
    active.map(|(_, name)| *name).collect()
}
