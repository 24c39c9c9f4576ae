//! What signals of recordings look like in pictures.

use motorlink::st::{ControlMode, Flags, RegisterId, Status};
use motorlink_testbench::scenario::{Kind, Names};

use crate::palette::Meaning;
use crate::plot::{States, state};

/// The first part of a signal's name that is found says its meaning.
const PARTS: &[(&str, Meaning)] = &[
    ("_ref", Meaning::Reference),
    ("target", Meaning::Reference),
    ("ramp_final", Meaning::Reference),
    ("temp", Meaning::Temperature),
    ("speed", Meaning::Speed),
    ("phase_a", Meaning::PhaseA),
    ("phase_b", Meaning::PhaseB),
    ("phase_c", Meaning::PhaseC),
    ("angle", Meaning::Position),
    ("position", Meaning::Position),
    ("encoder", Meaning::Position),
    ("i_q", Meaning::QAxis),
    ("v_q", Meaning::QAxis),
    ("torque", Meaning::QAxis),
    ("current", Meaning::QAxis),
    ("i_d", Meaning::DAxis),
    ("v_d", Meaning::DAxis),
    ("flux_", Meaning::DAxis),
    ("i_a", Meaning::PhaseA),
    ("i_b", Meaning::PhaseB),
    ("volt", Meaning::Supply),
    ("bus", Meaning::Supply),
    ("power", Meaning::Supply),
];

/// What the line of a signal means.
pub fn meaning(signal: &str) -> Meaning {
    let name = signal.to_lowercase();
    let known = PARTS.iter().find(|(part, _)| name.contains(part));
    known.map_or(Meaning::Text, |(_, meaning)| *meaning)
}

/// What is measured in a unit.
pub fn quantity(unit: &str) -> Option<&'static str> {
    Some(match unit {
        "rpm" | "°/s" | "0.1 Hz" => "Speed",
        "V" | "s16V" => "Voltage",
        "A" | "s16A" => "Current",
        "°C" => "Temperature",
        "W" => "Power",
        "°" | "rad" => "Angle",
        "°/s²" => "Acceleration",
        "Nm" => "Torque",
        _ => return None,
    })
}

/// Names of the values of a signal, if they have names.
pub fn states(signal: &str) -> Option<States<'static>> {
    let kind = |names| Kind::Named(names);
    let is = |register: RegisterId| signal == register.to_string();
    if is(RegisterId::STATUS) {
        return Some(Box::new(move |value| {
            let name = Status::from(value as u8).to_string();
            let meaning = state(kind(Names::Status), &name);
            (name, meaning)
        }));
    }
    if is(RegisterId::CONTROL_MODE) {
        return Some(Box::new(|value| {
            let name = ControlMode::from(value as u8).to_string();
            let is_speed = name.to_lowercase().contains("speed");
            (name, if is_speed { Meaning::Speed } else { Meaning::Torque })
        }));
    }
    if is(RegisterId::FLAGS) {
        return Some(Box::new(move |value| {
            let flags = Flags(value as u32);
            let faults = flags.occurred() | flags.present();
            let names: Vec<&str> = Flags::names(faults).collect();
            let name = if names.is_empty() { "none".to_owned() } else { names.join(" ") };
            let meaning = state(kind(Names::Faults), &name);
            (name, meaning)
        }));
    }
    (signal == "errors").then(|| {
        Box::new(move |value: f64| {
            let name = Names::Errors.name(value as u8);
            let meaning = state(kind(Names::Errors), &name);
            (name, meaning)
        }) as States<'static>
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signals_have_the_colour_of_their_quantity() {
        for (signal, expected) in [
            ("SPEED_MEAS", Meaning::Speed),
            ("speed_dps", Meaning::Speed),
            ("SPEED_REF", Meaning::Reference),
            ("I_Q_REF", Meaning::Reference),
            ("I_Q", Meaning::QAxis),
            ("FLUX_MEAS", Meaning::DAxis),
            ("HEATS_TEMP", Meaning::Temperature),
            ("BUS_VOLTAGE", Meaning::Supply),
            ("multi_turn_angle", Meaning::Position),
            ("SC_STEPS", Meaning::Text),
        ] {
            assert_eq!(meaning(signal), expected, "{signal}");
        }
    }

    #[test]
    fn values_with_names_are_states() {
        let name = |signal: &str, value| states(signal).unwrap()(value);
        assert_eq!(name("STATUS", 6.0), ("RUN".to_owned(), Meaning::Running));
        assert_eq!(name("FLAGS", 0.0), ("none".to_owned(), Meaning::Rest));
        assert_eq!(name("FLAGS", f64::from(2 << 16)), ("OVER_VOLT".to_owned(), Meaning::Fault));
        assert_eq!(name("errors", 1.0).1, Meaning::Fault);
        assert_eq!(name("CONTROL_MODE", 1.0).1, Meaning::Speed);
        assert!(states("SPEED_MEAS").is_none());
    }
}
