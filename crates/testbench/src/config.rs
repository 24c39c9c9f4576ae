//! The drives of a bench, from a TOML file.

use std::path::{Path, PathBuf};

use motorlink_link::{printable, printable_lines};
use motorlink_proto::rmd::Settings;
use motorlink_proto::st::{Profile, RegisterId};
use motorlink_proto::time::Instant;
use motorlink_sim::plant::OutOfRange;
use motorlink_sim::rmd::{RmdBus, RmdConfig, RmdNode};
use motorlink_sim::st::{MotorConfig, StDrive, StMotor, StStation};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use toml::{Table, Value};

/// An ST drive on its line.
pub(crate) type StSide = StStation<Vec<StMotor>>;
/// RMD motors on their bus.
pub(crate) type RmdSide = RmdBus<Vec<RmdNode>>;

/// A serial line with an ST drive and a CAN bus with RMD motors. The default is one drive with two
/// motors, and four motors with IDs 1 to 4.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct BenchConfig {
    /// Protocol profile of the ST drive.
    pub profile: Profile,
    /// The ST drive's motors.
    pub st: StConfigs,
    /// The motors on the CAN bus.
    pub rmd: RmdConfigs,
    /// The ST register that reads the time of the drive in ms, for measurements of delays.
    pub clock_register: Option<RegisterId>,
}

/// The ST drive's motors, 1 to 7 of them.
#[derive(Debug, Clone, PartialEq)]
pub struct StConfigs(Vec<MotorConfig>);

/// The motors on the CAN bus, each with an ID of its own.
#[derive(Debug, Clone, PartialEq)]
pub struct RmdConfigs(Vec<RmdConfig>);

impl Default for StConfigs {
    fn default() -> Self {
        StConfigs(vec![MotorConfig::default(), MotorConfig::servo()])
    }
}

impl Default for RmdConfigs {
    fn default() -> Self {
        RmdConfigs((1..=4).map(RmdConfig::with_id).collect())
    }
}

/// Why a configuration is refused.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ConfigError {
    /// The file cannot be read.
    #[error("cannot read `{}`: {error}", printable(&.path.display().to_string()))]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Why.
        error: std::io::Error,
    },
    /// Something is wrong in a file.
    #[error("{}: {error}", printable(&.path.display().to_string()))]
    InFile {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        error: Box<ConfigError>,
    },
    /// The text is not a configuration.
    #[error("{}", printable_lines(.0))]
    Text(String),
    /// A motor has impossible values.
    #[error("{0}")]
    Impossible(String),
}

/// The file as it is written. A motor's table is read on top of its preset.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(default)]
    profile: Profile,
    clock_register: Option<String>,
    st: Option<Motors>,
    rmd: Option<Motors>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Motors {
    motor: Vec<Table>,
}

impl BenchConfig {
    /// Reads a file.
    pub fn read(path: &Path) -> Result<Self, ConfigError> {
        let text = std::fs::read_to_string(path)
            .map_err(|error| ConfigError::Unreadable { path: path.to_owned(), error })?;
        Self::parse(&text)
            .map_err(|error| ConfigError::InFile { path: path.to_owned(), error: Box::new(error) })
    }

    /// Reads the text of a file. Missing parts have their defaults.
    pub fn parse(text: &str) -> Result<Self, ConfigError> {
        Self::from_file(
            toml::from_str(text).map_err(|error| ConfigError::Text(toml_error(&error)))?,
        )
    }

    /// Reads the same as JSON: an object with the members that a file has.
    pub fn parse_json(text: &str) -> Result<Self, ConfigError> {
        let file = serde_json::from_str(text);
        Self::from_file(file.map_err(|error| ConfigError::Text(printable(&error.to_string())))?)
    }

    /// Reads a file's table.
    pub(super) fn from_table(table: Table) -> Result<Self, ConfigError> {
        Self::from_file(
            table
                .try_into()
                .map_err(|error: toml::de::Error| ConfigError::Text(error.message().to_owned()))?,
        )
    }

