//! The arguments of `motorlink record`.

use std::path::PathBuf;
use std::time::Duration;

use motorlink::rmd::MotorSet;
use motorlink::st::{FullScale, MotorNumber, Profile};
use motorlink_recording::record::Port;
pub use motorlink_recording::write::Rotate;
use motorlink_recording::write::{LEAST_ROTATION, LEAST_SIZE};

use crate::failure::Failure;
use crate::hint;
use crate::span::{parse_rate, parse_span, span_up_to};

#[derive(clap::Args)]
pub struct Args {
    /// A port; repeat it for each port. A serial line has an ST drive, a CAN bus has RMD motors
    #[arg(short, long, env = "MOTORLINK_PORT", value_name = "PORT",
          value_hint = clap::ValueHint::AnyPath)]
    pub port: Vec<String>,
    #[command(flatten)]
    pub what: What,
}

/// What is recorded, and where it goes.
#[derive(clap::Args)]
pub struct What {
    /// The file, such as run.mcap; with --rotate its name before the number: run_000.mcap
    #[arg(short, long, value_name = "FILE.mcap", value_hint = clap::ValueHint::FilePath)]
    pub output: PathBuf,
    /// Signals of the motors, with a space between them, such as SPEED_MEAS TORQUE_MEAS, or speed_dps.
    /// `motorlink st registers` lists those of ST drives, docs/RECORDING.md those of RMD motors
    /// [default: state, speed, current, angle; twice a second voltage and temperature]
    #[arg(value_name = "SIGNAL")]
    pub signals: Vec<String>,
    /// How often signals are read, Hz, 0.1 to 1000
    #[arg(long, value_name = "HZ", default_value = "100", value_parser = parse_rate)]
    pub rate: Duration,
    /// Motors of ST drives, such as 1,2 [default: those that the drive has]
    #[arg(short, long, value_name = "NUMBER", value_delimiter = ',', value_parser = hint::motor(),
          hide_possible_values = true)]
    pub motor: Vec<MotorNumber>,
    /// IDs of RMD motors, such as 1,3 or 1-4 [default: those that answer]
    #[arg(short, long, value_name = "ID", value_parser = hint::ids(), hide_possible_values = true)]
    pub id: Vec<MotorSet>,
    /// How long to wait for a reply, 1ms to 10s [default: 1s, on a CAN bus 50ms]
    #[arg(long, value_name = "TIME", value_parser = span_up_to(Duration::from_secs(10)))]
    pub timeout: Option<Duration>,
    /// Protocol variant of ST drives: spec is the document, mcsdk-5.4 is shipped firmware
    #[arg(long, env = "MOTORLINK_PROFILE", default_value = "spec", value_parser = hint::profile())]
    pub profile: Profile,
    /// Record the currents of ST drives in A, as the effort of joint states: the current of digit 32767
    #[arg(long, value_name = "AMPS", allow_negative_numbers = true,
          value_parser = hint::full_scale())]
    pub full_scale: Option<FullScale>,
    /// End after this time [default: until Ctrl-C]
    #[arg(long, value_name = "TIME", value_parser = parse_span)]
    pub duration: Option<Duration>,
    /// End when the files have this size, such as 500MB or 2GB
    #[arg(long, value_name = "SIZE", value_parser = parse_size)]
    pub max_size: Option<u64>,
    /// Begin another file after this size or time, such as 100MB or 600s
    #[arg(long, value_name = "SIZE|TIME", value_parser = parse_rotate)]
    pub rotate: Option<Rotate>,
    /// Wait for the disk this often: a power failure loses this time only. Otherwise the system decides
    #[arg(long, value_name = "TIME", value_parser = parse_span)]
    pub fsync: Option<Duration>,
    /// Overwrite files that exist
    #[arg(long)]
    pub force: bool,
    /// Do not read the settings of the motors at the start
    #[arg(long)]
    pub no_settings: bool,
    /// Print JSON, one object per line
    #[arg(long)]
    pub json: bool,
}

impl What {
    /// A port to record, with the motors that are named.
    pub fn port(&self, name: &str) -> Result<Port, Failure> {
        Ok(Port {
            name: name.parse()?,
            profile: self.profile,
            timeout: self.timeout,
            motors: self.motor.clone(),
            ids: self.id.iter().copied().flatten().collect(),
            full_scale: self.full_scale,
        })
    }
}

/// The units of sizes, and their bytes.
const UNITS: [(&str, f64); 6] = [
    ("kB", 1e3),
    ("MB", 1e6),
    ("GB", 1e9),
    ("KiB", 1024.0),
    ("MiB", 1_048_576.0),
    ("GiB", 1_073_741_824.0),
];

/// Reads a size with its unit.
fn parse_size(text: &str) -> Result<u64, String> {
    let found = UNITS.iter().find_map(|(unit, bytes)| Some((text.strip_suffix(unit)?, bytes)));
    let size = found.and_then(|(number, bytes)| Some(number.trim().parse::<f64>().ok()? * bytes));
    match size {
        Some(size) if (LEAST_SIZE as f64..=1e15).contains(&size) => Ok(size as u64),
        Some(_) => Err("it must be 10kB to 1000000GB".to_owned()),
        None => Err("give a number with kB, MB or GB, such as 500MB".to_owned()),
    }
}

/// Reads a size or a time.
fn parse_rotate(text: &str) -> Result<Rotate, String> {
    if text.ends_with(['B', 'b']) {
        return parse_size(text).map(Rotate::Bytes);
    }
    let span = parse_span(text).map_err(|why| format!("{why}; or give a size, such as 100MB"))?;
    match span >= LEAST_ROTATION {
        true => Ok(Rotate::Time(span)),
        false => Err("a file takes 1s at least".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_have_a_unit() {
        assert_eq!(parse_size("500MB"), Ok(500_000_000));
        assert_eq!(parse_size("1.5 KiB"), Err("it must be 10kB to 1000000GB".to_owned()));
        assert_eq!(parse_size("64KiB"), Ok(65_536));
        assert!(parse_size("500").unwrap_err().starts_with("give a number with kB"));
        assert_eq!(parse_rotate("10MB"), Ok(Rotate::Bytes(10_000_000)));
        assert_eq!(parse_rotate("600s"), Ok(Rotate::Time(Duration::from_secs(600))));
        assert!(parse_rotate("10").unwrap_err().contains("or give a size"));
        assert_eq!(parse_rotate("100ms"), Err("a file takes 1s at least".to_owned()));
    }
}
