//! Commands that read.

use motorlink::rmd::{
    Field, Meaning, MotorId, MotorSet, MultiTurnAngle, Payload, ScanResult, SingleTurnAngle,
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
        ScanResult::Motor(id, _)
        | ScanResult::Foreign(id, _)
        | ScanResult::Echo(id)
        | ScanResult::Shared(id) => *id,
    });
    if found.iter().any(|found| matches!(found, ScanResult::Echo(_))) {
        return Err(Failure::Line(
            "what was sent came back: the adapter echoes, which looks like motors that answer; add \
             echo=1 to the port, as in slcan:/dev/ttyACM0?echo=1"
                .to_owned(),
        ));
    }
    for motor in &found {
        match motor {
            ScanResult::Motor(id, status) => session.output.result(
                format!(
                    "motor {id:<2}  V1.62  {:>5.1} V  {:>3} °C  errors: {}",
                    status.voltage.volts(),
                    status.temperature.0,
                    status.errors
                ),
                json!({
                    "id": id.number(), "protocol": "V1.62",
                    "voltage": rounded(status.voltage.volts(), 1),
                    "temperature": status.temperature.0, "errors": status.errors.words().collect::<Value>(),
                }),
            )?,
            ScanResult::Foreign(id, dialect) => session.output.result(
                format!("motor {id:<2}  speaks {dialect}: it is not driven with this protocol"),
                json!({ "id": id.number(), "protocol": dialect.to_string() }),
            )?,
            ScanResult::Shared(id) => session.output.result(
                format!("motor {id:<2}  answers another program or host, too"),
                json!({ "id": id.number(), "shared": true }),
            )?,
            ScanResult::Echo(_) => {}
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
        let mut all = vec![("id", motor.id().to_string(), json!(motor.id().number()))];
        all.extend(rows(session, &motor.status()?));
        // The temperature stands there already.
        all.extend(rows(session, &motor.motion_status()?).into_iter().skip(1));
        all.extend(rows(session, &motor.phase_currents()?));
        all.extend(angles(session)?);
        Ok(all)
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
    let multi_turn = MultiTurnAngle { angle: motor.multi_turn_angle()? };
    let single_turn = SingleTurnAngle { angle: motor.single_turn_angle()? };
    let named =
        |name, rows: Vec<Row>| rows.into_iter().map(move |(_, text, value)| (name, text, value));
    let multi_turn = named("multi_turn_angle", rows(session, &multi_turn));
    Ok(multi_turn.chain(named("single_turn_angle", rows(session, &single_turn))).collect())
}

/// The values of a message, as the command table has them.
pub fn rows<P: Payload>(session: &Session, message: &P) -> Vec<Row> {
    let data = message.encode_as(0);
    P::FIELDS.iter().map(|field| row(session, field, &data)).collect()
}

fn row(session: &Session, field: &Field, data: &[u8; 8]) -> Row {
    let digits = field.raw(data);
    if session.raw {
        return (field.name, digits.to_string(), json!(digits));
    }
    let value = match (field.meaning, field.scale.decimals) {
        (Meaning::Bits(bits), _) => bits
            .iter()
            .filter(|(bit, _)| digits & i64::from(*bit) != 0)
            .map(|(_, word)| *word)
            .collect(),
        (Meaning::Words(_), _) => json!(field.shown(data).to_string()),
        (Meaning::Number, 0) => json!(digits),
        (Meaning::Number, decimals) => json!(rounded(field.value(data), decimals)),
    };
    (field.name, field.shown(data).to_string(), value)
}

fn rounded(value: f64, decimals: u8) -> f64 {
    let scale = 10f64.powi(decimals.into());
    (value * scale).round() / scale
}
