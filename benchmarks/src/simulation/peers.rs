//! The other simulators: Python packages, measured by bench/peers.py in its own process.

use std::io::{BufRead, BufReader, Lines, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use motorlink_kernels::drives::{self, ENCODER, PLANT, Rig, SENSORLESS};
use motorlink_kernels::result::Result;
use motorlink_sim::plant::PlantConfig;
use serde_json::{Value, json};

const GEM: &str = "gym-electric-motor";
const MOTULATOR: &str = "motulator";
pub(super) const PACKAGES: [&str; 2] = [GEM, MOTULATOR];

/// A model of another simulator.
pub(super) struct Peer {
    pub(super) package: &'static str,
    /// Its description.
    pub(super) what: &'static str,
    /// Its name in bench/peers.py.
    model: &'static str,
    /// Steps in a turn, a good quarter of a second.
    steps: u32,
    /// Our drive that is most similar.
    pub(super) ours: Rig,
}

impl Peer {
    const fn new(
        package: &'static str,
        what: &'static str,
        model: &'static str,
        steps: u32,
        ours: Rig,
    ) -> Self {
        Peer { package, what, model, steps, ours }
    }
}

pub(super) const PEERS: [Peer; 8] = [
    Peer::new(GEM, "physical system, Euler", "gem plant", 8_000, PLANT),
    Peer::new(GEM, "current control, Euler", "gem control", 6_000, ENCODER),
    Peer::new(MOTULATOR, "plant, RK23", "motulator plant rk23", 2_000, PLANT),
    Peer::new(MOTULATOR, "plant, midpoint", "motulator plant midpoint", 8_000, PLANT),
    Peer::new(MOTULATOR, "encoder, RK23", "motulator encoder rk23", 1_000, ENCODER),
    Peer::new(MOTULATOR, "encoder, midpoint", "motulator encoder midpoint", 2_000, ENCODER),
    Peer::new(MOTULATOR, "sensorless, RK23", "motulator sensorless rk23", 1_000, SENSORLESS),
    Peer::new(
        MOTULATOR,
        "sensorless, midpoint",
        "motulator sensorless midpoint",
        2_000,
        SENSORLESS,
    ),
];

/// The motor as an argument of bench/peers.py.
fn machine() -> Value {
    let PlantConfig { machine, supply, .. } = drives::motor();
    json!({
        "pole_pairs": machine.pole_pairs,
        "resistance_ohm": machine.resistance,
        "ld_henry": machine.inductance_d,
        "lq_henry": machine.inductance_q,
        "flux_weber": machine.flux_linkage,
        "inertia_kg_m2": machine.inertia,
        "bus_volts": supply.voltage,
        "speed_rad_s": drives::SPEED,
        "iq_amps": drives::IQ,
    })
}

/// The process that runs the packages.
pub(super) struct Peers {
    child: Child,
    orders: ChildStdin,
    answers: Lines<BufReader<ChildStdout>>,
    versions: Value,
}

impl Peers {
    /// `None` with a warning if `make bench` could not install the packages.
    pub(super) fn start() -> Result<Option<Self>> {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
        let python = folder.join("../.venv-bench/bin/python");
        if !folder.join("../.venv-bench/ready").exists() {
            eprintln!(
                "WARNING: {} ARE NOT MEASURED: `make bench` did not get them into .venv-bench",
                PACKAGES.join(" and ").to_uppercase()
            );
            return Ok(None);
        }
        let mut child = Command::new(python)
            .arg(folder.join("peers.py"))
            .arg(machine().to_string())
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()?;
        let (orders, answers) = (child.stdin.take(), child.stdout.take());
        let (Some(orders), Some(answers)) = (orders, answers) else {
            return Err("the pipes to bench/peers.py are missing".into());
        };
        let answers = BufReader::new(answers).lines();
        let mut peers = Peers { child, orders, answers, versions: Value::Null };
        peers.versions = peers.answer()?;
        Ok(Some(peers))
    }

    /// The names and versions of the packages.
    pub(super) fn versions(&self) -> String {
        let versions = self.versions.as_object().into_iter().flatten();
        let named =
            versions.map(|(name, version)| format!("{name} {}", version.as_str().unwrap_or("?")));
        named.collect::<Vec<_>>().join(", ")
    }

    /// Steps per second of this peer.
    pub(super) fn rate(&mut self, peer: &Peer) -> Result<f64> {
        writeln!(self.orders, "{} {}", peer.model, peer.steps)?;
        let answer = self.answer()?;
        let figure = |name: &str| answer[name].as_f64().ok_or("bench/peers.py left out a figure");
        let speed = figure("speed_rad_s")?;
        if (speed / f64::from(drives::SPEED) - 1.0).abs() > 0.1 {
            return Err(format!("{} turns at {speed} rad/s", peer.model).into());
        }
        Ok(figure("steps")? / figure("seconds")?)
    }

    fn answer(&mut self) -> Result<Value> {
        let line = self.answers.next().ok_or("bench/peers.py ended: its error is above")??;
        Ok(serde_json::from_str(&line)?)
    }
}

impl Drop for Peers {
    fn drop(&mut self) {
        // It may have ended already.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
