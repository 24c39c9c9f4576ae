//! What `motorlink rmd` takes.

use std::time::Duration;

use clap::Subcommand;
use motorlink::rmd::{EncoderBits, GearRatio, MotorId, MotorSet, SpinDirection};

use crate::connection::Connection;
use crate::pasteable::{self, number_options, port_option};
use crate::repeat::Repeat;
use crate::settings::{DumpArgs, FileArg, RestoreArgs};
use crate::span::{parse_distance, parse_span, span_up_to};
use crate::{help, hint};

#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    pub connection: Connection,
    #[command(flatten)]
    pub motor: MotorArgs,
    #[command(subcommand)]
    pub command: Command,
}

/// Which motor, and how to speak to it.
#[derive(clap::Args)]
#[command(next_help_heading = help::GLOBAL)]
pub struct MotorArgs {
    /// The motor's ID, 1 to 32 (default 1, not for off and stop); several as 1,3 or 1-4
    #[arg(short, long, global = true, value_name = "ID",
          value_parser = hint::ids(), hide_possible_values = true)]
    pub id: Vec<MotorSet>,
    /// How long to wait for a reply, 1ms to 10s
    #[arg(long, env = "MOTORLINK_RMD_TIMEOUT", default_value = "50ms", global = true,
          value_name = "TIME", value_parser = span_up_to(Duration::from_secs(10)))]
    pub timeout: Duration,
    /// Refuse commands for more speed than this, °/s, rounded down; moves need --max-speed
    ///
    /// The limit applies to `raw` too. It does not limit the speed of `torque`. `run` resumes an
    /// earlier command, whose speed is unknown: it is refused. Nothing is sent if a command exceeds the limit.
    #[arg(long, global = true, value_name = "DPS", value_parser = parse_distance)]
    pub speed_limit: Option<f64>,
    /// Refuse commands for more torque current than this, A
    ///
    /// The limit applies to `torque`, `torque4` and `raw`. Nothing is sent if a command exceeds it. The
    /// current of a speed or position command is limited only by the motor's own settings.
    #[arg(long, global = true, value_name = "AMPS", value_parser = parse_distance)]
    pub current_limit: Option<f64>,
    /// Take and show angles, speeds and accelerations of the output shaft of this gear, not of the motor
    ///
    /// The gear ratio is the turns of the motor shaft for one turn of the output shaft: 6 for a gear of
    /// 6:1. Without it all values are those of the motor shaft. It applies to each value in degrees, °/s
    /// and °/s²: commands, limits, tolerances, readings. It does not apply to `raw` and --trace.
    #[arg(long, global = true, value_name = "N", allow_negative_numbers = true,
          value_parser = hint::gear_ratio())]
    pub gear_ratio: Option<GearRatio>,
    /// Show encoder counts also in degrees. The width of the encoder, 12 to 18 bits
    #[arg(long, global = true, value_name = "BITS", value_parser = hint::encoder_bits(),
          hide_possible_values = true)]
    pub encoder_bits: Option<EncoderBits>,
    /// Allow writes to the ROM of the motor. Each write wears the ROM
    #[arg(long, global = true)]
    pub write_rom: bool,
}

