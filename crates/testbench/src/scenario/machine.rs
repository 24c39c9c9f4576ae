//! A machine alone on an ideal voltage source.

use motorlink_proto::time::{Duration, Instant};
use motorlink_sim::plant::{Feed, Flow, Machine, PlantConfig};
use motorlink_sim::vector::Vector;
use motorlink_sim::{angle, hash, preset};
use serde::Deserialize;
use toml::Table;

use super::moment::{moment, seconds};
use super::run::Mark;
use super::run::Played;
use crate::config::overlay;
use crate::signals::{MACHINE, Signal};

/// The section `[machine]`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct WrittenMachine {
    preset: String,
    #[serde(default)]
    plant: Table,
    #[serde(default)]
    speed: f32,
    #[serde(default)]
    angle: f32,
    #[serde(default)]
    locked: bool,
}

/// A `[[voltage]]`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct WrittenVoltage {
    at: f64,
    vd: Option<f32>,
    vq: Option<f32>,
    valpha: Option<f32>,
    vbeta: Option<f32>,
}

/// A machine and what it is fed with.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct BareMachine {
    config: PlantConfig,
    /// rad/s.
    speed: f32,
    /// rad.
    angle: f32,
    locked: bool,
    /// In the order of their time.
    voltages: Vec<Voltage>,
}

/// What the source gives from a moment on.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Voltage {
    at: Instant,
    feed: Feed,
    label: String,
}

/// Parts of a plant that a bare machine has.
const PARTS: [&str; 3] = ["period_us", "machine", "load"];

impl WrittenMachine {
    /// Puts it together.
    pub(super) fn resolve(self) -> Result<BareMachine, String> {
        let base = preset::named(&self.preset).ok_or_else(|| {
            let names = preset::ALL.map(|(name, _)| name).join(", ");
            format!("machine: there is no preset `{}`; these are: {names}", self.preset)
        })?;
        if let Some(part) = self.plant.keys().find(|key| !PARTS.contains(&key.as_str())) {
            return Err(format!(
                "machine: a bare machine has no `plant.{part}`, only {}",
                PARTS.map(|part| format!("`plant.{part}`")).join(", ")
            ));
        }
        let config = overlay(base, self.plant, "machine").map_err(|error| error.to_string())?;
        config.check().map_err(|error| format!("machine: {error}"))?;
        for (name, value, most) in [("speed", self.speed, 1e5), ("angle", self.angle, 1e6)] {
            if !(-most..=most).contains(&value) {
                return Err(format!("machine: {name} is -{most} to {most}, not {value}"));
            }
        }
        if self.locked && self.speed != 0.0 {
            return Err("machine: a locked rotor has no speed".to_owned());
        }
        let WrittenMachine { speed, angle, locked, .. } = self;
        Ok(BareMachine { config, speed, angle, locked, voltages: Vec::new() })
    }
}

impl WrittenVoltage {
    /// A voltage of a run that lasts so long.
    pub(super) fn resolve(self, machine: &BareMachine, end: Duration) -> Result<Voltage, String> {
        let (feed, label) = match (self.vd, self.vq, self.valpha, self.vbeta) {
            (Some(d), Some(q), None, None) => {
                (Feed::Rotor(Vector::new(d, q)), format!("vd {d} V, vq {q} V"))
            }
            (None, None, Some(alpha), Some(beta)) => {
                (Feed::Stator(Vector::new(alpha, beta)), format!("vα {alpha} V, vβ {beta} V"))
            }
            _ => return Err("say `vd` and `vq`, or `valpha` and `vbeta`, in V".to_owned()),
        };
        let (Feed::Rotor(Vector { x, y }) | Feed::Stator(Vector { x, y })) = feed;
        let greatest = x.abs().max(y.abs());
        if !greatest.is_finite() || !(x + y).is_finite() || greatest > 1e4 {
            return Err("voltages are -10000 V to 10000 V".to_owned());
        }
        let whole = machine.step();
        let at = moment(self.at, end)?;
        if !at.0.is_multiple_of(whole.0) {
            return Err(format!("at {} s: moments are multiples of {} µs", self.at, whole.0));
        }
        Ok(Voltage { at, feed, label })
    }
}

impl BareMachine {
    /// Feeds it with these voltages, one after the other.
    pub(super) fn fed_with(self, mut voltages: Vec<Voltage>) -> Self {
        voltages.sort_by_key(|voltage| voltage.at);
        BareMachine { voltages, ..self }
    }

    /// Length of a step.
    pub(super) fn step(&self) -> Duration {
        Duration(self.config.period_us.into())
    }

    /// What can be looked at.
    pub(super) fn signals() -> Vec<Signal> {
        MACHINE.iter().map(|row| row.signal("machine")).collect()
    }

