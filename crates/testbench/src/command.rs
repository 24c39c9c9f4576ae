//! What can be done to a bench: a JSON object a line, answered with one (docs/SIMULATOR.md).

use serde::Deserialize;

/// A command to a bench.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(tag = "command", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Command {
    /// Takes the power of a drive away and gives it back.
    PowerCycle {
        /// The served port; where there is one, it need not be named.
        port: Option<String>,
        /// The RMD motor; all of the bus without it. An ST drive has one supply.
        motor: Option<u8>,
    },
    /// Sets the supply: an ST motor's bus voltage or an RMD motor's supply.
    Supply {
        /// The served port.
        port: Option<String>,
        /// The motor.
        motor: u8,
        /// V.
        volts: f32,
    },
    /// Makes a motor show a temperature; without one, its own again.
    Temperature {
        /// The served port.
        port: Option<String>,
        /// The motor.
        motor: u8,
        /// °C.
        celsius: Option<f32>,
    },
    /// Sets the braking torque of the load.
    Load {
        /// The served port.
        port: Option<String>,
        /// The motor.
        motor: u8,
        /// Nm.
        newton_metres: f32,
    },
    /// Sets the torque with which something turns the output.
    Push {
        /// The served port.
        port: Option<String>,
        /// The motor.
        motor: u8,
        /// Nm; negative backwards.
        newton_metres: f32,
    },
    /// Holds the rotor, or lets it go.
    LockRotor {
        /// The served port.
        port: Option<String>,
        /// The motor.
        motor: u8,
        /// Whether it is held.
        locked: bool,
    },
    /// Lets a fault happen: once, or kept present until it is sent with `hold` false.
    Fault {
        /// The served port.
        port: Option<String>,
        /// The motor.
        motor: u8,
        /// ST: a name such as `BREAK_IN`. RMD: `LOW_VOLTAGE` or `OVER_TEMPERATURE`.
        fault: String,
        /// True keeps it present, false lets it go; without it the fault happens once.
        hold: Option<bool>,
    },
    /// Lets the time of all drives stand still; they answer meanwhile.
    Pause {},
    /// Lets it go on.
    Resume {},
    /// Tells what is really going on in every motor.
    State {
        /// The served port; all of them without it.
        port: Option<String>,
    },
}

impl Command {
    /// Reads a command that is written as JSON.
    ///
    /// # Errors
    /// Why it is none.
    pub fn read(text: &str) -> Result<Self, String> {
        serde_json::from_str(text).map_err(|error| format!("not a command: {error}"))
    }

    /// The served port that the command names.
    pub fn port(&self) -> Option<&str> {
        match self {
            Command::PowerCycle { port, .. }
            | Command::Supply { port, .. }
            | Command::Temperature { port, .. }
            | Command::Load { port, .. }
            | Command::Push { port, .. }
            | Command::LockRotor { port, .. }
            | Command::Fault { port, .. }
            | Command::State { port } => port.as_deref(),
            Command::Pause {} | Command::Resume {} => None,
        }
    }

    /// Whether its values can be.
    pub(super) fn check(&self) -> Result<(), String> {
        let (name, value, range) = match *self {
            Command::Supply { volts, .. } => ("volts", volts, 0.0..=1000.0),
            Command::Temperature { celsius: Some(celsius), .. } => {
                ("celsius", celsius, -100.0..=1000.0)
            }
            Command::Load { newton_metres, .. } => ("newton_metres", newton_metres, 0.0..=1000.0),
            Command::Push { newton_metres, .. } => ("newton_metres", newton_metres, -1e3..=1e3),
            _ => return Ok(()),
        };
        if range.contains(&value) {
            return Ok(());
        }
        Err(format!("{name} is {} to {}, not {value}", range.start(), range.end()))
    }
}