impl MotorArgs {
    /// Commands in messages repeat these options.
    pub fn repeat_in_hints(&self, port: &str) {
        let mut ids = self.ids().map(MotorId::number);
        pasteable::set_options(pasteable::Options {
            protocol: "rmd",
            of_port: port_option(port),
            of_motor: number_options([
                ("--gear-ratio", self.gear_ratio.map(GearRatio::ratio)),
                ("--speed-limit", self.speed_limit),
                ("--current-limit", self.current_limit),
            ]),
            number: "--id",
            default_motor: 1,
            motor: ids.next().filter(|_| ids.next().is_none()),
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
    /// Find the motors that answer
    Scan {
        /// IDs to try instead of 1 to 32
        #[arg(value_name = "ID", value_parser = hint::id(), hide_possible_values = true)]
        ids: Vec<MotorId>,
    },
    /// Show temperature, voltage, errors, speed, currents and angles
    Status {
        #[command(flatten)]
        repeat: Repeat,
    },
    /// Write the settings of the motor as text: gains, acceleration limit, encoder offset
    ///
    /// The text is TOML: names, values and units in a fixed order, for version control. The gains are those
    /// in RAM: the protocol cannot read the ROM.
    Dump(DumpArgs),
    /// Show which settings of the motor differ from a file (exit code 1 if some differ)
    ///
    /// The exit code is 0 if all settings of the file are those of the motor, and 1 if some differ.
    Diff(FileArg),
    /// Show multi-turn and single-turn angle
    Angle {
        #[command(flatten)]
        repeat: Repeat,
    },
}

/// Commands that change something, and any frame.
#[derive(Subcommand, Clone)]
pub enum Act {
    /// Show the gains, or set them until power-off (permanently with --write-rom)
    ///
    /// A gain is a whole number from 0 to 255. The old and the new gains are printed. One frame has all
    /// six gains. To set one, motorlink reads the six, changes one, writes the six and reads them again.
    Pid {
        /// Gains to set, such as speed_kp=120; or six numbers, in the order of the output of `pid`
        #[arg(value_name = "NAME=GAIN", num_args = 0..=6, value_parser = hint::gain(),
              hide_possible_values = true)]
        gains: Vec<String>,
    },
    /// Show the acceleration limit, or set it until power-off
    #[command(visible_alias = "accel")]
    Acceleration {
        /// °/s²; 0 is unlimited
        #[arg(allow_negative_numbers = true, value_name = "DPS2")]
        dps_per_second: Option<f64>,
    },
    /// Show the encoder: position, raw position and offset
    Encoder,
    /// Set the offset of the encoder permanently (needs --write-rom)
    EncoderOffset {
        /// The new offset, in encoder counts
        offset: u16,
    },
    /// Set the zero to the current position, effective after the next power cycle (needs --write-rom)
    Zero,
    /// Switch motors off: they turn freely, and a load may fall. Give --id or --all
    Off {
        /// Switch off all motors on the bus: IDs 1 to 32
        #[arg(long)]
        all: bool,
    },
    /// Stop motors and hold them; `run` resumes the last command. Give --id or --all
    Stop {
        /// Stop all motors on the bus: IDs 1 to 32
        #[arg(long)]
        all: bool,
    },
    /// Resume the command that `stop` stopped
    Run,
    /// Turn with a constant torque current
    Torque {
        /// Torque current, -32 A to 32 A
        #[arg(allow_negative_numbers = true)]
        amps: f64,
    },
    /// Turn at a constant speed
    Speed {
        /// Speed, °/s; positive is clockwise
        #[arg(allow_negative_numbers = true)]
        dps: f64,
    },
    /// Turn to a multi-turn angle
    #[command(visible_alias = "move")]
    Position {
        /// Angle, degrees; positive is clockwise
        #[arg(allow_negative_numbers = true)]
        degrees: f64,
        #[command(flatten)]
        most: MaxSpeed,
        #[command(flatten)]
        wait: Wait,
    },
    /// Turn to an angle within one turn, in one direction
    ///
    /// motorlink reads the angle first (0x94). If the motor is at the target or just past it, the move
    /// could be nearly a full turn, and is refused. Then try the other direction, or --full-turn.
    SingleTurnPosition {
        /// Angle, 0 to 359.99 degrees
        #[arg(allow_negative_numbers = true)]
        degrees: f64,
        /// Direction: clockwise (cw) or counterclockwise (ccw)
        #[arg(value_parser = hint::direction(), hide_possible_values = true)]
        direction: SpinDirection,
        #[command(flatten)]
        most: MaxSpeed,
        #[command(flatten)]
        full_turn: FullTurn,
        #[command(flatten)]
        wait: Wait,
    },
    /// Clear errors. An error stays if its cause is present
    ClearErrors,
    /// Set the torque currents of motors 1 to 4 with one frame
    Torque4 {
        /// Torque currents of motors 1, 2, 3 and 4, A
        #[arg(num_args = 4, required = true, allow_negative_numbers = true, value_name = "AMPS")]
        amps: Vec<f64>,
        /// The motors that must answer, such as 1,2. The frame still reaches motors 1 to 4
        #[arg(long, default_value = "1-4", value_name = "ID", value_parser = hint::ids(),
              hide_possible_values = true)]
        expect: Vec<MotorSet>,
    },
    /// Write the settings of a file that differ from those of the motor
    ///
    /// First it shows the difference. Each written setting is read back. If a write fails, or after
    /// Ctrl-C, the old values are written again. If that fails, the message names the settings.
    /// Settings that the file does not have stay as they are. A motor that turns is refused.
    ///
    /// Gains and acceleration are lost at power-off. With --write-rom the gains are written to the ROM,
    /// too, at the end and also if they do not differ: the ROM cannot be read. The encoder offset is in
    /// ROM only. If it differs, --write-rom is needed. Each write wears the ROM.
    Restore(RestoreArgs),
    /// Send any eight bytes
    Raw {
        /// Bytes in hexadecimal; missing bytes are 00
        #[arg(required = true, value_name = "HEX")]
        bytes: Vec<String>,
    },
}

