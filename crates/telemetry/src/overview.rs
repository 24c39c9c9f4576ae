//! The most important signals of a motor, and texts of its state and faults.

use motorlink_proto::rmd::Errors;
use motorlink_proto::st::{Flags, RegisterId, Status};
use serde::Serialize;

use crate::sample::Sample;
use crate::signal::{Motor, Quantity, Source};

/// The signals that say most about a motor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct Overview {
    /// The state of an ST motor. RMD motors report none.
    #[cfg_attr(feature = "typescript", ts(type = "string | null"))]
    pub state: Option<Source>,
    /// The faults.
    #[cfg_attr(feature = "typescript", ts(type = "string"))]
    pub faults: Source,
    /// The speed.
    #[cfg_attr(feature = "typescript", ts(type = "string"))]
    pub speed: Source,
    /// The current that makes torque.
    #[cfg_attr(feature = "typescript", ts(type = "string"))]
    pub current: Source,
    /// The temperature of the power stage or of the motor.
    #[cfg_attr(feature = "typescript", ts(type = "string"))]
    pub temperature: Source,
    /// The supply.
    #[cfg_attr(feature = "typescript", ts(type = "string"))]
    pub voltage: Source,
    /// The angle over all turns of an RMD motor.
    #[cfg_attr(feature = "typescript", ts(type = "string | null"))]
    pub angle: Option<Source>,
}

impl Overview {
    /// Those of a motor of this kind.
    pub fn of(motor: Motor) -> Self {
        let register = Source::Register;
        match motor {
            Motor::St(_) => Overview {
                state: Some(register(RegisterId::STATUS)),
                faults: register(RegisterId::FLAGS),
                speed: register(RegisterId::SPEED_MEAS),
                current: register(RegisterId::TORQUE_MEAS),
                temperature: register(RegisterId::HEATS_TEMP),
                voltage: register(RegisterId::BUS_VOLTAGE),
                angle: None,
            },
            Motor::Rmd(_) => Overview {
                state: None,
                faults: quantity("errors"),
                speed: quantity("speed_dps"),
                current: quantity("iq_amps"),
                temperature: quantity("temperature_celsius"),
                voltage: quantity("voltage_volts"),
                angle: Some(quantity("multi_turn_angle_degrees")),
            },
        }
    }

    /// Signals that change within milliseconds.
    pub fn fast(&self) -> impl Iterator<Item = Source> {
        [Some(self.speed), Some(self.current), self.state, Some(self.faults)].into_iter().flatten()
    }

    /// Signals that change within seconds.
    pub fn slow(&self) -> [Source; 2] {
        [self.temperature, self.voltage]
    }
}

fn quantity(name: &str) -> Source {
    Source::Quantity(Quantity::named(name).expect("replies of RMD motors have it"))
}

/// The state in one or two words. That of an RMD motor is derived from its speed and errors.
pub fn state(main: &Overview, value: impl Fn(Source) -> Option<Sample>) -> Option<String> {
    if let Some(source) = main.state {
        return value(source).map(|sample| Status::from(sample.digits as u8).to_string());
    }
    let (errors, speed) = (value(main.faults), value(main.speed)?);
    Some(match errors.is_some_and(|errors| errors.digits != 0) {
        true => "ERROR".to_owned(),
        false if speed.value != 0.0 => "turning".to_owned(),
        false => "at rest".to_owned(),
    })
}

/// The names and descriptions of faults; `None`: no fault.
pub fn faults(motor: Motor, sample: Sample) -> Option<String> {
    match motor {
        Motor::Rmd(_) => {
            let errors = Errors(sample.digits as u8);
            (!errors.is_empty()).then(|| errors.to_string())
        }
        Motor::St(_) => {
            let flags = Flags(sample.digits as u32);
            let words = |half: u16| {
                let set = Flags::NAMES.iter().filter(move |(bit, ..)| half & bit != 0);
                set.map(|(_, name, doc)| format!("{name} ({doc})")).collect::<Vec<_>>().join(", ")
            };
            match (flags.present(), flags.occurred()) {
                (0, 0) => None,
                (0, occurred) => Some(format!("over, not acknowledged: {}", words(occurred))),
                (present, _) => Some(format!("present: {}", words(present))),
            }
        }
    }
}

/// Whether the cause of a fault is present. RMD motors report present faults only.
pub fn is_present(motor: Motor, faults: Option<Sample>) -> bool {
    faults.is_some_and(|sample| match motor {
        Motor::Rmd(_) => !Errors(sample.digits as u8).is_empty(),
        Motor::St(_) => Flags(sample.digits as u32).present() != 0,
    })
}
