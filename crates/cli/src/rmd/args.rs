//! What `motorlink rmd` takes.

use std::time::Duration;

use clap::Subcommand;
use motorlink::rmd::SpinDirection;

use crate::connection::Connection;
use crate::repeat::Repeat;
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
    /// The motor's ID, 1 to 32
    #[arg(short, long, default_value_t = 1, global = true, value_parser = hint::id(),
          hide_possible_values = true)]
    pub id: u8,
    /// How long to wait for a reply, 1ms to 10s
    #[arg(long, default_value = "50ms", global = true, value_name = "TIME",
          value_parser = span_up_to(Duration::from_secs(10)))]
    pub timeout: Duration,
    /// Allow commands that write to the motor's ROM, which wears
    #[arg(long, global = true)]
    pub write_rom: bool,
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
        /// IDs to ask instead of 1 to 32
        #[arg(value_name = "ID", value_parser = hint::id(), hide_possible_values = true)]
        ids: Vec<u8>,
    },
    /// Show temperature, voltage, errors, speed, torque current, phase currents, angles
    Status {
        #[command(flatten)]
        repeat: Repeat,
    },
    /// Show multi-turn and single-turn angle
    Angle {
        #[command(flatten)]
        repeat: Repeat,
    },
}

/// Commands that change something, and any frame.
#[derive(Subcommand)]
pub enum Act {
    /// Show the gains, or set them until power-off (for good with --write-rom)
    ///
    /// Gains are 0 to 255. A motor takes all six in one frame: to set one, the six are read, this one
    /// is changed, and the six are written and read back.
    Pid {
        /// Gains to set, such as speed_kp=120; or all six as numbers, in the order that `pid` shows
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
    /// Set the offset of the encoder for good (needs --write-rom)
    EncoderOffset {
        /// The new offset
        offset: u16,
    },
    /// Make the current position the zero, effective after the next power cycle (needs --write-rom)
    Zero,
    /// Switch the motor off and forget what it was doing
    Off,
    /// Stop the motor and remember what it was doing
    Stop,
    /// Resume what `stop` stopped
    Run,
    /// Hold a torque current
    Torque {
        /// A, within ±32
        #[arg(allow_negative_numbers = true)]
        amps: f64,
    },
    /// Hold a speed
    Speed {
        /// °/s, positive is clockwise
        #[arg(allow_negative_numbers = true)]
        dps: f64,
    },
    /// Turn to an angle over all turns
    #[command(visible_alias = "move")]
    Position {
        /// Degrees, positive is clockwise
        #[arg(allow_negative_numbers = true)]
        degrees: f64,
        #[command(flatten)]
        most: MaxSpeed,
        #[command(flatten)]
        wait: Wait,
    },
    /// Turn to an angle within the turn, one way round
    ///
    /// The motor is asked for its angle first (0x94). At its target, or just past it, the move could be
    /// nearly a full turn: it is refused. Then try the other direction, or --full-turn.
    SingleTurnPosition {
        /// Degrees, 0 to 359.99
        #[arg(allow_negative_numbers = true)]
        degrees: f64,
        /// Which way round: clockwise or counterclockwise, cw or ccw for short
        #[arg(value_parser = hint::direction(), hide_possible_values = true)]
        direction: SpinDirection,
        #[command(flatten)]
        most: MaxSpeed,
        #[command(flatten)]
        full_turn: FullTurn,
        #[command(flatten)]
        wait: Wait,
    },
    /// Clear the errors whose cause is gone
    ClearErrors,
    /// Hold torque currents of motors 1 to 4, sent in one frame
    Torque4 {
        /// A for motors 1, 2, 3 and 4
        #[arg(num_args = 4, required = true, allow_negative_numbers = true, value_name = "AMPS")]
        amps: Vec<f64>,
    },
    /// Send any eight bytes
    Raw {
        /// Bytes in hexadecimal; zeros are added up to eight
        #[arg(required = true, value_name = "HEX")]
        bytes: Vec<String>,
    },
}

/// How fast a move may be.
#[derive(clap::Args)]
pub struct MaxSpeed {
    /// No faster than this, °/s; 1 at least, rounded down to whole °/s
    #[arg(long, value_name = "DPS")]
    pub max_speed: Option<f64>,
}

/// What becomes of a move that could be nearly a full turn.
#[derive(clap::Args)]
pub struct FullTurn {
    /// Move even if the motor is at the angle or just past it, which may be nearly a full turn
    #[arg(long)]
    pub full_turn: bool,
    /// Up to how far past the angle the move is refused, degrees (default 0.5)
    #[arg(long, value_name = "DEGREES", conflicts_with = "full_turn")]
    pub tolerance: Option<f64>,
}

/// Whether to wait for the end of a move.
#[derive(clap::Args)]
pub struct Wait {
    /// Return when the motor has arrived and is still; stop it after Ctrl-C or if it does not arrive
    ///
    /// Without --wait the command returns when the motor has confirmed it, and the motor turns on. With
    /// --wait the angle is read until it is within the tolerance and does not change for 0.25 s. After a
    /// timeout, an error of the motor, a lost line or Ctrl-C the motor is stopped (0x81). After kill -9
    /// the motor completes the move.
    #[arg(long)]
    pub wait: bool,
    /// How far from the target the motor may be to have arrived, degrees (default 0.1)
    ///
    /// The default is more than one count of the coarsest encoder (12 bits, 0.088°).
    #[arg(long, value_name = "DEGREES", requires = "wait", value_parser = parse_distance)]
    pub wait_tolerance: Option<f64>,
    /// How long to wait (default: twice the time at --max-speed and 10s; 60s without --max-speed)
    #[arg(long, value_name = "TIME", requires = "wait", value_parser = parse_span)]
    pub wait_timeout: Option<Duration>,
}
