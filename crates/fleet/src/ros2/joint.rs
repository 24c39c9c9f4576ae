//! The joints of a machine, and the motors that turn them.

use std::collections::BTreeSet;
use std::f64::consts::TAU;

use motorlink_proto::rmd::{Command as _, SetPositionLimited, SetSpeed, SetTorque};
use motorlink_proto::st::Ramp;
use motorlink_proto::units::{CentiDegrees, CentiDps, IqCommand, Quantity, Scale, SpeedLimit};
use motorlink_telemetry::share::drive_protocol::DriveProtocol;
use motorlink_telemetry::share::message::Line;
use motorlink_telemetry::signal::Motor;
use serde::Deserialize;

use super::rmw_zenoh;

/// What a file says of ROS 2. Times are in seconds.
#[derive(Debug, Clone, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Settings {
    /// The domain.
    pub domain: u32,
    /// What the names of topics and services begin with. That of the node without it.
    pub namespace: Option<String>,
    /// How often joint states are published.
    pub rate_hz: f64,
    /// A motor stops if no command for it comes for this time.
    pub time_to_live_seconds: f64,
    /// The first position command is refused if it is farther away from the joint.
    pub start_within_rad: f64,
    /// The joints. Without any, each motor that answers is one.
    pub joint: Vec<JointSettings>,
}

impl Default for Settings {
    fn default() -> Self {
        Settings {
            domain: 0,
            namespace: None,
            rate_hz: 50.0,
            time_to_live_seconds: 0.2,
            start_within_rad: 0.2,
            joint: Vec::new(),
        }
    }
}

/// What a file says of a joint.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct JointSettings {
    name: String,
    line: String,
    motor: u8,
    command: Option<Mode>,
    #[serde(default = "one")]
    gear_ratio: f64,
    #[serde(default)]
    offset_rad: f64,
    #[serde(default)]
    reversed: bool,
    torque_constant_nm_per_a: Option<f64>,
    max_velocity_rad_per_s: Option<f64>,
}

/// What commands of a joint say.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Mode {
    /// Where it shall be, rad.
    Position,
    /// How fast it shall be, rad/s.
    Velocity,
    /// How hard it shall push, N·m.
    Effort,
}

/// A joint, and how its values follow from those of its motor.
#[derive(Debug, Clone)]
pub struct Joint {
    /// Its name in messages.
    pub name: String,
    /// The line of its motor.
    pub line: String,
    /// What the line speaks.
    pub speaks: DriveProtocol,
    /// Its motor.
    pub motor: Motor,
    /// What it obeys. `None`: it is read only.
    pub command: Option<Mode>,
    /// Radians of the joint for one turn of the motor; negative if the joint is reversed.
    radians_a_turn: f64,
    offset_rad: f64,
    nm_per_a: Option<f64>,
    max_velocity: Option<f64>,
}

/// A command in the units of the motor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reference {
    /// The eight bytes of a command of an RMD motor.
    Rmd([u8; 8]),
    /// The speed of an ST motor, rpm.
    Rpm(i32),
}

const DEGREES_A_TURN: f64 = 360.0;
const SECONDS_A_MINUTE: f64 = 60.0;

const fn one() -> f64 {
    1.0
}

impl Settings {
    /// Whether all of it is possible.
    ///
    /// # Errors
    /// What is not.
    pub fn check(&self) -> Result<(), String> {
        let within = |name: &str, value: f64, least: f64, most: f64| {
            let is_so = (least..=most).contains(&value);
            is_so.then_some(()).ok_or_else(|| format!("{name} is {least} to {most}, not {value}"))
        };
        within("ros2.domain", self.domain.into(), 0.0, 232.0)?;
        within("ros2.rate_hz", self.rate_hz, 0.1, 500.0)?;
        within("ros2.time_to_live_seconds", self.time_to_live_seconds, 0.02, 10.0)?;
        within("ros2.start_within_rad", self.start_within_rad, 0.0, TAU)?;
        if let Some(namespace) = &self.namespace
            && !rmw_zenoh::is_name(namespace)
        {
            return Err(format!(
                "ros2.namespace: `{namespace}` is not a ROS name; a valid one is arm1"
            ));
        }
        let (mut names, mut motors) = (BTreeSet::new(), BTreeSet::new());
        for joint in &self.joint {
            joint.check()?;
            if !names.insert(&joint.name) {
                return Err(format!("two joints have the name {}", joint.name));
            }
            if !motors.insert((&joint.line, joint.motor)) {
                let JointSettings { line, motor, .. } = joint;
                return Err(format!("two joints have motor {motor} of {line}"));
            }
        }
        Ok(())
    }
}

