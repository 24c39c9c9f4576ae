//! What `motorlink st` takes.

use std::time::Duration;

use clap::Subcommand;
use motorlink::st::{self, FullScale, MotorNumber, Profile};

use super::registers::Filter;
use crate::angle::{parse_angle, parse_tolerance};
use crate::connection::Connection;
use crate::pasteable::{self, number_options, port_option, unless_default};
use crate::repeat::Repeat;
use crate::settings::{DumpArgs, FileArg, RestoreArgs};
use crate::span::{parse_distance, parse_duration, parse_milliseconds, parse_span, span_up_to};
use crate::{help, hint};

#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    pub connection: Connection,
    #[command(flatten)]
    pub drive: DriveArgs,
    #[command(subcommand)]
    pub command: Command,
}

/// Which drive, and how to speak to it.
#[derive(clap::Args)]
#[command(next_help_heading = help::GLOBAL)]
pub struct DriveArgs {
    /// The motor, 1 to 7
    #[arg(short, long, default_value = "1", global = true, value_parser = hint::motor(),
          hide_possible_values = true)]
    pub motor: MotorNumber,
    /// Protocol variant: spec is the document, mcsdk-5.4 is shipped firmware
    #[arg(long, env = "MOTORLINK_PROFILE", default_value = "spec", global = true,
          value_parser = hint::profile())]
    pub profile: Profile,
    /// How long to wait for a reply, 1ms to 60s [default: 1s, in a scan 200ms]
    #[arg(long, global = true, value_name = "TIME",
          value_parser = span_up_to(Duration::from_secs(60)))]
    pub timeout: Option<Duration>,
    /// Refuse commands for more speed than this, rpm, rounded down; `start` needs --ramp
    ///
    /// The limit applies to ramps, rev-up phases, RAMP_FINAL_SPEED and `raw`. `position` has no speed
    /// and is refused. The limit does not apply to torque commands, to the drive's own rev-up and
    /// alignment, and to a motor that already turns. Nothing is sent if a command exceeds the limit.
    #[arg(long, global = true, value_name = "RPM", value_parser = parse_distance)]
    pub speed_limit: Option<f64>,
    /// Take and show currents in A: the full scale of the drive's current measurement, A
    ///
    /// The full scale is the current of digit 32767. It is in the manual of the board. A wrong full scale
    /// gives wrong currents. Without it currents are digits (s16A). It applies to `get`, `segment`,
    /// `status`, `set`, `current-reference`, `torque-ramp`, `revup-data` and --current-limit. It does not
    /// apply to gains, `raw` and --trace. Requested currents are rounded towards 0 to a digit.
    #[arg(long, global = true, value_name = "AMPS", allow_negative_numbers = true,
          value_parser = hint::full_scale())]
    pub full_scale: Option<FullScale>,
    /// Refuse commands for more current than this, s16A digits (A with --full-scale), rounded down
    ///
    /// The limit applies to Iq and Id in `current-reference`, `torque-ramp`, `revup-data`, `set` and
    /// `raw`. Nothing is sent if a command exceeds it.
    #[arg(long, global = true, value_name = "CURRENT", value_parser = parse_distance)]
    pub current_limit: Option<f64>,
    /// After an error, send 132 padding bytes before the next request
    ///
    /// Use it if a drive of MCSDK 5.x stays silent after a damaged or cut-off frame: it waits for the rest
    /// of the frame, without a timeout. The bytes complete the frame. `stop` always sends them on a lost
    /// line.
    #[arg(long, global = true)]
    pub pad: bool,
}

impl DriveArgs {
    /// Commands in messages repeat these options.
    pub fn repeat_in_hints(&self, port: &str) {
        let profile = Profile::default().name();
        let mut of_motor =
            unless_default("--profile", self.profile.name(), "MOTORLINK_PROFILE", profile);
        of_motor.extend(number_options([
            ("--full-scale", self.full_scale.map(FullScale::amps)),
            ("--speed-limit", self.speed_limit),
            ("--current-limit", self.current_limit),
        ]));
        pasteable::set_options(pasteable::Options {
            protocol: "st",
            of_port: port_option(port),
            of_motor,
            number: "--motor",
            default_motor: 1,
            motor: Some(self.motor.number()),
        });
    }
}

