//! Which signals are recorded, and how often.

use motorlink_proto::st::RegisterId;
use motorlink_proto::time::Micros;
use motorlink_telemetry::signal::{Motor, Quantity, Signal, Source, UnknownSignal};

/// Signals of a line that are read with the same period.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Group {
    /// The period.
    pub period: Micros,
    /// Whether these are the slower ones of a set.
    pub is_slow: bool,
    /// The signals of each motor.
    pub motors: Vec<(Motor, Vec<Signal>)>,
}

/// The period of signals that change within seconds.
const SLOW: Micros = Micros(500_000);

/// What is read without a choice: what changes fast, what changes slowly. Each is few exchanges.
const ST: [&[RegisterId]; 2] = [
    &[
        RegisterId::STATUS,
        RegisterId::FLAGS,
        RegisterId::SPEED_REF,
        RegisterId::SPEED_MEAS,
        RegisterId::TORQUE_MEAS,
    ],
    &[RegisterId::BUS_VOLTAGE, RegisterId::HEATS_TEMP],
];
const RMD: [&[&str]; 2] = [
    &["multi_turn_angle_degrees", "speed_dps", "iq_amps"],
    &["errors", "voltage_volts", "temperature_celsius"],
];

/// Checks that at least one of the motors has each signal.
///
/// # Errors
/// No motor has it.
pub fn check(motors: &[Motor], names: &[String]) -> Result<(), UnknownSignal> {
    for name in names {
        let found = motors.iter().map(|motor| Signal::named(*motor, name));
        if let Some(Err(error)) = found.reduce(Result::or) {
            return Err(error);
        }
    }
    Ok(())
}

/// The signals of motors of one line: those that are named and that the motors have, or a set that fits
/// most uses.
pub fn choose(motors: &[Motor], names: &[String], period: Micros) -> Vec<Group> {
    let group = |is_slow: bool, signals: &dyn Fn(Motor) -> Vec<Signal>| {
        let period = if is_slow { period.max(SLOW) } else { period };
        let motors = motors.iter().map(|motor| (*motor, signals(*motor)));
        let motors = motors.filter(|(_, signals)| !signals.is_empty()).collect();
        Group { period, is_slow, motors }
    };
    match names.is_empty() {
        true => [false, true].map(|slow| group(slow, &|motor| usual(motor, slow.into()))).to_vec(),
        false => vec![group(false, &|motor| named(motor, names))],
    }
}

fn named(motor: Motor, names: &[String]) -> Vec<Signal> {
    let mut signals: Vec<Signal> = Vec::new();
    for signal in names.iter().filter_map(|name| Signal::named(motor, name).ok()) {
        if !signals.contains(&signal) {
            signals.push(signal);
        }
    }
    signals
}

fn usual(motor: Motor, set: usize) -> Vec<Signal> {
    let sources: Vec<Source> = match motor {
        Motor::St(_) => ST[set].iter().copied().map(Source::Register).collect(),
        Motor::Rmd(_) => {
            let quantity = |name: &&str| Quantity::named(name).map(Source::Quantity).ok();
            RMD[set].iter().filter_map(quantity).collect()
        }
    };
    sources.into_iter().map(|source| Signal { motor, source }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use motorlink_proto::rmd::MotorId;
    use motorlink_proto::st::MotorNumber;

    fn motors() -> [Motor; 2] {
        [Motor::St(MotorNumber::FIRST), Motor::Rmd(MotorId::new(3).unwrap())]
    }

    #[test]
    fn the_usual_signals_exist() {
        for motor in motors() {
            let groups = choose(&[motor], &[], Micros(10_000));
            let counts: Vec<_> = groups.iter().map(|it| it.motors[0].1.len()).collect();
            let names = |set: usize| match motor {
                Motor::St(_) => ST[set].len(),
                Motor::Rmd(_) => RMD[set].len(),
            };
            assert_eq!(counts, [names(0), names(1)]);
            assert_eq!((groups[0].period, groups[1].period), (Micros(10_000), SLOW));
        }
    }

    #[test]
    fn a_name_is_for_the_motors_that_have_it() {
        let names = ["speed_dps", "SPEED_MEAS", "speed_dps"].map(str::to_owned);
        assert_eq!(check(&motors(), &names), Ok(()));
        let [group] = &choose(&motors(), &names, SLOW)[..] else { panic!("one group") };
        let signals: Vec<_> = group.motors.iter().map(|(_, signals)| signals.len()).collect();
        assert_eq!(signals, [1, 1]);
        let wrong = check(&motors(), &["sped".to_owned()]).unwrap_err();
        assert!(matches!(wrong, UnknownSignal::Quantity(name) if name == "sped"));
    }
}
