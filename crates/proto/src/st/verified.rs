//! Writes that are read back. An 8-bit checksum misses some errors; two exchanges rarely both miss.

use super::register::{Type, Unit, Writing};
use super::slave::speed;
use super::{Effect, Features, Profile, RegisterId, Request};

/// Default number of attempts of a verified write.
pub const VERIFY_ATTEMPTS: u8 = 3;

/// Why a write was not verified.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unverified<E> {
    /// The register cannot be written and read back in this profile. Nothing was sent.
    NotReadable,
    /// Writing the register makes the motor act, and the drive changes the register itself. A
    /// library must not repeat such a write, and reading it back proves nothing. Nothing was sent.
    Acts,
    /// An exchange failed finally, or failed in the last attempt. The value of the register is
    /// unknown.
    Exchange(E),
    /// The register has another value after the last attempt.
    Differs {
        /// The expected value.
        expected: i32,
        /// The value that was read.
        read: i32,
    },
}

/// A register, a value, and the value that the register reads back after a correct write.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct VerifiedWrite {
    register: RegisterId,
    bytes: [u8; 4],
    size: u8,
    expected: i32,
}

impl VerifiedWrite {
    /// A write to a drive of `profile`. Only the low bytes of `value` that the register has are
    /// written.
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
        if register.effect() != Effect::None {
            return Err(Unverified::Acts);
        }
        let kept = shape.ty(profile).fit(value);
        let expected = match shape.unit {
            Unit::Rpm if shape.ty(profile) != Type::F32 => speed(profile, kept),
            _ => kept,
        };
        Ok(VerifiedWrite { register, bytes: value.to_le_bytes(), size, expected })
    }

    /// What the register reads back when the write was right.
    pub fn expected(&self) -> i32 {
        self.expected
    }

    /// Writes and reads back until the register has the value, at most `attempts` times (0 counts
    /// as 1). Returns the number of the successful attempt.
    ///
    /// `exchange` performs one exchange; `None` is an acknowledge without a value. If a write is
    /// not acknowledged, it may have been carried out, so the register is read back as well.
    /// `is_final` returns whether another attempt cannot change an error; a refusal is such an
    /// error.
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

    /// The same without a callback: the caller performs the exchanges.
    pub fn begin(self, attempts: u8) -> Verifying {
        Verifying { write: self, attempts, attempt: 1, reading: false }
    }
}

/// A verified write in progress. Perform [`request`](Self::request) and pass the result to
/// [`step`](Self::step), until that returns the outcome. See [`VerifiedWrite::run`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Verifying {
    write: VerifiedWrite,
    attempts: u8,
    attempt: u8,
    reading: bool,
}

impl Verifying {
    /// The next request.
    pub fn request(&self) -> Request<'_> {
        let VerifiedWrite { register, bytes, size, .. } = &self.write;
        if self.reading {
            return Request::GetRegister(*register);
        }
        let value = bytes.get(..usize::from(*size)).unwrap_or(bytes);
        Request::SetRegister { register: *register, value }
    }

    /// Takes the result of the request. Returns the outcome if the write is finished.
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
