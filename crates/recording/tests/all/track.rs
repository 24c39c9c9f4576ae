//! Simulated drives on virtual time, recorded without a thread.

use std::collections::BTreeMap;
use std::f64::consts::PI;

use motorlink_proto::rmd::{MotorId, SetSpeed};
use motorlink_proto::st::Profile;
use motorlink_proto::time::{Instant, Micros};
use motorlink_proto::units::CentiDps;
use motorlink_recording::record::choice::choose;
use motorlink_recording::record::frames::Taps;
use motorlink_recording::record::track::{Line, Track};
use motorlink_recording::record::wall::Anchor;
use motorlink_recording::record::{Topics, track::Counts};
use motorlink_recording::schema::{
    DiagnosticArray, Direction, Frame, FrameResult, JointState, Level, Log, Message, SignalsType,
    Time,
};
use motorlink_recording::write::Entry;
use motorlink_telemetry::line::Request;
use motorlink_telemetry::share::drive_protocol::DriveProtocol;
use motorlink_telemetry::signal::Motor;
use motorlink_testbench::Bench;

use crate::engine::{Engine, Polled, SECOND, bench, rmd, spec, st, st_options};

const CENTISECOND: Micros = Micros(10_000);
const MILLISECOND: Micros = Micros(1_000);

/// A recording of a line in memory.
struct Recording {
    engine: Engine,
    track: Track,
    topics: Topics,
    entries: Vec<Entry>,
}

/// What was recorded, by topic.
struct Recorded {
    messages: BTreeMap<String, Vec<Vec<u8>>>,
    types: BTreeMap<String, SignalsType>,
    counts: Counts,
}

impl Recording {
    fn st(bench: &Bench, faults: &str) -> Self {
        let taps = Taps::anchored(Anchor::new(Instant(0), Time(0)));
        let link = taps.around_line(Box::new(Polled(bench.bytes(&spec(faults)))));
        let engine = Engine::st(link, st_options(bench.profile()));
        Self::new(engine, taps, DriveProtocol::St(Profile::Spec), st(1))
    }

    fn rmd(bench: &Bench, faults: &str) -> Self {
        let taps = Taps::anchored(Anchor::new(Instant(0), Time(0)));
        let link = taps.around_bus(Box::new(Polled(bench.can(&spec(faults)))));
        Self::new(Engine::rmd(link), taps, DriveProtocol::Rmd, rmd(1))
    }

    fn new(mut engine: Engine, taps: Taps, speaks: DriveProtocol, motor: Motor) -> Self {
        let line = Line {
            label: "line".to_owned(),
            port: "virtual".to_owned(),
            speaks,
            motors: vec![motor],
            full_scale: None,
        };
        let mut topics = Topics::default();
        let groups = choose(&[motor], &[], CENTISECOND);
        let anchor = Anchor::new(Instant(0), Time(0));
        let track = Track::new(line, groups, anchor, taps, &mut topics);
        for (subscription, wants) in track.subscriptions() {
            engine.acquisition.subscribe(subscription.clone(), wants.clone());
        }
        Recording { engine, track, topics, entries: Vec::new() }
    }

    fn run(&mut self, span: Micros) {
        let end = self.engine.clock.now() + span;
        while self.engine.clock.now() < end {
            self.engine.run(Micros(20 * MILLISECOND.0));
            let now = Time(self.engine.clock.now().0 * 1000);
            self.track.take(now, &mut |entry| self.entries.push(entry));
        }
    }

    /// The messages of each topic.
    fn messages(mut self) -> Recorded {
        let now = Time(self.engine.clock.now().0 * 1000);
        self.track.end(now, &mut |entry| self.entries.push(entry));
        let (mut names, mut types) = (Vec::new(), BTreeMap::new());
        for entry in self.topics.take() {
            let Entry::Topic(topic) = entry else { panic!("{entry:?}") };
            if let Some(ty) = SignalsType::parse(&topic.ty, &topic.definition) {
                types.insert(topic.name.clone(), ty);
            }
            names.push(topic.name);
        }
        let mut messages: BTreeMap<String, Vec<Vec<u8>>> = BTreeMap::new();
        for entry in self.entries {
            let Entry::Message { topic, data, .. } = entry else { panic!("{entry:?}") };
            messages.entry(names[topic].clone()).or_default().push(data);
        }
        Recorded { messages, types, counts: self.track.counts() }
    }
}

fn decoded<M: Message>(messages: &[Vec<u8>]) -> Vec<M> {
    messages.iter().map(|data| M::decode(data).unwrap()).collect()
}

