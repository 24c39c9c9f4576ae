//! Drives as queries read them: what the monitor reads for its pages.

use std::collections::BTreeMap;

use motorlink::settings::fact;
use motorlink_fleet::message::Value;
use motorlink_fleet::node::{Drive, Reader, Reading};
use motorlink_monitor::drive;
use motorlink_monitor::message::{self, Register};
use motorlink_telemetry::share::client::Refusal;
use motorlink_telemetry::share::message::{Line, MotorName};

/// All drives of a node.
pub struct Drives;

impl Reader for Drives {
    fn registers(&self, line: &Line) -> Vec<String> {
        let readable = registers(line).into_iter().filter(|register| register.readable);
        readable.map(|register| register.name).collect()
    }

    fn read(&self, drive: Drive, names: Vec<String>) -> Reading<'_, Vec<Result<Value, Refusal>>> {
        Box::pin(async move {
            let (drives, motor) = of(&drive);
            let values = drives.read(&motor, &names, &drive.program).await?;
            let units = registers(&drive.line).into_iter().map(|it| (it.name, it.unit));
            let units: BTreeMap<_, _> = units.collect();
            let with_unit = |value: message::Value| {
                let unit = units.get(&value.name).cloned().unwrap_or_default();
                Value { name: value.name, value: value.value, text: value.text, unit }
            };
            Ok(values.into_iter().map(|value| value.map(with_unit)).collect())
        })
    }

    fn identity(&self, drive: Drive) -> Reading<'_, BTreeMap<String, String>> {
        Box::pin(async move {
            let (drives, motor) = of(&drive);
            let lines = drives.identity(&motor, &drive.program).await?;
            let facts = lines.iter().map(|line| fact(line));
            Ok(facts.map(|(what, is)| (what.to_owned(), is.to_owned())).collect())
        })
    }

    fn settings(&self, drive: Drive) -> Reading<'_, String> {
        Box::pin(async move {
            let (drives, motor) = of(&drive);
            Ok(drives.dump(&motor, &drive.program).await?.text())
        })
    }
}

fn of(drive: &Drive) -> (drive::Drives, MotorName) {
    let name = MotorName { line: drive.line.line.clone(), motor: drive.motor };
    (drive::Drives::new(vec![drive.line.clone()]), name)
}

/// The registers of a line's motors. None: its profile is unknown here.
fn registers(line: &Line) -> Vec<Register> {
    let drives = drive::Drives::new(vec![line.clone()]);
    drives.describe(&line.line).map(|description| description.registers).unwrap_or_default()
}
