//! Temperature, voltage, errors, currents (0x9A to 0x9D).

use motorlink_proto::rmd::*;
use motorlink_proto::units::{Celsius, CentiDps, DeciVolts, IqFeedback};

use super::case::case;
use super::harness::Harness;
use crate::case::{Case, Need, ReadAs, Stop};
use crate::reading::{R18, R38};

/// Plausible temperatures: motors at other temperatures do not answer.
const TEMPERATURES: std::ops::RangeInclusive<i8> = -40..=127;
/// Plausible supply voltages, 0.1 V.
const VOLTAGES: std::ops::RangeInclusive<u16> = 50..=1000;
/// Maximum change of the supply between two readings, 0.1 V.
const RIPPLE: u16 = 10;
/// Tolerance of the sum of the three phase currents, 1/64 A. A tenth of the currents is added.
const SENSING: i32 = 32;

pub(super) fn cases() -> Vec<Case<Harness>> {
    let mut cases = vec![
        case("temperature_and_voltage_are_plausible", &["RMD-9A-03", "RMD-9A-04"], |harness| {
            let status = harness.read(ReadStatus)?;
            status_1_can_be(harness, status.temperature, status.voltage)
        }),
        case(
            "the_reply_to_clear_errors_has_the_form_of_status_1",
            &["RMD-9B-04", "RMD-9B-05", "RMD-9B-06"],
            |harness| {
                let before = harness.read(ReadStatus)?;
                if !before.errors.is_empty() {
                    let why =
                        format!("the motor has an error that 0x9B would clear: {}", before.errors);
                    return Err(Stop::Skipped(why));
                }
                let status = harness.read(ClearErrors)?;
                status_1_can_be(harness, status.temperature, status.voltage)?;
                let same = status.voltage.0.abs_diff(before.voltage.0) <= RIPPLE
                    && status.errors.active() == before.errors.active()
                    && status.temperature.0.abs_diff(before.temperature.0) <= 2;
                let Status { temperature, voltage, .. } = before;
                harness.require(same, format!("{temperature}, {voltage} and no error, as in 0x9A"))
            },
        ),
        case("status_2_can_be", &["RMD-9C-03", "RMD-9C-04", "RMD-9C-05"], |harness| {
            let status = harness.read(ReadMotionStatus)?;
            harness.plausible(&status)
        }),
        case(
            "status_1_and_status_2_have_the_same_temperature",
            &["RMD-9C-03", "RMD-9A-03"],
            |harness| {
                let one = harness.read(ReadStatus)?.temperature;
                let two = harness.read(ReadMotionStatus)?.temperature;
                harness.require(one.0.abs_diff(two.0) <= 2, format!("about {one}, as 0x9A has it"))
            },
        ),
        case("phase_currents_sum_to_0", &["RMD-9D-04"], |harness| phases(harness).map(|_| ())),
    ];
    cases.extend(errors());
    cases
}

fn errors() -> Vec<Case<Harness>> {
    vec![
        case(
            "a_fault_is_shown_in_the_error_state",
            &["RMD-9A-05", "RMD-9A-07", "RMD-9A-08"],
            |harness| {
                harness.fault(true)?;
                let status = harness.read(ReadStatus)?;
                let flagged = is_set(status.errors);
                harness
                    .require(flagged, "bit 0 (low voltage) or bit 3 (over temperature) in DATA[7]")
            },
        )
        .needs(&[Need::Fault]),
        case(
            "an_error_stays_while_its_cause_is_present",
            &["RMD-9B-11", "RMD-9B-06", "RMD-9B-08", "RMD-9B-09"],
            |harness| {
                harness.fault(true)?;
                let cleared = harness.read(ClearErrors)?.errors;
                harness.require(is_set(cleared), "the flag still set, in the reply to 0x9B")?;
                let after = harness.read(ReadStatus)?.errors;
                harness.require(is_set(after), "the flag still set, in the reply to 0x9A")
            },
        )
        .needs(&[Need::Fault]),
        case(
            "an_error_is_cleared_when_its_cause_is_gone",
            &["RMD-9B-02", "RMD-9B-06"],
            |harness| {
                harness.fault(true)?;
                harness.read(ReadStatus)?;
                harness.fault(false)?;
                let cleared = harness.read(ClearErrors)?.errors;
                harness.require(!is_set(cleared), "no flag, in the reply to 0x9B")?;
                let after = harness.read(ReadStatus)?.errors;
                harness.require(!is_set(after), "no flag, in the reply to 0x9A")
            },
        )
        .needs(&[Need::Fault]),
        case("while_an_error_is_active_the_motor_stays_off", &["RMD-9A-10"], |harness| {
            harness.gently()?;
            harness.fault(true)?;
            harness.command(SetSpeed { speed: CentiDps(6_000) })?;
            let turned = harness.watch(500, |seen| seen.speed.abs() > 10)?;
            harness.require(!turned, "a motor at rest")
        })
        .needs(&[Need::Spin, Need::Fault])
        .reading(R18),
    ]
}

/// Whether a flag with a meaning is set. The fault that the user can cause determines which one.
fn is_set(errors: Errors) -> bool {
    !errors.is_empty()
}

/// Phase currents, 1/64 A. Checks that their sum is about 0.
pub(super) fn phases(harness: &mut Harness) -> Result<[i32; 3], Stop> {
    let PhaseCurrents { phase_a, phase_b, phase_c } = harness.read(ReadPhaseCurrents)?;
    let currents = [phase_a, phase_b, phase_c].map(|current| i32::from(current.0));
    let sum: i32 = currents.iter().sum();
    let size: i32 = currents.iter().map(|current| current.abs()).sum();
    harness
        .require(sum.abs() <= SENSING + size / 10, "three currents whose sum is about 0")
        .read_as(R38)?;
    Ok(currents)
}

fn status_1_can_be(
    harness: &Harness,
    temperature: Celsius,
    voltage: DeciVolts,
) -> Result<(), Stop> {
    temperature_can_be(harness, temperature)?;
    harness.require(VOLTAGES.contains(&voltage.0), format!("5 V to 100 V, not {voltage}"))
}

fn temperature_can_be(harness: &Harness, temperature: Celsius) -> Result<(), Stop> {
    harness.require(TEMPERATURES.contains(&temperature.0), format!("-40 °C up, not {temperature}"))
}

impl Harness {
    /// Checks that a reply to 0x9C or to a motion command has plausible values.
    pub(super) fn plausible(&self, status: &MotionStatus) -> Result<(), Stop> {
        const MOST: u16 = 2048;
        let MotionStatus { temperature, iq, encoder, .. } = *status;
        temperature_can_be(self, temperature)?;
        let IqFeedback(digits) = iq;
        let current = digits.unsigned_abs() <= MOST;
        self.require(current, format!("a torque current within ±{MOST} digits, not {digits}"))?;
        let turn = self.turn();
        let within = i32::from(encoder) < turn;
        self.require(within, format!("an encoder position of 0 to {}, not {encoder}", turn - 1))
    }
}