#[test]
fn every_instant_of_a_good_line_is_recorded() {
    let mut recording = Recording::st(&bench(), "");
    recording.run(Micros(3 * SECOND.0));
    let Recorded { messages, types, counts } = recording.messages();
    let ty = &types["/line/motor1/signals"];
    let rows: Vec<_> =
        messages["/line/motor1/signals"].iter().map(|data| ty.decode(data).unwrap()).collect();
    // The last ones wait for their confirmation.
    assert!((288..=301).contains(&rows.len()), "{} rows", rows.len());
    for pair in rows.windows(2) {
        let gap = pair[1].stamp.0 - pair[0].stamp.0;
        assert!((5_000_000..15_000_000).contains(&gap), "{gap} ns");
    }
    let slow = &messages["/line/motor1/signals_2_hz"];
    assert!((5..=7).contains(&slow.len()), "{} slow rows", slow.len());
    assert_eq!(messages["/joint_states"].len(), rows.len());
    let diagnostics: Vec<DiagnosticArray> = decoded(&messages["/diagnostics"]);
    assert!((3..=6).contains(&diagnostics.len()), "{diagnostics:?}");
    let last = &diagnostics.last().unwrap().status[0];
    assert_eq!((last.level, &*last.message), (Level::Ok, "IDLE"));
    assert_eq!((counts.lost, counts.unconfirmed), (0, 0));
}

#[test]
fn each_request_and_each_reply_is_a_frame() {
    let mut recording = Recording::st(&bench(), "");
    recording.run(SECOND);
    let Recorded { messages, counts, .. } = recording.messages();
    let frames: Vec<Frame> = decoded(&messages["/line/frames"]);
    assert!(frames.iter().all(|frame| frame.result == FrameResult::Frame));
    let sent = frames.iter().filter(|frame| frame.direction == Direction::Sent).count();
    assert!(sent >= 100 && frames.len() - sent >= sent - 1, "{sent} of {}", frames.len());
    assert_eq!(counts.frames, frames.len() as u64);
    assert!(frames.is_sorted_by_key(|frame| frame.stamp));
}

#[test]
fn joint_states_are_the_simulator_s_truth() {
    let bench = bench();
    let mut recording = Recording::rmd(&bench, "");
    let id = MotorId::new(1).unwrap();
    let turn = Request::rmd(id, &SetSpeed { speed: CentiDps::from_dps(360.0) });
    let by = "test".into();
    recording.engine.acquisition.command(&by, turn, SECOND).unwrap();
    let truth = bench.record(&["rmd1.angle_degrees", "rmd1.speed_dps"], MILLISECOND).unwrap();
    recording.run(Micros(3 * SECOND.0));
    let truth = truth.take();
    let messages = recording.messages().messages;
    let joints: Vec<JointState> = decoded(&messages["/joint_states"]);
    assert!(joints.len() > 280, "{}", joints.len());
    for joint in joints {
        let at = (joint.stamp.0 / 1_000_000) as usize;
        let [angle, speed] = [truth[2 * at], truth[2 * at + 1]].map(|degrees| degrees * PI / 180.0);
        // It turns by 0.4° in a millisecond.
        let apart = (joint.position[0] - angle + PI).rem_euclid(2.0 * PI) - PI;
        assert!(apart.abs() < 0.02, "{joint:?}: {angle} rad");
        // The drive averages its speed, which changes in the first moments.
        let is_steady = joint.stamp > Time(1_000_000_000);
        let tolerance = if is_steady { 0.5 } else { 5.0 };
        assert!((joint.velocity[0] - speed).abs() < tolerance, "{joint:?}: {speed} rad/s");
    }
    let events: Vec<Log> = decoded(&messages["/events"]);
    let commanded = events.iter().find(|log| log.kind == "commanded").unwrap();
    assert_eq!((&*commanded.name, &*commanded.by), ("line/motor1", "test"));
}

#[test]
fn damage_is_kept_as_bytes_and_wrong_values_are_not() {
    let mut recording = Recording::st(&bench(), "flip=1e-3,seed=7");
    recording.run(Micros(10 * SECOND.0));
    let Recorded { messages, types, counts } = recording.messages();
    let frames: Vec<Frame> = decoded(&messages["/line/frames"]);
    let damaged = frames.iter().filter(|frame| frame.result == FrameResult::Damaged).count();
    assert!(damaged > 3, "{damaged} of {}", frames.len());
    let ty = &types["/line/motor1/signals"];
    for data in &messages["/line/motor1/signals"] {
        let row = ty.decode(data).unwrap();
        // The motor is at rest all the time.
        assert_eq!(row.values, [0.0; 5]);
    }
    assert_eq!(counts.lost, 0);
}

#[test]
fn the_same_run_has_the_same_messages() {
    let run = || {
        let mut recording = Recording::rmd(&bench(), "drop=1e-3,seed=3");
        recording.run(Micros(2 * SECOND.0));
        recording.messages().messages
    };
    assert_eq!(run(), run());
}