    fn from_file(file: File) -> Result<Self, ConfigError> {
        let st = motors(file.st, "st.motor", st_motor)?.map(StConfigs).unwrap_or_default();
        let rmd = motors(file.rmd, "rmd.motor", rmd_motor)?.map(RmdConfigs).unwrap_or_default();
        let clock_register = file.clock_register.map(|name| register(&name)).transpose()?;
        let config = BenchConfig { profile: file.profile, st, rmd, clock_register };
        config.station(Instant(0))?;
        config.bus(Instant(0), RmdConfig::factory_rom)?;
        Ok(config)
    }

    /// Sets the seeds of the noise: `seed` for the first motor, `seed + 1` for the next.
    pub fn seeded(mut self, seed: u32) -> Self {
        let st = self.st.0.iter_mut().map(|motor| &mut motor.plant.seed);
        let rmd = self.rmd.0.iter_mut().map(|motor| &mut motor.plant.seed);
        for (slot, n) in st.chain(rmd).zip(0..) {
            *slot = seed.wrapping_add(n);
        }
        self
    }

    /// The ST drive, powered on `now`, to be advanced by the caller.
    ///
    /// # Errors
    /// Impossible values; never of a configuration that [`parse`](Self::parse) returned.
    pub fn station(&self, now: Instant) -> Result<StSide, ConfigError> {
        for (config, n) in self.st.0.iter().zip(1..) {
            config.check().map_err(impossible("st.motor", n))?;
        }
        let motors: Vec<StMotor> = self.st.0.iter().copied().map(StMotor::new).collect();
        let drive = StDrive::new(now, motors).ok_or_else(|| {
            ConfigError::Impossible(format!("a drive has 1 to 7 motors, not {}", self.st.0.len()))
        })?;
        let drive = match self.clock_register {
            Some(register) => drive.with_clock(register),
            None => drive,
        };
        Ok(StStation::new(self.profile, drive))
    }

    /// How many motors the ST drive has.
    pub(super) fn st_motors(&self) -> usize {
        self.st.0.len()
    }

    /// The motors on the CAN bus.
    pub(super) fn rmd_motors(&self) -> &[RmdConfig] {
        &self.rmd.0
    }

    /// The CAN bus, powered on `now`, to be advanced by the caller. `rom` returns the content of each
    /// motor's ROM.
    ///
    /// # Errors
    /// As [`station`](Self::station).
    pub fn bus(
        &self,
        now: Instant,
        rom: impl Fn(&RmdConfig) -> Settings,
    ) -> Result<RmdSide, ConfigError> {
        for (config, n) in self.rmd.0.iter().zip(1..) {
            config.check().map_err(impossible("rmd.motor", n))?;
        }
        let node =
            |config: &RmdConfig| RmdNode::new(now, *config, rom(config)).expect("it was checked");
        RmdBus::new(self.rmd.0.iter().map(node).collect()).ok_or_else(|| {
            let mut ids: Vec<u8> = self.rmd.0.iter().map(|config| config.id).collect();
            ids.sort_unstable();
            let twice = ids.windows(2).find(|pair| pair[0] == pair[1]).map_or(0, |pair| pair[0]);
            ConfigError::Impossible(format!("two motors have the same ID {twice}"))
        })
    }
}

fn register(name: &str) -> Result<RegisterId, ConfigError> {
    let unknown = || format!("clock_register: `{}` is no register", printable(name));
    RegisterId::named(name).ok_or_else(|| ConfigError::Text(unknown()))
}

/// An error of a TOML file with its place, on several lines.
pub(super) fn toml_error(error: &toml::de::Error) -> String {
    let message = error.message();
    printable_lines(error.to_string().replace(message, &printable(message)).trim_end())
}

/// Adds the motor to an error.
fn impossible(motor: &str, number: usize) -> impl Fn(OutOfRange) -> ConfigError {
    move |error| ConfigError::Impossible(format!("{motor} {number}: {error}"))
}

/// The motors of a section, if the file has it. `read` gets the table and the place of each motor.
fn motors<T>(
    section: Option<Motors>,
    name: &str,
    read: impl Fn(Table, &str) -> Result<T, ConfigError>,
) -> Result<Option<Vec<T>>, ConfigError> {
    let Some(section) = section else { return Ok(None) };
    let tables = section.motor.into_iter().zip(1..);
    tables.map(|(table, n)| read(table, &format!("{name} {n}"))).collect::<Result<_, _>>().map(Some)
}

