//! Refusals of registers, explained with the table of registers.

use motorlink::st::register::{Access, Origin, Writing};
use motorlink::st::{
    Error, ErrorCode, Failure as ExchangeFailure, Feature, Features, Profile, RegisterId,
};

use crate::failure::Failure;

/// Why a register cannot be read or written, and what to try.
pub struct Known {
    pub fact: String,
    pub advice: Option<String>,
}

/// Whether an error is about the register, not about the motor or the line. A reply with the size of the
/// other profile is about the register.
pub fn is_about_register(error: &Error) -> bool {
    match error {
        Error::Refused { code, .. } => *code != ErrorCode::BadMotorSelected,
        Error::Failed { failure, .. } => {
            matches!(failure, ExchangeFailure::Size { fits: Some(_), .. })
        }
        _ => false,
    }
}

/// A refusal to read a register.
pub fn of_read(error: Error, register: RegisterId, profile: Profile) -> Failure {
    explained(error, unread(register, profile))
}

/// Why a drive refused to read a register, if the error is about the register and the tables say why.
pub fn reason_of_read(error: &Error, register: RegisterId, profile: Profile) -> Option<String> {
    let known = unread(register, profile).filter(|_| is_about_register(error));
    known.map(|known| known.fact)
}

/// Why a drive does not read the register.
fn unread(register: RegisterId, profile: Profile) -> Option<Known> {
    unreadable(register, profile).or_else(|| built_without(register))
}

/// A refusal to write a register.
pub fn of_write(error: Error, register: RegisterId, profile: Profile) -> Failure {
    explained(error, unwritable(register, profile).or_else(|| built_without(register)))
}

fn explained(error: Error, known: Option<Known>) -> Failure {
    let (Error::Refused { port, motor, request, code, .. }, Some(Known { fact, advice })) =
        (&error, known)
    else {
        return error.into();
    };
    let message = format!("{port}: {motor} refused {request}: {code}: {fact}");
    let failure = Failure::from(error).saying(message);
    advice.into_iter().fold(failure, Failure::trying)
}

/// Why no drive of this profile can read the register; `None` if one can, or if the register is unknown.
pub fn unreadable(register: RegisterId, profile: Profile) -> Option<Known> {
    let shape = register.shape()?;
    let features = Features::NONE.with(shape.feature);
    let is_readable = |profile| shape.read_size(profile, features).is_some();
    if is_readable(profile) {
        return None;
    }
    let other = profile.other();
    match (shape.access, profile) {
        (Access::Dac, Profile::Spec) => Some(Known {
            fact: format!("{register} has access D, it is read in data segments only"),
            advice: Some(format!("use `st segment {register}`")),
        }),
        (Access::Dac, Profile::Mcsdk54) => Some(Known {
            fact: format!("{register} has access D, this profile shows it on a DAC channel only"),
            advice: Some(format!("`st set DAC_OUT1 {register}` shows it on channel 1")),
        }),
        (Access::Never, _) => Some(Known {
            fact: format!("firmware names {register}, and neither reads nor writes it"),
            advice: None,
        }),
        _ if is_readable(other) => Some(Known {
            fact: match shape.access {
                Access::WriteOnly => format!("{register} is write-only in the document"),
                _ => format!("profile {} does not read {register}", profile.name()),
            },
            advice: Some(advice_profile(other)),
        }),
        _ => Some(Known { fact: format!("{register} is write-only"), advice: None }),
    }
}

/// Why no drive of this profile can write the register; `None` as above.
fn unwritable(register: RegisterId, profile: Profile) -> Option<Known> {
    let shape = register.shape()?;
    let is_writable = |profile| {
        matches!(shape.writing(profile, Features::NONE.with(shape.feature)), Writing::Takes(_))
    };
    let other = profile.other();
    if is_writable(profile) {
        return None;
    }
    let fact = match (shape.access, shape.origin) {
        (_, Origin::Firmware) if is_writable(other) => {
            format!("profile {} has no register {register}", profile.name())
        }
        _ => format!("{register} cannot be written, its access is {}", shape.access.name()),
    };
    Some(Known { fact, advice: is_writable(other).then(|| advice_profile(other)) })
}

/// A drive has the register only if it was built for it.
fn built_without(register: RegisterId) -> Option<Known> {
    let feature = register.shape()?.feature;
    (feature != Feature::Core).then(|| Known {
        fact: format!("{register} exists only in drives that are built with: {}", feature.name()),
        advice: None,
    })
}

fn advice_profile(profile: Profile) -> String {
    format!("add --profile {} if the drive speaks it", profile.name())
}
