//! A run of a scenario as a recording: the same kinds of messages as of real drives.

use std::f64::consts::PI;
use std::io;

use motorlink_recording::record::Topics;
use motorlink_recording::schema::{
    JointState, Log, Severity, SignalField, SignalsRow, SignalsType, Time, name, recording,
    snake_case,
};
use motorlink_recording::write::{Entry, whole};
use motorlink_testbench::scenario::{Run, Scenario};

/// A motor of the run.
struct Motor {
    /// `st/motor1`.
    path: String,
    /// Its signals, by their place in the run.
    columns: Vec<usize>,
    ty: SignalsType,
    topic: usize,
}

/// The file. Its times begin at 0, so that the same run has the same bytes.
pub fn bytes(scenario: &Scenario, run: &Run) -> io::Result<Vec<u8>> {
    let about = [
        (recording::VERSION, env!("CARGO_PKG_VERSION").to_owned()),
        (recording::FORMAT, recording::FORMAT_1.to_owned()),
        (recording::SCENARIO, scenario.title.clone()),
    ];
    let about = about.into_iter().map(|(key, value)| (key.to_owned(), value)).collect();
    let mut topics = Topics::default();
    let motors = motors(run, &mut topics);
    let mut entries = vec![Entry::Metadata(recording::NAME.to_owned(), about)];
    entries.extend(topics.take());
    entries.extend(events(run));
    for (row, seconds) in run.times().enumerate() {
        let stamp = time(seconds);
        for motor in &motors {
            let values: Vec<f64> = motor.columns.iter().map(|at| run.columns[*at][row]).collect();
            entries.push(Entry::message(Topics::JOINT_STATES, stamp, &motor.joint(stamp, &values)));
            let data = motor.ty.encode(&SignalsRow { stamp, span_s: 0.0, values });
            entries.push(Entry::Message { topic: motor.topic, time: stamp.0, data });
        }
    }
    whole(entries)
}

fn time(seconds: f64) -> Time {
    Time((seconds * 1e6).round() as u64 * 1000)
}

fn motors(run: &Run, topics: &mut Topics) -> Vec<Motor> {
    let mut motors: Vec<(&str, Vec<usize>)> = Vec::new();
    for (at, signal) in run.signals.iter().enumerate() {
        let (drive, _) = signal.name.split_once('.').unwrap_or_default();
        match motors.last_mut() {
            Some((last, columns)) if *last == drive => columns.push(at),
            _ => motors.push((drive, vec![at])),
        }
    }
    let motor = |(drive, columns): (&str, Vec<usize>)| {
        // `st1` is motor 1 of the drive `st`.
        let digits = drive.find(|c: char| c.is_ascii_digit()).unwrap_or(drive.len());
        let (label, number) = drive.split_at(digits);
        let path = format!("{label}/motor{number}");
        let field = |at: &usize| {
            let signal = &run.signals[*at];
            let name = signal.name.split_once('.').map_or(&*signal.name, |(_, name)| name);
            SignalField {
                field: snake_case(name),
                signal: name.to_owned(),
                unit: signal.kind.unit().to_owned(),
                doc: String::new(),
            }
        };
        let name = format!("/{path}/{}", name::SIGNALS);
        let ty = SignalsType::of_fields(&name, columns.iter().map(field).collect());
        let topic = topics.signals(&name, &ty);
        Motor { path, columns, ty, topic }
    };
    motors.into_iter().map(motor).collect()
}

impl Motor {
    fn joint(&self, stamp: Time, values: &[f64]) -> JointState {
        let value = |name: &str, factor: f64| {
            let at = self.ty.fields().iter().position(|field| field.signal == name);
            at.map(|at| values[at] * factor)
        };
        let degree = PI / 180.0;
        let speed = value("speed_rpm", 6.0 * degree).or_else(|| value("speed_dps", degree));
        JointState {
            stamp,
            name: vec![self.path.replace('/', "_")],
            position: value("angle_degrees", degree).into_iter().collect(),
            velocity: speed.into_iter().collect(),
            effort: value("iq_amps", 1.0).into_iter().collect(),
        }
    }
}

/// What the scenario does, and what was refused.
fn events(run: &Run) -> impl Iterator<Item = Entry> {
    let log = |at: f64, severity, message: String, kind: &str| {
        let (stamp, kind) = (time(at), kind.to_owned());
        let (name, by) = ("scenario".to_owned(), String::new());
        let log = Log { stamp, severity, name, message, by, kind };
        Entry::message(Topics::EVENTS, stamp, &log)
    };
    let marks = run
        .marks
        .iter()
        .map(move |mark| log(mark.at, Severity::Info, mark.label.clone(), "commanded"));
    let refusals = run
        .refusals
        .iter()
        .map(move |refusal| log(refusal.at, Severity::Warn, refusal.to_string(), "refused"));
    marks.chain(refusals)
}