impl JointSettings {
    fn check(&self) -> Result<(), String> {
        let wrong = |why: &str| Err(format!("joint {}: {why}", self.name));
        let numbers = [Some(self.gear_ratio), self.torque_constant_nm_per_a];
        let limits = numbers.into_iter().chain([self.max_velocity_rad_per_s]).flatten();
        if self.name.is_empty() {
            return Err("a joint has no name".to_owned());
        }
        if !limits.into_iter().all(|it| it.is_finite() && it > 0.0) || !self.offset_rad.is_finite()
        {
            return wrong("the gear ratio, the torque constant and the velocity are more than 0");
        }
        match self.command {
            Some(Mode::Position) if self.max_velocity_rad_per_s.is_none() => {
                wrong("a position command needs max_velocity_rad_per_s")
            }
            Some(Mode::Effort) if self.torque_constant_nm_per_a.is_none() => {
                wrong("an effort command needs torque_constant_nm_per_a")
            }
            _ => Ok(()),
        }
    }

    /// The joint, if the lines have its motor.
    ///
    /// # Errors
    /// They do not, or its drive cannot do what the joint needs.
    pub fn find(&self, lines: &[Line]) -> Result<Joint, String> {
        let JointSettings { name, line, motor, .. } = self;
        let wrong = |why: String| format!("joint {name}: {why}");
        let names: Vec<_> = lines.iter().map(|it| it.line.as_str()).collect();
        let found = lines.iter().find(|it| it.line == *line);
        let found = found
            .ok_or_else(|| wrong(format!("no line {line}; the lines are {}", names.join(", "))))?;
        let joint = Joint::of(name.clone(), found, *motor);
        let joint = joint.ok_or_else(|| wrong(format!("{line} can have no motor {motor}")))?;
        if matches!(joint.motor, Motor::St(_)) {
            if matches!(self.command, Some(Mode::Position | Mode::Effort)) {
                return Err(wrong("an ST drive takes velocity commands only".to_owned()));
            }
            if self.torque_constant_nm_per_a.is_some() {
                return Err(wrong("an ST drive does not report its current in A".to_owned()));
            }
        }
        let direction = if self.reversed { -1.0 } else { 1.0 };
        Ok(Joint {
            command: self.command,
            radians_a_turn: direction * TAU / self.gear_ratio,
            offset_rad: self.offset_rad,
            nm_per_a: self.torque_constant_nm_per_a,
            max_velocity: self.max_velocity_rad_per_s,
            ..joint
        })
    }
}

impl Joint {
    /// The joint of a motor that is in no file.
    pub fn of_motor(line: &Line, motor: u8) -> Option<Self> {
        Self::of(rmw_zenoh::legal(&format!("{}_{motor}", line.line)), line, motor)
    }

    fn of(name: String, line: &Line, motor: u8) -> Option<Self> {
        let speaks = DriveProtocol::of(line)?;
        Some(Joint {
            name,
            line: line.line.clone(),
            speaks,
            motor: speaks.motor(motor)?,
            command: None,
            radians_a_turn: TAU,
            offset_rad: 0.0,
            nm_per_a: None,
            max_velocity: None,
        })
    }

    /// The place of its motor, for messages.
    pub fn place(&self) -> String {
        format!("{}, motor {}", self.line, self.motor.number())
    }

    /// The position at an angle of an RMD motor over all its turns.
    pub fn position_rad(&self, degrees: f64) -> f64 {
        degrees / DEGREES_A_TURN * self.radians_a_turn + self.offset_rad
    }

