//! Commands that read.

use motorlink::rmd::{MotorId, MotorSet, MultiTurnAngle, ScanResult, SingleTurnAngle};

use super::session::Session;
use crate::failure::Failure;
use crate::json::Row;
use crate::output::progress;

/// The version of the protocol.
const DRIVEN: &str = "V1.62";

pub fn scan(session: &Session, ids: Vec<MotorId>) -> Result<(), Failure> {
    let wanted: MotorSet = ids.into_iter().collect();
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
        return Err(Failure::link(
            "each sent frame is received again: the adapter echoes, which looks like motors that answer",
        )
        .trying("add echo=1 to the port, as in slcan:/dev/ttyACM0?echo=1"));
    }
    for motor in &found {
        match motor {
            ScanResult::Motor(id, status) => {
                let rows = session.rows(status)?;
                let texts: Vec<String> =
                    rows.iter().map(|row| format!("{:>6}", row.text)).collect();
                session.output.result(
                    format!("motor {id:<2}  {DRIVEN}  {}", texts.join("  ")),
                    session.line(id.number()).with("dialect", DRIVEN).values(&rows),
                )?;
            }
            ScanResult::Foreign(id, dialect) => session.output.result(
                format!("motor {id:<2}  speaks {dialect}: it is not driven with this protocol"),
                session.line(id.number()).with("dialect", dialect.to_string()),
            )?,
            ScanResult::Shared(id) => session.output.result(
                format!("motor {id:<2}  answers another program or host, too"),
                session.line(id.number()).with("shared", true),
            )?,
            ScanResult::Echo(_) => {}
        }
    }
    if let (true, Some(trouble)) = (found.is_empty(), session.bus.trouble()) {
        return Err(Failure::link(format!(
            "no motor answered, and the adapter may be the cause: {trouble}"
        )));
    }
    if found.is_empty() {
        return Err(Failure::link(
            "no motor answered; is the supply on, is the bus terminated, and is the bitrate 1 Mbit/s?",
        ));
    }
    Ok(())
}

pub fn status(session: &Session) -> Result<(), Failure> {
    let motor = session.motor()?;
    // JSON names the motor outside of the values.
    let id = (!session.output.json).then(|| Row::plain("motor", motor.id().number().into()));
    let mut all: Vec<Row> = id.into_iter().chain(session.rows(&motor.status()?)?).collect();
    // Both replies have the temperature.
    all.extend(session.rows(&motor.motion_status()?)?.into_iter().skip(1));
    all.extend(session.rows(&motor.phase_currents()?)?);
    all.extend(angles(session)?);
    session.confirm()?;
    session.output.rows(session.line(session.id), &all)
}

pub fn angle(session: &Session) -> Result<(), Failure> {
    let rows = angles(session)?;
    session.confirm()?;
    session.output.rows(session.line(session.id), &rows)
}

fn angles(session: &Session) -> Result<Vec<Row>, Failure> {
    let motor = session.motor()?;
    let multi_turn = session.rows(&MultiTurnAngle { angle: motor.multi_turn_angle()? })?;
    let single_turn = session.rows(&SingleTurnAngle { angle: motor.single_turn_angle()? })?;
    let named = |name: &'static str, rows: Vec<Row>| {
        rows.into_iter().map(move |row| Row { name: name.to_owned(), ..row })
    };
    let multi_turn = named("multi_turn_angle", multi_turn);
    Ok(multi_turn.chain(named("single_turn_angle", single_turn)).collect())
}
