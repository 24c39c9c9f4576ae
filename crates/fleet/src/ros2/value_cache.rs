//! What the motors said last.

use std::collections::BTreeMap;

use motorlink_telemetry::overview::{self, Overview};
use motorlink_telemetry::sample::Sample;
use motorlink_telemetry::share::data::{Data, TIMES};
use motorlink_telemetry::share::message::{Group, Line};
use motorlink_telemetry::signal::{Motor, Source};

use super::joint::Joint;

/// A motor of a share.
pub type MotorKey = (String, u8);

/// The last values of all motors.
#[derive(Debug, Default)]
pub struct ValueCache {
    /// Wall clock minus the clock of the line, in seconds.
    walls: BTreeMap<String, f64>,
    groups: BTreeMap<u32, (MotorKey, Vec<String>)>,
    motors: BTreeMap<MotorKey, Reading>,
}

/// The last values of a motor.
#[derive(Debug, Clone, Default)]
pub struct Reading {
    /// When the last one came, by the clock of the node.
    pub came: f64,
    /// Values of a signal in the second before the last one.
    pub rate_hz: f64,
    /// When the values of this second began to be counted, and how many came.
    counted: (f64, u32),
    values: BTreeMap<String, Value>,
}

#[derive(Debug, Clone, Copy)]
struct Value {
    value: f64,
    /// When it was read: seconds since 1970.
    wall: f64,
    came: f64,
}

/// For how long values are counted, in seconds.
const COUNTED: f64 = 1.0;

impl ValueCache {
    /// The clocks of the lines.
    pub fn learn(&mut self, lines: &[Line]) {
        let walls = lines.iter().map(|line| (line.line.clone(), line.wall - line.t));
        self.walls = walls.collect();
    }

    /// What samples of a group are.
    pub fn describe(&mut self, group: Group) {
        let names = group.columns.into_iter().map(|column| column.name).collect();
        self.groups.insert(group.group, ((group.line, group.motor), names));
    }

    /// Takes samples. Gives their motor.
    pub fn take(&mut self, now: f64, data: &Data) -> Option<&MotorKey> {
        let (place, names) = self.groups.get(&data.group)?;
        let (last, offset) = (data.rows().checked_sub(1)?, self.walls.get(&place.0)?);
        let reading = self.motors.entry(place.clone()).or_default();
        let wall = offset + data.t0 + data.columns.first()?.get(last)?;
        for (name, column) in names.iter().zip(data.columns.iter().skip(TIMES)) {
            if let Some(value) = column.get(last) {
                reading.values.insert(name.clone(), Value { value: *value, wall, came: now });
            }
        }
        reading.came = now;
        // Groups of a motor are read equally often; the first one in the order of names is counted.
        if names.first() == reading.values.keys().next() {
            reading.count(now, data.rows());
        }
        Some(place)
    }

    /// Values of a motor since this time of its line may be those of other signals.
    pub fn doubt(&mut self, line: &str, motor: u8, since: f64) {
        let Some(offset) = self.walls.get(line) else { return };
        if let Some(reading) = self.motors.get_mut(&(line.to_owned(), motor)) {
            reading.values.retain(|_, value| value.wall < offset + since);
        }
    }

    /// The values of a joint that are not older than this. `None`: there is none.
    pub fn fresh(&self, joint: &Joint, now: f64, age: f64) -> Option<Reading> {
        let mut reading = self.of(joint)?.clone();
        reading.values.retain(|_, value| now - value.came <= age);
        (!reading.values.is_empty()).then_some(reading)
    }

    /// The last values of a joint.
    pub fn of(&self, joint: &Joint) -> Option<&Reading> {
        self.motors.get(&(joint.line.clone(), joint.motor.number()))
    }
}

impl Reading {
    fn count(&mut self, now: f64, rows: usize) {
        let (since, count) = &mut self.counted;
        *count += rows as u32;
        let seconds = now - *since;
        if seconds >= COUNTED {
            self.rate_hz = f64::from(*count) / seconds;
            self.counted = (now, 0);
        }
    }