/// An ST motor: its preset, changed by the values of the table.
fn st_motor(mut table: Table, place: &str) -> Result<MotorConfig, ConfigError> {
    let preset = match table.remove("preset") {
        None => MotorConfig::default(),
        Some(name) => {
            let known = MotorConfig::PRESETS.iter().find(|(known, _)| name.as_str() == Some(known));
            let Some((_, preset)) = known else {
                let names = MotorConfig::PRESETS.map(|(name, _)| name).join(", ");
                let name = printable(&name.to_string());
                let why = format!("{place}: the presets are {names}, not {name}");
                return Err(ConfigError::Text(why));
            };
            preset()
        }
    };
    overlay(preset, table, place)
}

/// An RMD motor: its preset (`rmd-l-5005` or `rmd-x8`), changed by the values of the table.
fn rmd_motor(mut table: Table, place: &str) -> Result<RmdConfig, ConfigError> {
    let preset = match table.remove("preset") {
        None => RmdConfig::default(),
        Some(Value::String(name)) if name == "rmd-l-5005" => RmdConfig::default(),
        Some(Value::String(name)) if name == "rmd-x8" => RmdConfig::x8(),
        Some(other) => {
            let other = printable(&other.to_string());
            let why =
                format!("{place}: the presets are \"rmd-l-5005\" and \"rmd-x8\", not {other}");
            return Err(ConfigError::Text(why));
        }
    };
    overlay(preset, table, place)
}

/// `preset` with the values of `table`, at any depth.
pub(super) fn overlay<T: serde::Serialize + DeserializeOwned>(
    preset: T,
    table: Table,
    place: &str,
) -> Result<T, ConfigError> {
    let error = |error: &dyn std::fmt::Display| ConfigError::Text(format!("{place}: {error}"));
    let mut whole = Table::try_from(preset).map_err(|why| error(&why))?;
    merge(&mut whole, table);
    whole.try_into().map_err(|why| error(&toml_error(&why).replace('\n', " ")))
}