#[derive(Subcommand)]
pub enum Command {
    #[command(flatten)]
    Read(Read),
    #[command(flatten)]
    Act(Act),
}

/// Commands that change nothing.
#[derive(Subcommand)]
pub enum Read {
    /// Show the name and version of the SDK and the firmware
    Info,
    /// Show state, faults, speed, current, voltage and temperature
    Status {
        #[command(flatten)]
        repeat: Repeat,
    },
    /// List the registers: id, name, type, access, unit, meaning
    Registers {
        #[command(flatten)]
        filter: Filter,
    },
    /// Read registers
    Get {
        /// Names or numbers (0x1E)
        #[arg(required = true, value_name = "REGISTER", value_parser = hint::register(),
              hide_possible_values = true)]
        registers: Vec<String>,
        #[command(flatten)]
        repeat: Repeat,
    },
    /// Read registers at one instant, in one exchange; profile spec only
    Segment {
        /// The segment of the drive to use, 0 to 3. With --every no other one is used
        #[arg(long, default_value_t = 0, value_parser = clap::value_parser!(u8).range(0..=3))]
        segment: u8,
        /// Names or numbers, at most 32; also registers of access D
        #[arg(required = true, value_name = "REGISTER", value_parser = hint::register(),
              hide_possible_values = true)]
        registers: Vec<String>,
        #[command(flatten)]
        repeat: Repeat,
    },
    /// Write the settings of the motor as text: gains, divisors, rev-up
    ///
    /// The text is TOML: names, values and units in a fixed order, for version control. References, modes
    /// and what moves a motor are not settings.
    Dump(DumpArgs),
    /// Show which settings of the motor differ from a file (exit code 1 if some differ)
    ///
    /// The exit code is 0 if all settings of the file are those of the motor, and 1 if some differ. If
    /// the drive refuses to read one, it is 1, too: the error then has the name of the drive's answer.
    Diff(FileArg),
    /// Try the usual baud rates, and show for each whether a drive answers
    Scan {
        /// Rates to try instead of the usual ones
        #[arg(value_name = "RATE")]
        rates: Vec<u32>,
    },
}