    /// Lets it turn.
    pub(super) fn play(&self, duration: Duration, sample: Duration) -> Played {
        let PlantConfig { machine, load, .. } = self.config;
        let step = self.step();
        let mut machine = Machine::new(machine, load, step.0 as f32 * 1e-6);
        machine.place(angle::position(self.angle), self.speed);
        machine.lock(self.locked);
        let mut columns = vec![Vec::new(); MACHINE.len()];
        let mut voltages = self.voltages.iter().peekable();
        let mut feed = Feed::Stator(Vector::ZERO);
        let mut now = Instant(0);
        loop {
            if now.0.is_multiple_of(sample.0) {
                let row = columns.iter_mut().zip(MACHINE);
                row.for_each(|(column, row)| column.push(row.value(&machine)));
            }
            if now.0 >= duration.0 {
                break;
            }
            while let Some(voltage) = voltages.next_if(|voltage| voltage.at <= now) {
                feed = voltage.feed;
            }
            machine.step(feed, &mut Flow::default());
            now += step;
        }
        let mark =
            |voltage: &Voltage| Mark { at: seconds(voltage.at), label: voltage.label.clone() };
        Played {
            columns,
            marks: self.voltages.iter().map(mark).collect(),
            refusals: Vec::new(),
            state_hash: hash::fingerprint(&machine),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use crate::scenario::{Run, Scenario};

    fn parse(text: &str) -> Result<Scenario, String> {
        let text = format!("title = \"\"\nduration = 0.1\nsample_us = 50\n{text}");
        Scenario::parse(&text, Path::new(""))
    }

    fn last(run: &Run, name: &str) -> f64 {
        let place = run.signals.iter().position(|signal| signal.name == name).unwrap();
        *run.columns[place].last().unwrap()
    }

    #[test]
    fn a_locked_machine_takes_the_current_of_its_resistance_in_either_frame() {
        let machine = "[machine]\npreset = \"shinano\"\nlocked = true\nangle = 2.356194490192345\n";
        let rotor = format!("{machine}[[voltage]]\nat = 0\nvd = 0.32\nvq = 0.64");
        let run = parse(&rotor).unwrap().run().unwrap();
        assert!((last(&run, "machine.id_amps") - 1.0).abs() < 1e-4);
        assert!((last(&run, "machine.iq_amps") - 2.0).abs() < 1e-4);
        assert_eq!(last(&run, "machine.speed_radians_per_second"), 0.0);
        let torque = 1.5 * 2.0 * 16.06e-3 * 2.0;
        assert!((last(&run, "machine.torque_newton_metres") - torque).abs() < 1e-5);
        assert!((last(&run, "machine.angle_radians") - 0.75 * std::f64::consts::PI).abs() < 1e-6);
        // The magnet stands a quarter of an electrical turn behind phase A.
        let stator = format!("{machine}[[voltage]]\nat = 0\nvalpha = 0.32\nvbeta = 0.64");
        let run = parse(&stator).unwrap().run().unwrap();
        assert!((last(&run, "machine.id_amps") + 2.0).abs() < 1e-4);
        assert!((last(&run, "machine.iq_amps") - 1.0).abs() < 1e-4);
    }

    #[test]
    fn voltages_hold_until_the_next_and_are_marked() {
        let text = "
            [machine]
            preset = \"mains\"
            plant.machine.inertia = 1e3
            [[voltage]]
            at = 0.05
            vd = 0
            vq = 0
            [[voltage]]
            at = 0
            vd = 0
            vq = 10
        ";
        let run = parse(text).unwrap().run().unwrap();
        let iq = run.signals.iter().position(|signal| signal.name == "machine.iq_amps").unwrap();
        let iq = &run.columns[iq];
        assert_eq!((iq.len(), iq[0]), (2001, 0.0));
        assert!((iq[1000] - 10.0 / 1.86).abs() < 1e-3 && iq[2000].abs() < 1e-3);
        let marks: Vec<&str> = run.marks.iter().map(|mark| &*mark.label).collect();
        assert_eq!(marks, ["vd 0 V, vq 10 V", "vd 0 V, vq 0 V"]);
    }

    #[test]
    fn what_no_machine_can_be_is_refused() {
        let why = |text: &str| parse(text).unwrap_err();
        assert!(why("[machine]\npreset = \"big\"").contains("shinano"));
        let machine = |text: &str| why(&format!("[machine]\npreset = \"mains\"\n{text}"));
        assert!(machine("plant.supply.voltage = 3").contains("no `plant.supply`"));
        assert!(machine("plant.machine.inertia = 0").contains("plant.machine.inertia"));
        assert!(machine("plant.machine.inerta = 1").contains("inerta"));
        assert!(machine("plant.period_us = 125").contains("sample_us is a multiple of the step"));
        assert!(machine("speed = nan").contains("speed"));
        assert!(machine("speed = 1\nlocked = true").contains("locked"));
        assert!(machine("[[st.motor]]").contains("no [[st.motor]]"));
        assert!(machine("[[event]]").contains("no [[event]]"));
        assert!(machine("[[voltage]]\nat = 0\nvd = 1").contains("voltage 1: say `vd` and `vq`"));
        let voltage = |text: &str| machine(&format!("[[voltage]]\n{text}"));
        assert!(voltage("at = 0\nvd = nan\nvq = 0").contains("voltages are"));
        assert!(voltage("at = 0.2\nvd = 0\nvq = 0").contains("lasts from 0 to 0.1 s"));
        assert!(voltage("at = 0.00001\nvd = 0\nvq = 0").contains("multiples of 50 µs"));
        assert!(why("[[rmd.motor]]\n[[voltage]]\nat = 0").contains("bare [machine]"));
    }
}