fn merge(whole: &mut Table, over: Table) {
    for (key, value) in over {
        match (whole.get_mut(&key), value) {
            (Some(Value::Table(inner)), Value::Table(over)) => merge(inner, over),
            (_, value) => {
                whole.insert(key, value);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use motorlink_proto::st::{Frame, MAX_FRAME, Request};

    use super::*;

    #[test]
    fn an_empty_file_is_the_default() {
        assert_eq!(BenchConfig::parse("").unwrap(), BenchConfig::default());
    }

    #[test]
    fn a_motor_is_its_preset_with_what_the_file_says() {
        let text = "
            profile = \"mcsdk-5.4\"
            [[st.motor]]
            preset = \"servo\"
            plant.supply.voltage = 36.0
            plant.machine.pole_pairs = 7
            [[rmd.motor]]
            preset = \"rmd-x8\"
            id = 32
            plant.supply.chopper = { resistance = 5, on_voltage = 56, off_voltage = 54 }
            plant.machine.gear.ratio = 6
        ";
        let config = BenchConfig::parse(text).unwrap();
        assert_eq!(config.profile, Profile::Mcsdk54);
        let [motor] = &config.st.0[..] else { panic!("one motor is written") };
        let plant = &motor.plant;
        assert_eq!((plant.supply.voltage, plant.machine.pole_pairs), (36.0, 7));
        let servo = MotorConfig::servo().plant;
        assert_eq!(plant.machine.flux_linkage, servo.machine.flux_linkage);
        let motor = &config.rmd.0[0];
        assert_eq!((motor.id, motor.plant.machine.gear.ratio), (32, 6.0));
        assert_eq!(motor.plant.machine.pole_pairs, RmdConfig::x8().plant.machine.pole_pairs);
        assert!(motor.plant.supply.chopper.is_some());
    }

    #[test]
    fn a_register_reads_the_time_of_the_drive() {
        let config = BenchConfig::parse("clock_register = \"SPEED_REF\"").unwrap();
        let mut station = config.station(Instant(0)).unwrap();
        let mut request = [0; MAX_FRAME];
        let get = Request::GetRegister(RegisterId::SPEED_REF);
        let request = Frame::command(2, &get, &mut request).expect("it is short").to_vec();
        for ms in [1, 70_000] {
            let mut reply = Vec::new();
            station.receive(Instant(1000 * ms), &request, |bytes| reply.extend(bytes));
            let value = i32::from_le_bytes(reply[2..6].try_into().unwrap());
            assert_eq!(i64::from(value), ms as i64);
        }
    }

    #[test]
    fn json_says_the_same() {
        let toml =
            "[[st.motor]]\npreset = \"servo\"\nplant.supply.voltage = 36\n[[rmd.motor]]\nid = 7";
        let json = r#"{"st": {"motor": [{"preset": "servo", "plant": {"supply": {"voltage": 36}}}]},
            "rmd": {"motor": [{"id": 7}]}}"#;
        assert_eq!(BenchConfig::parse_json(json).unwrap(), BenchConfig::parse(toml).unwrap());
        assert!(BenchConfig::parse_json(r#"{"st": 3}"#).is_err());
    }

    #[test]
    fn each_motor_has_noise_of_its_own() {
        let config = BenchConfig::default().seeded(u32::MAX);
        let seeds: Vec<u32> = config.st.0.iter().map(|motor| motor.plant.seed).collect();
        assert_eq!(seeds, [u32::MAX, 0]);
        assert_eq!(config.rmd.0[3].plant.seed, 4);
    }

    #[test]
    fn every_value_of_a_plant_and_every_register_is_documented_with_its_unit() {
        fn keys(value: &serde_json::Value, found: &mut Vec<String>) {
            for (key, value) in value.as_object().into_iter().flatten() {
                found.push(key.clone());
                keys(value, found);
            }
        }
        let document = include_str!("../../../docs/PHYSICS.md");
        let motor = serde_json::to_value(MotorConfig::mains()).unwrap();
        let mut found = Vec::new();
        for part in ["plant", "registers"] {
            keys(&motor[part], &mut found);
        }
        assert!(found.len() > 100, "{found:?}");
        for key in found {
            let known = ["`KEY`", ".KEY`", "`KEY.", "`plant.KEY.`"];
            let known = known.map(|pattern| pattern.replace("KEY", &key));
            assert!(known.iter().any(|known| document.contains(known)), "{key} is not documented");
        }
    }

    #[test]
    fn what_cannot_be_is_refused_with_its_place() {
        let why = |text: &str| BenchConfig::parse(text).unwrap_err().to_string();
        assert!(why("[[rmd.motor]]\nidd = 3").contains("idd"));
        assert!(why("[[rmd.motor]]\nid = 33").contains("1 to 32"));
        assert!(why("[[rmd.motor]]\nid = 3\n[[rmd.motor]]\nid = 3").contains("same ID"));
        assert!(why("[st]\nmotor = []").contains("1 to 7"));
        assert!(why("[[st.motor]]\npreset = \"big\"").contains("servo"));
        assert!(why("profile = \"v9\"").contains("v9"));
        assert!(why("clock_register = \"SPEED\"").contains("`SPEED`"));
        assert!(
            why("[[st.motor]]\nplant.supply.voltage = -1").contains("st.motor 1: plant.supply")
        );
        assert!(why("[[rmd.motor]]\nplant.machine.inertia = 0").contains("plant.machine.inertia"));
        assert!(why("[[rmd.motor]]\nplant.encoder.bits = 19").contains("plant.encoder.bits"));
        assert!(why("[[rmd.motor]]\npreset = \"big\"").contains("rmd-x8"));
        assert!(why("[[rmd.motor]]\nprotect_voltage = nan").contains("protect_voltage"));
        assert!(why("[[st.motor]]\nplant.heat.ambient = inf").contains("heat.ambient"));
        assert!(why("[[st.motor]]\nalignment_current = 1e38").contains("alignment_current"));
        assert!(why("[[st.motor]]\nthresholds.over_voltage = nan").contains("over_voltage"));
        let percent = why("[[st.motor]]\nregisters.fluxwk_bus = 70000");
        assert!(percent.contains("registers.fluxwk_bus (in 0.1 %) is 0 to 1000, not 70000"));
        let phase = "{ speed_rpm = 0, current = inf, duration_ms = 0 }";
        let revup = format!("[[st.motor]]\nrevup = [{}]", [phase; 5].join(", "));
        assert!(why(&revup).contains("revup.current"));
    }
}
