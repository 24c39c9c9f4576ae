//! Deviations of table 3's units and synonyms, and of the PFC's registers.

use motorlink_proto::st::RegisterId;

use super::{Mutant, caught, gives, mutant};
use crate::peer::Deviation;

const GET: u8 = 0x02;
const DATA_ELEMENT: u8 = 0x0D;

/// Changes the value read from a 16-bit register.
fn reads(register: RegisterId, change: fn(i16) -> i16) -> Deviation {
    gives(GET, move |asked, value| {
        if asked == [register.0] && value.len() == 2 {
            *value = change(i16::from_le_bytes([value[0], value[1]])).to_le_bytes().to_vec();
        }
    })
}

/// Swaps the reads of two registers.
fn swapped(one: RegisterId, other: RegisterId) -> Deviation {
    super::takes(GET, move |_, payload| {
        for id in payload {
            if *id == one.0 {
                *id = other.0;
            } else if *id == other.0 {
                *id = one.0;
            }
        }
    })
}

const MUTANTS: [Mutant; 11] = [
    mutant("the bus voltage is in tenths of a volt", "ST-4.4-26", || {
        reads(RegisterId::BUS_VOLTAGE, |volts| volts.saturating_mul(10))
    }),
    mutant("the temperature is in tenths of a degree", "ST-4.4-27", || {
        reads(RegisterId::HEATS_TEMP, |celsius| celsius.saturating_mul(10))
    }),
    mutant("the power has an offset", "ST-4.4-28", || {
        reads(RegisterId::MOTOR_POWER, |watts| watts + 273)
    }),
    mutant("shares are in tenths of a percent", "ST-4.4-29", || {
        reads(RegisterId::FLUXWK_BUS, |percent| percent.saturating_mul(10))
    }),
    mutant("the least and the greatest speed are swapped", "ST-4.4-30", || {
        swapped(RegisterId::MIN_APP_SPEED, RegisterId::MAX_APP_SPEED)
    }),
    mutant("TORQUE_REF is the Id reference", "ST-4.4-31", || {
        swapped(RegisterId::TORQUE_REF, RegisterId::FLUX_REF)
    }),
    mutant("I_Q is not TORQUE_MEAS", "ST-4.4-32", || {
        gives(DATA_ELEMENT, |_, values| {
            if let [low, ..] = &mut values[..] {
                *low ^= 0x40;
            }
        })
    }),
    mutant("PFC_ENABLED is 2", "ST-4.4-33", || {
        gives(GET, |asked, value| {
            if asked == [RegisterId::PFC_ENABLED.0] {
                value[0] *= 2;
            }
        })
    }),
    mutant("the PFC's voltage is in tenths of a volt", "ST-4.4-34", || {
        reads(RegisterId::PFC_DCBUS_MEAS, |volts| volts.saturating_mul(10))
    }),
    mutant("the mains frequency is in hertz", "ST-4.4-35", || {
        reads(RegisterId::PFC_ACBUS_FREQ, |frequency| frequency / 10)
    }),
    mutant("the mains voltage is in tenths of a volt", "ST-4.4-36", || {
        reads(RegisterId::PFC_ACBUS_RMS, |volts| volts.saturating_mul(10))
    }),
];

#[test]
fn units() {
    caught(&MUTANTS.map(Mutant::spinning));
}