    /// The velocity at a speed of the motor, in the unit of its drive.
    pub fn velocity_rad_per_s(&self, speed: f64) -> f64 {
        speed / self.speed_of_a_turn() * self.radians_a_turn
    }

    /// The effort at a current of the motor. `None`: no torque constant is known.
    pub fn effort_nm(&self, amps: f64) -> Option<f64> {
        Some(amps * self.nm_per_a? * self.turns_a_radian() * TAU)
    }

    /// The command for its motor.
    ///
    /// # Errors
    /// The drive or the file does not allow the value.
    pub fn reference(&self, mode: Mode, value: f64) -> Result<Reference, String> {
        let failed = |why: &dyn std::fmt::Display| format!("{}: {why}", self.name);
        if let (Mode::Velocity, Some(most)) = (mode, self.max_velocity)
            && value.abs() > most
        {
            return Err(failed(&format!("{value} rad/s is beyond its ±{most} rad/s")));
        }
        let speed = |velocity: f64| velocity * self.turns_a_radian() * self.speed_of_a_turn();
        if let Motor::St(_) = self.motor {
            let most = i64::from(Ramp::MAX_SPEED_RPM);
            let rpm = Scale { symbol: "rpm", ..Scale::plain(-most, most) }.wanted(speed(value));
            return rpm.map(|rpm| Reference::Rpm(rpm as i32)).map_err(|why| failed(&why));
        }
        let bytes = match mode {
            Mode::Position => {
                let turns = (value - self.offset_rad) * self.turns_a_radian();
                let max_speed = speed(self.max_velocity.unwrap_or_default()).abs();
                let max_speed = max_speed.min(SpeedLimit::MAX.dps());
                wanted::<CentiDegrees>(turns * DEGREES_A_TURN).and_then(|angle| {
                    let max_speed = wanted::<SpeedLimit>(max_speed)?;
                    Ok(SetPositionLimited { max_speed, angle }.encode())
                })
            }
            Mode::Velocity => {
                wanted::<CentiDps>(speed(value)).map(|speed| SetSpeed { speed }.encode())
            }
            Mode::Effort => {
                let amps = self.effort_nm(1.0).map_or(f64::NAN, |nm_per_a| value / nm_per_a);
                wanted::<IqCommand>(amps).map(|iq| SetTorque { iq }.encode())
            }
        };
        bytes.map(Reference::Rmd).map_err(|why| failed(&why))
    }

    fn turns_a_radian(&self) -> f64 {
        self.radians_a_turn.recip()
    }

    /// The speed of the motor, in the unit of its drive, that is a turn each second.
    fn speed_of_a_turn(&self) -> f64 {
        match self.motor {
            Motor::St(_) => SECONDS_A_MINUTE,
            Motor::Rmd(_) => DEGREES_A_TURN,
        }
    }
}

fn wanted<Q: Quantity>(value: f64) -> Result<Q, String> {
    Q::wanted(value).map_err(|why| why.to_string())
}

#[cfg(test)]
pub(super) mod tests {
    use std::f64::consts::PI;

    use motorlink_telemetry::share::message::Protocol;

    use super::*;

    fn line(name: &str, protocol: Protocol) -> Line {
        let profile = (protocol == Protocol::St).then(|| "spec".to_owned());
        Line { line: name.to_owned(), protocol, profile, heard: vec![1], ..Line::default() }
    }

    pub(in super::super) fn lines() -> Vec<Line> {
        vec![line("st0", Protocol::St), line("rmd0", Protocol::Rmd)]
    }

    /// A joint as in a file: settings after `name = "j"`.
    pub(in super::super) fn joint(name: &str, settings: &str) -> Joint {
        settings_of(name, settings).find(&lines()).unwrap()
    }

    fn settings_of(name: &str, settings: &str) -> JointSettings {
        let mut values = serde_json::Map::new();
        values.insert("name".to_owned(), name.into());
        for pair in settings.split_whitespace() {
            let (key, value) = pair.split_once('=').unwrap();
            let value = serde_json::from_str(value).unwrap_or_else(|_| value.into());
            values.insert(key.to_owned(), value);
        }
        serde_json::from_value(values.into()).unwrap()
    }

