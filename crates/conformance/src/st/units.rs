//! Cases of the units and synonyms of table 3, and of the PFC's registers.

use motorlink_proto::Hex;
use motorlink_proto::st::register::Feature;
use motorlink_proto::st::{Profile, RegisterId, Request};

use super::harness::Harness;
use super::messages::empty_segment;
use super::motion;
use crate::case::{Case, Need, ReadAs, Stop};
use crate::reading::{S7, S23, S28};

/// A register, its clauses, its feature, the range of its values at rest, and the range as text.
type Row =
    (RegisterId, &'static [&'static str], Feature, std::ops::RangeInclusive<i32>, &'static str);

const AT_REST: [Row; 6] = [
    (RegisterId::BUS_VOLTAGE, &["ST-4.4-26"], Feature::Core, 0..=1_500, "at most 1500 V"),
    (RegisterId::HEATS_TEMP, &["ST-4.4-27"], Feature::Core, -60..=200, "-60 to 200 °C"),
    (RegisterId::MOTOR_POWER, &["ST-4.4-28"], Feature::Core, -100..=100, "at most 100 W"),
    (RegisterId::PFC_DCBUS_REF, &["ST-4.4-34"], Feature::Pfc, 0..=1_500, "at most 1500 V"),
    (RegisterId::PFC_DCBUS_MEAS, &["ST-4.4-34"], Feature::Pfc, 0..=1_500, "at most 1500 V"),
    (RegisterId::PFC_ACBUS_RMS, &["ST-4.4-36"], Feature::Pfc, 0..=1_000, "at most 1000 V"),
];

/// Registers of table 3 that have a second name.
const SYNONYMS: [(RegisterId, RegisterId); 4] = [
    (RegisterId::I_Q, RegisterId::TORQUE_MEAS),
    (RegisterId::I_D, RegisterId::FLUX_MEAS),
    (RegisterId::I_Q_REF, RegisterId::TORQUE_REF),
    (RegisterId::I_D_REF, RegisterId::FLUX_REF),
];

pub(super) fn cases(profile: Profile) -> Vec<Case<Harness>> {
    let mut cases: Vec<Case<Harness>> = AT_REST
        .into_iter()
        .map(|(register, clauses, feature, range, words)| {
            Case::new(
                format!("a_value_is_in_its_unit[{register}]"),
                clauses,
                move |harness: &mut Harness| {
                    harness.need(feature)?;
                    let value = harness.value(register)?;
                    let held = harness.require(range.contains(&value), format!("ACK with {words}"));
                    // The sign of a value below zero is a reading: table 3 gives the type no sign.
                    if value < 0 { held.read_as(S23) } else { held }
                },
            )
        })
        .collect();
    cases.extend([
        Case::new("shares_are_in_percent", &["ST-4.4-29"], shares),
        Case::new("the_mains_frequency_is_in_tenths_of_a_hertz", &["ST-4.4-35"], mains)
            .reading(S28),
    ]);
    match profile {
        Profile::Spec => cases.extend([
            Case::new(
                "the_speeds_of_the_application_are_in_rpm",
                &["ST-4.4-30"],
                |harness: &mut Harness| {
                    let least = harness.value(RegisterId::MIN_APP_SPEED)?;
                    let most = harness.value(RegisterId::MAX_APP_SPEED)?;
                    let ordered = least <= most && (1..=200_000).contains(&most);
                    harness.require(ordered, format!("ACK with {least} to 200000 rpm"))
                },
            ),
            Case::new("synonyms_have_one_value", &["ST-4.4-32"], synonyms)
                .needs(&[Need::Spin])
                .reading(S7),
        ]),
        Profile::Mcsdk54 => {}
    }
    cases
}

fn shares(harness: &mut Harness) -> Result<(), Stop> {
    harness.need(Feature::FluxWeakening)?;
    let most = match harness.profile() {
        Profile::Spec => 100,
        Profile::Mcsdk54 => 1_000,
    };
    for register in [RegisterId::FLUXWK_BUS, RegisterId::FLUXWK_BUS_MEAS] {
        let value = harness.value(register)?;
        harness.require((0..=most).contains(&value), format!("ACK with at most {most}: 100 %"))?;
    }
    Ok(())
}

/// Mains frequency of any country, or none.
fn mains(harness: &mut Harness) -> Result<(), Stop> {
    harness.need(Feature::Pfc)?;
    let frequency = harness.value(RegisterId::PFC_ACBUS_FREQ)?;
    let held = frequency == 0 || (450..=650).contains(&frequency);
    harness.require(held, "ACK with 450 to 650, or 0 without mains")
}

/// A register with two names has one value. Registers of access D are read only in a data segment.
fn synonyms(harness: &mut Harness) -> Result<(), Stop> {
    empty_segment(harness)?;
    let registers: Vec<u8> = SYNONYMS.iter().flat_map(|(one, other)| [one.0, other.0]).collect();
    harness.done(&Request::ConfigureSegment { segment: 0, registers: &registers })?;
    motion::run(harness)?;
    let payload = harness.acknowledged(&Request::GetSegment(0))?;
    harness.require(payload.len() == 2 * registers.len(), "ACK with 2 bytes a register")?;
    for (pair, (one, other)) in payload.chunks(4).zip(SYNONYMS) {
        let words = format!("{one} as {other}: {}", Hex(&pair[2..]));
        harness.require(pair[..2] == pair[2..], words)?;
    }
    Ok(())
}
