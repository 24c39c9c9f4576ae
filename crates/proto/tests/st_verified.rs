//! Writes that are read back.

use crate::common::{Memory, SlaveFixture};
use motorlink_proto::st::*;

const KP: RegisterId = RegisterId::SPEED_KP;

#[derive(Debug, Clone, Copy, PartialEq)]
enum Trouble {
    /// The request does not reach the drive.
    Lost,
    /// The reply is lost.
    Unheard,
    /// The drive stores another value.
    Other(i32),
}

/// A verified write on a line with the given fault in each exchange.
fn write(
    bench: &mut SlaveFixture,
    (register, value): (RegisterId, i32),
    attempts: u8,
    troubles: &[Option<Trouble>],
) -> (Result<u8, Unverified<ErrorCode>>, usize) {
    let mut exchanges = 0;
    let profile = bench.slave.profile();
    let verified = match VerifiedWrite::new(profile, register, value) {
        Ok(verified) => verified,
        Err(error) => return (Err(error), 0),
    };
    let result = verified.run(
        attempts,
        |request| {
            let trouble = troubles.get(exchanges).copied().flatten();
            exchanges += 1;
            let answer = match trouble {
                Some(Trouble::Lost) => return Err(ErrorCode::Timeout),
                Some(Trouble::Other(value)) => {
                    bench.drive.set(1, register, value);
                    return Ok(None);
                }
                Some(Trouble::Unheard) | None => bench.ask(1, *request),
            };
            if trouble.is_some() {
                return Err(ErrorCode::Timeout);
            }
            answer.map(|payload| register.decode(profile, &payload))
        },
        |code| *code != ErrorCode::Timeout,
    );
    (result, exchanges)
}

fn bench(profile: Profile) -> SlaveFixture {
    SlaveFixture::new(profile, 2, Memory::with(crate::common::all_features()))
}

#[test]
fn a_lost_write_is_repeated_and_an_executed_one_is_not() {
    let lost = Some(Trouble::Lost);
    let mut first = bench(Profile::Spec);
    assert_eq!(write(&mut first, (KP, 9), 3, &[lost]), (Ok(2), 4));
    let mut unheard = bench(Profile::Spec);
    assert_eq!(write(&mut unheard, (KP, 9), 3, &[Some(Trouble::Unheard)]), (Ok(1), 2));
    let mut unread = bench(Profile::Spec);
    assert_eq!(write(&mut unread, (KP, 9), 3, &[None, lost]), (Ok(2), 4));
}

#[test]
fn a_corrupted_value_is_corrected_or_reported() {
    let other = Some(Trouble::Other(5));
    let mut righted = bench(Profile::Spec);
    assert_eq!(write(&mut righted, (KP, 9), 3, &[other]), (Ok(2), 4));
    let mut stubborn = bench(Profile::Spec);
    let differs = Unverified::Differs { expected: 9, read: 5 };
    let always = [other, None].repeat(3);
    assert_eq!(write(&mut stubborn, (KP, 9), 3, &always), (Err(differs), 6));
    let mut dead = bench(Profile::Spec);
    let failed = Err(Unverified::Exchange(ErrorCode::Timeout));
    assert_eq!(write(&mut dead, (KP, 9), 0, &[Some(Trouble::Lost); 9]), (failed, 2));
}

#[test]
fn a_drive_that_refuses_is_not_asked_again() {
    let mut bench = SlaveFixture::new(Profile::Spec, 1, Memory::with(Features::NONE));
    let refused = Err(Unverified::Exchange(ErrorCode::SetReadOnly));
    assert_eq!(write(&mut bench, (RegisterId::PFC_I_KP, 1), 3, &[]), (refused, 1));
}

#[test]
fn a_value_that_the_profile_rounds_is_compared_with_its_rounded_value() {
    let mut bench = bench(Profile::Mcsdk54);
    for (register, value, kept) in [
        (RegisterId::SC_NOMINAL_SPEED, 1000, 996),
        (RegisterId::OBSERVER_C1, -5, -5),
        (RegisterId::FLUXWK_BUS, 985, 985),
        (RegisterId::IQ_SPEEDMODE, -300, -300),
    ] {
        assert_eq!(write(&mut bench, (register, value), 1, &[]), (Ok(1), 2), "{register}");
        assert_eq!(bench.drive.value(1, register), kept, "{register}");
    }
}

/// Every register that can be verified reads back the written value, and no other is written.
#[test]
fn every_register_is_verified_or_returns_the_reason() {
    for profile in [Profile::Spec, Profile::Mcsdk54] {
        let mut verified = 0;
        for id in 0..=255 {
            let register = RegisterId(id);
            let mut bench = bench(profile);
            let value = match register {
                RegisterId::DAC_OUT1 | RegisterId::DAC_OUT2 => RegisterId::I_ALPHA.0.into(),
                _ => 0x55,
            };
            match write(&mut bench, (register, value), 2, &[]) {
                (Ok(1), 2) => verified += 1,
                (Err(Unverified::NotReadable | Unverified::Acts), 0) => {
                    assert!(bench.drive.registers.is_empty() && bench.drive.log.is_empty());
                }
                other => panic!("{register} in {profile:?}: {other:?}"),
            }
        }
        assert!(verified > 30, "{verified} in {profile:?}");
    }
}

#[test]
fn a_write_that_acts_on_the_motor_is_not_repeated() {
    for register in [
        RegisterId::TARGET_MOTOR,
        RegisterId::CONTROL_MODE,
        RegisterId::RAMP_FINAL_SPEED,
        RegisterId::TORQUE_REF,
        RegisterId::FLUX_REF,
    ] {
        let refused = VerifiedWrite::new::<()>(Profile::Spec, register, 1);
        assert_eq!(refused, Err(Unverified::Acts), "{register}");
    }
    let unreadable = VerifiedWrite::new::<()>(Profile::Spec, RegisterId::IQ_SPEEDMODE, 1);
    assert_eq!(unreadable, Err(Unverified::NotReadable));
}
