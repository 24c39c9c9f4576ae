//! The arguments of `motorlink watch`.

use std::time::Duration;

use motorlink::rmd::{GearRatio, MotorSet};
use motorlink::st::{FullScale, MotorNumber, Profile};

use crate::hint;
use crate::span::{parse_rate, span_up_to};

#[derive(clap::Args)]
pub struct Args {
    /// A port; repeat it for each port. A serial line has an ST drive, a CAN bus has RMD motors
    #[arg(short, long, env = "MOTORLINK_PORT", value_name = "PORT",
          value_hint = clap::ValueHint::AnyPath)]
    pub port: Vec<String>,
    /// Motors of ST drives, such as 1,2 [default: those that the drive has]
    #[arg(short, long, value_name = "NUMBER", value_delimiter = ',', value_parser = hint::motor(),
          hide_possible_values = true)]
    pub motor: Vec<MotorNumber>,
    /// IDs of RMD motors, such as 1,3 or 1-4 [default: those that answer]
    #[arg(short, long, value_name = "ID", value_parser = hint::ids(), hide_possible_values = true)]
    pub id: Vec<MotorSet>,
    /// How often state, speed and current are read, Hz, 0.1 to 1000
    #[arg(long, value_name = "HZ", default_value = "10", value_parser = parse_rate)]
    pub rate: Duration,
    /// How long to wait for a reply, 1ms to 10s [default: 1s, on a CAN bus 50ms]
    #[arg(long, value_name = "TIME", value_parser = span_up_to(Duration::from_secs(10)))]
    pub timeout: Option<Duration>,
    /// Protocol variant of ST drives: spec is the document, mcsdk-5.4 is shipped firmware
    #[arg(long, env = "MOTORLINK_PROFILE", default_value = "spec", value_parser = hint::profile())]
    pub profile: Profile,
    /// Show and take currents of ST drives in A: the current of digit 32767
    #[arg(long, value_name = "AMPS", allow_negative_numbers = true,
          value_parser = hint::full_scale())]
    pub full_scale: Option<FullScale>,
    /// Show angles, speeds and accelerations of RMD motors at the output shaft of this gear
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = hint::gear_ratio())]
    pub gear_ratio: Option<GearRatio>,
}
