//! Joint states: position, speed and current of motors in the units of robotics tools.

use std::f64::consts::PI;

use motorlink_proto::st::{FullScale, RegisterId};
use motorlink_telemetry::signal::{Quantity, Signal, Source};

use crate::schema::{JointState, Time};

/// Where the values of a joint are among those of a row, and their factors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Joint {
    position: Option<(usize, f64)>,
    velocity: Option<(usize, f64)>,
    effort: Option<(usize, f64)>,
}

const DEGREE: f64 = PI / 180.0;
const RPM: f64 = 2.0 * PI / 60.0;

impl Joint {
    /// Of these signals; `None` if no value of a joint is among them. Currents of ST drives need the full
    /// scale.
    pub fn of(signals: &[Signal], full_scale: Option<FullScale>) -> Option<Self> {
        let first = |sources: &[(Source, f64)]| {
            sources.iter().find_map(|(source, factor)| {
                let at = signals.iter().position(|signal| signal.source == *source)?;
                Some((at, *factor))
            })
        };
        let joint = Joint {
            position: first(&[
                (Source::Register(RegisterId::CURRENT_POSITION), 1.0),
                (quantity("multi_turn_angle_degrees"), DEGREE),
                (quantity("single_turn_angle_degrees"), DEGREE),
            ]),
            velocity: first(&[
                (Source::Register(RegisterId::SPEED_MEAS), RPM),
                (quantity("speed_dps"), DEGREE),
            ]),
            effort: first(&[(quantity("iq_amps"), 1.0)]).or_else(|| {
                // An ST drive does not tell the scale of its currents.
                let digit = full_scale?.scale().digit;
                let currents = [RegisterId::TORQUE_MEAS, RegisterId::I_Q];
                first(&currents.map(|register| (Source::Register(register), digit)))
            }),
        };
        let any = [joint.position, joint.velocity, joint.effort];
        any.into_iter().flatten().next().map(|_| joint)
    }

    /// The message for a row.
    pub fn state(&self, name: &str, stamp: Time, values: &[f64]) -> JointState {
        let value = |column: Option<(usize, f64)>| {
            column.map(|(at, factor)| values[at] * factor).into_iter().collect()
        };
        JointState {
            stamp,
            name: vec![name.to_owned()],
            position: value(self.position),
            velocity: value(self.velocity),
            effort: value(self.effort),
        }
    }
}

fn quantity(name: &str) -> Source {
    Source::Quantity(Quantity::named(name).expect("replies of RMD motors have it"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use motorlink_proto::rmd::MotorId;
    use motorlink_proto::st::MotorNumber;
    use motorlink_telemetry::signal::Motor;

    #[test]
    fn values_are_in_radians_and_amperes() {
        let motor = Motor::Rmd(MotorId::new(1).unwrap());
        let signals = ["iq_amps", "speed_dps", "multi_turn_angle_degrees"]
            .map(|name| Signal::named(motor, name).unwrap());
        let joint = Joint::of(&signals, None).unwrap();
        let state = joint.state("can0_motor1", Time(7), &[1.5, 180.0, -360.0]);
        assert_eq!(
            (state.effort, state.velocity, state.position),
            (vec![1.5], vec![PI], vec![-2.0 * PI])
        );
    }

    #[test]
    fn a_joint_has_what_is_recorded() {
        let motor = Motor::St(MotorNumber::FIRST);
        let signal = |name| Signal::named(motor, name).unwrap();
        let joint =
            Joint::of(&[signal("STATUS"), signal("SPEED_MEAS"), signal("TORQUE_MEAS")], None)
                .unwrap();
        let state = joint.state("st0_motor1", Time(7), &[6.0, 60.0, 7.0]);
        assert_eq!(
            (state.velocity, state.position, state.effort),
            (vec![2.0 * PI], vec![], vec![])
        );
        assert_eq!(Joint::of(&[signal("STATUS"), signal("TORQUE_MEAS")], None), None);
    }

    #[test]
    fn digits_of_a_current_are_amperes_with_the_full_scale() {
        let signal = |name| Signal::named(Motor::St(MotorNumber::FIRST), name).unwrap();
        let full_scale = FullScale::from_amps(16.5).ok();
        for signals in [vec![signal("TORQUE_MEAS")], vec![signal("TORQUE_MEAS"), signal("I_Q")]] {
            let joint = Joint::of(&signals, full_scale).unwrap();
            let state = joint.state("st0_motor1", Time(7), &[-32767.0, 1.0]);
            assert!((state.effort[0] + 16.5).abs() < 1e-9, "{state:?}");
        }
        assert!(Joint::of(&[signal("I_Q")], full_scale).is_some());
    }
}
