//! A write that is read back: what one checksum of 8 bits lets through, two seldom do.

use super::register::{Type, Unit, Writing};
use super::slave::speed;
use super::{Features, Profile, RegisterId, Request};

/// Attempts of a verified write unless told otherwise.
pub const VERIFY_ATTEMPTS: u8 = 3;

/// Why a write is not, or cannot be, verified.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unverified<E> {
    /// The register cannot be written and read back in this profile; nothing was sent.
    NotReadable,
    /// Writing it makes the motor do something, and the drive changes it by itself: repeating the
    /// write is not for a library to decide, and what is read back proves nothing. Nothing was sent.
    Acts,
    /// An exchange failed for good, or failed in the last attempt: nothing is known of the register.
    Exchange(E),
    /// The register has another value after the last attempt.
    Differs {
        /// What it should have.
        expected: i32,
        /// What was read.
        read: i32,
    },
}

/// A register, a value, and what the register reads back when the write was right.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct VerifiedWrite {
    register: RegisterId,
    bytes: [u8; 4],
    size: u8,
    expected: i32,
}

impl VerifiedWrite {
    /// A write to a drive of `profile`. Of `value` the low bytes that the register has are written.
    ///
    /// # Errors
    /// [`Unverified::NotReadable`] and [`Unverified::Acts`].
    pub fn new<E>(
        profile: Profile,
        register: RegisterId,
        value: i32,
    ) -> Result<Self, Unverified<E>> {
        let shape = register.shape().ok_or(Unverified::NotReadable)?;
        let built = Features::NONE.with(shape.feature);
        let Writing::Takes(size) = shape.writing(profile, built) else {
            return Err(Unverified::NotReadable);
        };
        if shape.read_size(profile, built).is_none() {
            return Err(Unverified::NotReadable);
        }
        if acts(register) {
            return Err(Unverified::Acts);
        }
        let kept = shape.ty(profile).fit(value);
        let expected = match shape.unit {
            Unit::Rpm if shape.ty(profile) != Type::F32 => speed(profile, kept),
            _ => kept,
        };
        Ok(VerifiedWrite { register, bytes: value.to_le_bytes(), size, expected })
    }

    /// Writes and reads back until the register has the value, at most `attempts` times (0 counts
    /// as 1); gives the number of the attempt that did it.
    ///
    /// `exchange` does one exchange: `None` is an acknowledge without a value. A write whose
    /// acknowledge does not come is read back all the same: it may have been carried out. `is_final`
    /// says which errors another attempt cannot change, such as a drive that refuses.
    ///
    /// # Errors
    /// [`Unverified::Exchange`] and [`Unverified::Differs`].
    pub fn run<E>(
        &self,
        attempts: u8,
        mut exchange: impl FnMut(&Request<'_>) -> Result<Option<i32>, E>,
        is_final: impl Fn(&E) -> bool,
    ) -> Result<u8, Unverified<E>> {
        let mut verifying = self.begin(attempts);
        loop {
            let outcome = exchange(&verifying.request());
            if let Some(verified) = verifying.step(outcome, &is_final) {
                return verified;
            }
        }
    }

    /// The same without the line, for whoever carries out the exchanges.
    pub fn begin(self, attempts: u8) -> Verifying {
        Verifying { write: self, attempts, attempt: 1, reading: false }
    }
}

/// A verified write under way: carry out [`request`](Self::request) and hand its outcome to
/// [`step`](Self::step), until that gives the end. As [`VerifiedWrite::run`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Verifying {
    write: VerifiedWrite,
    attempts: u8,
    attempt: u8,
    reading: bool,
}

impl Verifying {
    /// What is to be asked now.
    pub fn request(&self) -> Request<'_> {
        let VerifiedWrite { register, bytes, size, .. } = &self.write;
        if self.reading {
            return Request::GetRegister(*register);
        }
        let value = bytes.get(..usize::from(*size)).unwrap_or(bytes);
        Request::SetRegister { register: *register, value }
    }

    /// The request was carried out, or failed; gives how it all ended, if it did.
    pub fn step<E>(
        &mut self,
        outcome: Result<Option<i32>, E>,
        is_final: impl Fn(&E) -> bool,
    ) -> Option<Result<u8, Unverified<E>>> {
        let expected = self.write.expected;
        self.reading = !self.reading;
        let failed = match outcome {
            Err(error) if is_final(&error) => return Some(Err(Unverified::Exchange(error))),
            _ if self.reading => return None,
            Ok(Some(read)) if read == expected => return Some(Ok(self.attempt)),
            Ok(read) => Unverified::Differs { expected, read: read.unwrap_or_default() },
            Err(error) => Unverified::Exchange(error),
        };
        if self.attempt >= self.attempts {
            return Some(Err(failed));
        }
        self.attempt = self.attempt.saturating_add(1);
        None
    }
}

/// Registers through which a drive is commanded: it acts on a write, changes them by itself, or
/// addresses another motor from then on.
fn acts(register: RegisterId) -> bool {
    matches!(
        register,
        RegisterId::TARGET_MOTOR
            | RegisterId::CONTROL_MODE
            | RegisterId::TORQUE_REF
            | RegisterId::FLUX_REF
            | RegisterId::RAMP_FINAL_SPEED
    )
}
