//! Values to write into registers of a motor at rest.

use motorlink_proto::st::register::{Type, Unit};
use motorlink_proto::st::{Profile, RegisterId};

/// Values that differ from the present one, are harmless at rest, and have different bytes.
pub(super) fn samples(profile: Profile, register: RegisterId, before: &[u8]) -> Vec<i32> {
    let before = register.decode(profile, before).unwrap_or(0);
    let Some(shape) = register.shape() else { return Vec::new() };
    let values: &[i32] = match register {
        RegisterId::CONTROL_MODE => &[0, 1, 0],
        RegisterId::RAMP_FINAL_SPEED => &[0x0640 / 6 * 6, -1_002, 70_002],
        RegisterId::DAC_OUT1 | RegisterId::DAC_OUT2 => &[0x25, 0x28],
        // Near the present value: a drive whose bus is under voltage must not get another
        // reference.
        RegisterId::PFC_DCBUS_REF => return vec![before + 1, before - 1],
        _ => match (shape.ty(profile), shape.unit) {
            (_, Unit::Percent) if profile == Profile::Spec => &[50, 91],
            (_, Unit::Percent) => &[500, 915],
            (Type::F32, _) => &[0x3FC0_0000, 0x4049_0FDB],
            (Type::I8 | Type::U8, _) => &[1, 3],
            (Type::U16, _) => &[0x0123, 0x0216],
            (Type::I16, _) => &[0x0123, -0x0216],
            (Type::U32, _) => &[0x0001_2340, 0x0000_1230],
            (Type::I32, _) => &[0x0001_2345, -0x0002_3456],
        },
    };
    let kept = |&value: &i32| match shape.unit {
        Unit::Rpm if shape.ty(profile) != Type::F32 => as_kept(profile, value),
        _ => value,
    };
    values.iter().map(kept).collect()
}

/// A speed as the drive shows it: shipped firmware stores tenths of a hertz (SPEC-NOTES S12).
pub(super) fn as_kept(profile: Profile, rpm: i32) -> i32 {
    match profile {
        Profile::Spec => rpm,
        Profile::Mcsdk54 => rpm / 6 * 6,
    }
}