    #[test]
    fn values_of_a_joint_follow_the_gear_and_the_direction() {
        let joint = joint(
            "j",
            "line=rmd0 motor=1 gear_ratio=6 offset_rad=0.5 reversed=true torque_constant_nm_per_a=2.0",
        );
        assert!((joint.position_rad(6.0 * 180.0) - (0.5 - PI)).abs() < 1e-12);
        assert!((joint.velocity_rad_per_s(6.0 * 360.0) + TAU).abs() < 1e-12);
        assert!((joint.effort_nm(0.5).unwrap() + 6.0).abs() < 1e-12);
    }

    #[test]
    fn a_command_is_the_inverse_of_what_the_motor_says() {
        let arm = joint(
            "j",
            "line=rmd0 motor=1 gear_ratio=6 offset_rad=0.5 reversed=true max_velocity_rad_per_s=1 \
             torque_constant_nm_per_a=2.0",
        );
        let angle = CentiDegrees::from_degrees(-6.0 * 90.0);
        let max_speed = SpeedLimit(343);
        let position = arm.reference(Mode::Position, 0.5 + PI / 2.0);
        let bytes = SetPositionLimited { max_speed, angle }.encode();
        assert_eq!(position, Ok(Reference::Rmd(bytes)));
        let speed = CentiDps::from_dps(-6.0 * 0.5_f64.to_degrees());
        let velocity = arm.reference(Mode::Velocity, 0.5);
        assert_eq!(velocity, Ok(Reference::Rmd(SetSpeed { speed }.encode())));
        let iq = IqCommand::from_amps(-0.8);
        let effort = arm.reference(Mode::Effort, 9.6);
        assert_eq!(effort, Ok(Reference::Rmd(SetTorque { iq }.encode())));
        let beyond = arm.reference(Mode::Velocity, 1.1).unwrap_err();
        assert_eq!(beyond, "j: 1.1 rad/s is beyond its ±1 rad/s");
        let wheel = joint("w", "line=st0 motor=1 gear_ratio=2");
        assert_eq!(wheel.reference(Mode::Velocity, TAU), Ok(Reference::Rpm(120)));
        assert!((wheel.velocity_rad_per_s(120.0) - TAU).abs() < 1e-12);
        for odd in [f64::NAN, f64::INFINITY, 1e300] {
            for mode in [Mode::Position, Mode::Velocity, Mode::Effort] {
                assert!(arm.reference(mode, odd).is_err());
            }
            assert!(wheel.reference(Mode::Velocity, odd).is_err());
        }
    }

    #[test]
    fn a_file_that_is_not_possible_is_refused() {
        for (settings, why) in [
            ("line=rmd0 motor=1 command=position", "needs max_velocity_rad_per_s"),
            ("line=rmd0 motor=1 command=effort", "needs torque_constant_nm_per_a"),
            ("line=rmd0 motor=1 gear_ratio=0", "more than 0"),
            ("line=rmd0 motor=40", "rmd0 can have no motor 40"),
            ("line=rmd1 motor=1", "no line rmd1; the lines are st0, rmd0"),
            (
                "line=st0 motor=1 command=position max_velocity_rad_per_s=1",
                "velocity commands only",
            ),
            ("line=st0 motor=1 torque_constant_nm_per_a=1", "does not report its current"),
        ] {
            let settings = settings_of("j", settings);
            let found = settings.check().and_then(|()| settings.find(&lines()).map(drop));
            let text = found.unwrap_err();
            assert!(text.contains(why), "{text}");
        }
        let joint = vec![settings_of("j", "line=rmd0 motor=1")];
        let twice = [joint.clone(), joint].concat();
        let settings = Settings { joint: twice, ..Settings::default() };
        assert_eq!(settings.check().unwrap_err(), "two joints have the name j");
        let settings = Settings { namespace: Some("a-b".to_owned()), ..Settings::default() };
        assert!(settings.check().unwrap_err().contains("`a-b` is not a ROS name"));
        let settings = Settings { rate_hz: f64::NAN, ..Settings::default() };
        assert!(settings.check().unwrap_err().contains("ros2.rate_hz"));
    }
}