/// How fast a move may be.
#[derive(clap::Args, Clone)]
pub struct MaxSpeed {
    /// Maximum speed, °/s; at least 1, rounded down to a whole number
    #[arg(long, value_name = "DPS")]
    pub max_speed: Option<f64>,
}

/// What becomes of a move that could be nearly a full turn.
#[derive(clap::Args, Clone)]
pub struct FullTurn {
    /// Allow the move even if it may be nearly a full turn
    #[arg(long)]
    pub full_turn: bool,
    /// A move is refused if the motor is up to this far past the angle, degrees (default 0.5)
    #[arg(long, value_name = "DEGREES", conflicts_with = "full_turn")]
    pub tolerance: Option<f64>,
}

/// Whether to wait for the end of a move.
#[derive(clap::Args, Clone)]
pub struct Wait {
    /// Return when the motor has arrived and is still; stop it after Ctrl-C or if it does not arrive
    ///
    /// Without --wait the command returns when the motor has confirmed it, and the motor keeps turning. With
    /// --wait the angle is read until it is within the tolerance and does not change for 0.25 s. After a
    /// timeout, an error of the motor, a lost line or Ctrl-C the motor is stopped (0x81). After kill -9
    /// the motor completes the move.
    #[arg(long)]
    pub wait: bool,
    /// How far from the target the motor may be to have arrived, degrees (default: 0.1 at the motor shaft)
    ///
    /// The default is more than one count of the coarsest encoder (12 bits, 0.088°).
    #[arg(long, value_name = "DEGREES", requires = "wait", value_parser = parse_distance)]
    pub wait_tolerance: Option<f64>,
    /// How long to wait (default: twice the time at --max-speed and 10s; 60s without --max-speed)
    #[arg(long, value_name = "TIME", requires = "wait", value_parser = parse_span)]
    pub wait_timeout: Option<Duration>,
}

impl MotorArgs {
    /// The motors that are meant.
    pub fn ids(&self) -> MotorSet {
        hint::ids_or_first(&self.id)
    }

    /// The motors, for messages: `motor 1`, `motors 1, 3`.
    pub fn names(&self) -> String {
        let numbers: Vec<String> = self.ids().map(|id| id.number().to_string()).collect();
        let noun = if numbers.len() == 1 { "motor" } else { "motors" };
        format!("{noun} {}", numbers.join(", "))
    }
}

impl Command {
    /// Why --id has no meaning with this command, if it has none.
    pub fn without_id(&self) -> Option<&'static str> {
        match self {
            Command::Act(Act::Off { all: true } | Act::Stop { all: true }) => {
                Some("--all is for all motors")
            }
            Command::Act(Act::Torque4 { .. }) => Some("torque4 is for motors 1 to 4"),
            Command::Read(Read::Scan { .. }) => Some("scan takes the IDs as arguments"),
            _ => None,
        }
    }
}

impl Act {
    /// Whether the motor may be turning after the command, and no stop follows.
    pub fn can_turn(&self) -> bool {
        match self {
            Act::Run | Act::Torque { .. } | Act::Speed { .. } => true,
            Act::Position { wait, .. } | Act::SingleTurnPosition { wait, .. } => !wait.wait,
            _ => false,
        }
    }

    /// Whether the command is never given to several motors at once.
    pub fn is_for_one(&self) -> bool {
        matches!(self, Act::Zero | Act::EncoderOffset { .. } | Act::Restore(_))
    }

    /// Whether the command waits for the end of a move.
    pub fn waits(&self) -> bool {
        matches!(self, Act::Position { wait, .. } | Act::SingleTurnPosition { wait, .. } if wait.wait)
    }
}