    fn value(&self, source: Source) -> Option<f64> {
        let value = self.values.get(&source.to_string())?.value;
        value.is_finite().then_some(value)
    }

    fn sample(&self, source: Source) -> Option<Sample> {
        self.value(source).map(Sample::told)
    }

    /// When the oldest value of a joint was read: seconds since 1970.
    pub fn wall(&self, joint: &Joint) -> Option<f64> {
        let main = Overview::of(joint.motor);
        let sources = [main.speed, main.current].into_iter().chain(main.angle);
        let values = sources.filter_map(|source| self.values.get(&source.to_string()));
        values.map(|value| value.wall).reduce(f64::min)
    }

    /// rad
    pub fn position(&self, joint: &Joint) -> Option<f64> {
        let degrees = self.value(Overview::of(joint.motor).angle?)?;
        Some(joint.position_rad(degrees))
    }

    /// rad/s
    pub fn velocity(&self, joint: &Joint) -> Option<f64> {
        self.value(Overview::of(joint.motor).speed).map(|speed| joint.velocity_rad_per_s(speed))
    }

    /// N·m
    pub fn effort(&self, joint: &Joint) -> Option<f64> {
        joint.effort_nm(self.value(Overview::of(joint.motor).current)?)
    }

    /// The state in a word.
    pub fn state(&self, motor: Motor) -> Option<String> {
        overview::state(&Overview::of(motor), |source| self.sample(source))
    }

    /// The text of the faults, and whether their cause is present.
    pub fn faults(&self, motor: Motor) -> Option<(String, bool)> {
        let sample = self.sample(Overview::of(motor).faults)?;
        let words = overview::faults(motor, sample)?;
        Some((words, overview::is_present(motor, Some(sample))))
    }
}

#[cfg(test)]
pub(super) mod tests {
    use motorlink_telemetry::share::message::Column;

    use super::super::joint::tests::{joint, lines};
    use super::*;

    /// ValueCache with a row of each of these motors.
    pub(in super::super) fn readings(rows: &[(&str, &[(&str, f64)])]) -> ValueCache {
        let mut readings = ValueCache::default();
        let mut lines = lines();
        lines.iter_mut().for_each(|line| (line.t, line.wall) = (10.0, 1_000_010.0));
        readings.learn(&lines);
        for (number, (line, values)) in (0..).zip(rows) {
            let column =
                |(name, _): &(&str, f64)| Column { name: (*name).to_owned(), unit: String::new() };
            readings.describe(Group {
                group: number,
                subscription: 1,
                line: (*line).to_owned(),
                motor: 1,
                columns: values.iter().map(column).collect(),
            });
            let row = [0.5, 0.001].into_iter().chain(values.iter().map(|(_, value)| *value));
            let columns = row.map(|value| vec![f64::NAN, value]).collect();
            let data = Data { group: number, sequence: 0, lost: 0, t0: 20.0, columns };
            assert!(readings.take(100.0, &data).is_some());
        }
        readings
    }

    #[test]
    fn the_last_row_of_a_motor_counts_with_the_time_of_its_line() {
        let arm = joint("arm", "line=rmd0 motor=1");
        let readings =
            readings(&[("rmd0", &[("multi_turn_angle_degrees", 180.0), ("speed_dps", f64::NAN)])]);
        let reading = readings.of(&arm).unwrap();
        assert_eq!(reading.wall(&arm), Some(1_000_020.5));
        assert_eq!(reading.position(&arm), Some(std::f64::consts::PI));
        assert_eq!(reading.velocity(&arm), None);
        assert!(readings.fresh(&arm, 100.4, 0.5).is_some());
        assert!(readings.fresh(&arm, 100.6, 0.5).is_none());
    }

    #[test]
    fn doubtful_values_are_forgotten() {
        let arm = joint("arm", "line=rmd0 motor=1");
        for (since, left) in [(20.4, false), (20.6, true)] {
            let mut readings = readings(&[("rmd0", &[("speed_dps", 1.0)])]);
            readings.doubt("rmd0", 1, since);
            assert_eq!(readings.of(&arm).unwrap().velocity(&arm).is_some(), left);
        }
    }
}
