//! A machine on an ideal voltage source, without a drive. tests/e2e/test_reference.py compares it
//! with an independent solution of its equations. Reads an experiment as JSON, prints CSV.

use std::io::{self, Write};

use motorlink_sim::angle;
use motorlink_sim::plant::{Feed, Flow, LoadConfig, Machine, MachineConfig};
use motorlink_sim::vector::Vector;
use serde::Deserialize;

/// Length of a step, s.
const PERIOD: f64 = 50e-6;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Experiment {
    machine: MachineConfig,
    load: LoadConfig,
    /// Vd and Vq, V.
    voltage: [f32; 2],
    /// Speed at the start, rad/s.
    speed: f32,
    /// Angle at the start, rad.
    angle: f32,
    locked: bool,
    steps: u32,
}

fn main() -> io::Result<()> {
    let experiment: Experiment = serde_json::from_reader(io::stdin())?;
    let mut machine = Machine::new(experiment.machine, experiment.load, PERIOD as f32);
    machine.place(angle::position(experiment.angle), experiment.speed);
    machine.lock(experiment.locked);
    let [vd, vq] = experiment.voltage;
    let mut out = io::BufWriter::new(io::stdout().lock());
    writeln!(out, "time,id,iq,speed,angle")?;
    for step in 0..=experiment.steps {
        let (time, current) = (f64::from(step) * PERIOD, machine.rotor_current());
        let angle = machine.position() as f64 * (core::f64::consts::TAU / angle::TURN as f64);
        writeln!(out, "{time},{},{},{},{angle}", current.x, current.y, machine.speed())?;
        machine.step(Feed::Rotor(Vector::new(vd, vq)), &mut Flow::default());
    }
    out.flush()
}
