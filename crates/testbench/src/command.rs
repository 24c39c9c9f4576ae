//! Commands to a bench: one JSON object per line, answered with one (docs/SIMULATOR.md).

use serde::Deserialize;

/// A command to a bench.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(tag = "command", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Command {
    /// Switches the power of a drive off and on.
    PowerCycle {
        /// The served port; optional if there is only one.
        port: Option<String>,
        /// The RMD motor; without it, all motors of the bus. An ST drive has one supply.
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
    /// Overrides the measured temperature of a motor; without a value, ends that.
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
    /// Sets an external torque at the output.
    Push {
        /// The served port.
        port: Option<String>,
        /// The motor.
        motor: u8,
        /// Nm; a negative one turns backwards.
        newton_metres: f32,
    },
    /// Locks or releases the rotor.
    LockRotor {
        /// The served port.
        port: Option<String>,
        /// The motor.
        motor: u8,
        /// Whether it is locked.
        locked: bool,
    },
    /// Triggers a fault: once, or present until the command is sent with `hold` false.
    Fault {
        /// The served port.
        port: Option<String>,
        /// The motor.
        motor: u8,
        /// ST: a name such as `BREAK_IN`. RMD: `LOW_VOLTAGE` or `OVER_TEMPERATURE`.
        fault: String,
        /// True: the fault stays present. False: it ends. Absent: it happens once.
        hold: Option<bool>,
    },
    /// Stops the time of all drives. They still answer.
    Pause {},
    /// Continues after [`Pause`](Self::Pause).
    Resume {},
    /// Reads the true state of every motor.
    State {
        /// The served port; without it, all ports.
        port: Option<String>,
    },
}

impl Command {
    /// Reads a command from JSON.
    ///
    /// # Errors
    /// The text is not a command.
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

    /// Checks the ranges of its values.
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