/// Commands that change something, and any frame.
#[derive(Subcommand)]
pub enum Act {
    /// Write a register, and show its old and new value
    Set {
        /// Name or number
        #[arg(value_parser = hint::register(), hide_possible_values = true)]
        register: String,
        /// A number in the register's unit (currents in A with --full-scale), or a name (SPEED, I_ALPHA)
        #[arg(allow_negative_numbers = true)]
        value: String,
        /// Repeat the write until the register has the value, at most this many times (default 3)
        #[arg(long, value_name = "ATTEMPTS", num_args = 0..=1, require_equals = true,
              value_parser = clap::value_parser!(u8).range(1..=100))]
        verify: Option<Option<u8>>,
    },
    /// Start the motor
    Start {
        /// Set this ramp first: speed at the end, rpm, and duration, ms (or with a unit: 1s). Needed with
        /// --speed-limit
        #[arg(long, num_args = 2, value_names = ["RPM", "MS"], allow_negative_numbers = true)]
        ramp: Vec<String>,
    },
    /// Stop the motor
    Stop,
    /// Start an idle motor, or stop a running motor
    StartStop,
    /// Stop the current ramp
    StopRamp,
    /// Change the speed to a value in a given time
    Ramp {
        /// Speed at the end, rpm
        #[arg(allow_negative_numbers = true)]
        rpm: i32,
        /// Duration of the ramp, ms, or with a unit: 1s
        #[arg(value_parser = parse_milliseconds)]
        ms: u16,
    },
    /// Show the rev-up phases, or set one
    #[command(visible_alias = "revup")]
    RevupData {
        /// The phase to set, 0 to 4
        #[arg(requires = "rpm", value_parser = clap::value_parser!(u8).range(0..=4))]
        phase: Option<u8>,
        /// Speed at the end of the phase, rpm
        #[arg(requires = "torque", allow_negative_numbers = true)]
        rpm: Option<i32>,
        /// Iq at the end of the phase, s16A digits (A with --full-scale)
        #[arg(requires = "ms", allow_negative_numbers = true)]
        torque: Option<f64>,
        /// Duration of the phase, ms, or with a unit: 300ms
        #[arg(value_parser = parse_milliseconds)]
        ms: Option<u16>,
    },
    /// Set the current references, s16A digits (A with --full-scale)
    #[command(visible_alias = "current")]
    CurrentReference {
        /// Iq
        #[arg(allow_negative_numbers = true)]
        iq: f64,
        /// Id
        #[arg(allow_negative_numbers = true)]
        id: f64,
    },
    /// Change the torque current (Iq) in a given time; profile mcsdk-5.4 only
    TorqueRamp {
        /// Iq at the end, s16A digits (A with --full-scale)
        #[arg(allow_negative_numbers = true)]
        iq: f64,
        /// Duration of the ramp, ms, or with a unit: 1s
        #[arg(value_parser = parse_milliseconds)]
        ms: u16,
    },
    /// Turn to an angle in a given time; profile mcsdk-5.4 with position control only
    #[command(visible_alias = "move")]
    Position {
        /// Angle with its unit, such as 90deg or 1.57rad
        #[arg(allow_hyphen_values = true, value_name = "ANGLE", value_parser = parse_angle)]
        rad: f64,
        /// Duration of the move with its unit, such as 2s or 500ms
        #[arg(value_name = "TIME", value_parser = parse_duration)]
        seconds: f32,
        #[command(flatten)]
        wait: Wait,
    },
    /// Acknowledge faults. A fault stays if its cause is present
    FaultAck,
    /// Align the encoder
    EncoderAlign,
    /// Set the current references (Iq, Id) to their defaults
    IqdrefClear,
    /// Switch the power factor correction on or off, or acknowledge its faults
    Pfc {
        /// Action
        #[arg(value_parser = hint::one_of(&PFC))]
        action: st::Command,
    },
    /// Write the settings of a file that differ from those of the motor
    ///
    /// First it shows the difference. Each written setting is read back. If a write fails, or after
    /// Ctrl-C, the old values are written again. If that fails, the message names the settings.
    /// Settings that the file does not have stay as they are. A motor that is not at rest is refused.
    Restore(RestoreArgs),
    /// Send any frame
    Raw {
        /// Frame code and payload in hexadecimal; header, length and checksum are added
        #[arg(required = true, value_name = "HEX")]
        bytes: Vec<String>,
    },
}

impl Act {
    /// Whether the motor may be turning after the command, and no stop follows.
    pub fn can_turn(&self) -> bool {
        match self {
            Act::Start { .. }
            | Act::StartStop
            | Act::Ramp { .. }
            | Act::TorqueRamp { .. }
            | Act::CurrentReference { .. } => true,
            Act::Position { wait, .. } => !wait.wait,
            _ => false,
        }
    }
}

/// Whether to wait for the end of a move.
#[derive(clap::Args)]
pub struct Wait {
    /// Return when the motor has arrived and is still; stop it after Ctrl-C or if it does not arrive
    ///
    /// Without --wait the command returns when the drive has acknowledged it, and the motor keeps turning.
    /// With --wait the motor has to be in RUN or on its way there. Its position is read until it is
    /// within the tolerance and does not change for 0.25 s, after the length of the move. After a
    /// timeout, a fault, a lost line or Ctrl-C the motor is stopped (STOP_MOTOR): it no longer holds a
    /// load. After kill -9 the motor completes the move.
    #[arg(long)]
    pub wait: bool,
    /// How far from the target the motor may be to have arrived (default 0.01rad)
    #[arg(long, value_name = "ANGLE", requires = "wait", value_parser = parse_tolerance)]
    pub wait_tolerance: Option<f64>,
    /// How long to wait (default: the length of the move and 10s)
    #[arg(long, value_name = "TIME", requires = "wait", value_parser = parse_span)]
    pub wait_timeout: Option<Duration>,
}

/// What `pfc` does.
const PFC: [(&str, st::Command); 3] = [
    ("enable", st::Command::PfcEnable),
    ("disable", st::Command::PfcDisable),
    ("fault-ack", st::Command::PfcFaultAck),
];
