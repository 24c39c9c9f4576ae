//! How values of registers are shown and taken.

use motorlink::rmd::Scale;
use motorlink::st::register::Unit;
use motorlink::st::{FullScale, Profile, Reading, RegisterId, parse_value};

use crate::failure::Failure;
use crate::json::Row;

/// How values of registers are shown and taken.
#[derive(Clone, Copy)]
pub struct StUnits {
    pub profile: Profile,
    /// Digits instead of physical values.
    pub raw: bool,
    /// Currents are in A if it is known.
    pub full_scale: Option<FullScale>,
}

impl StUnits {
    /// A register's value as the drive has it.
    pub fn reading(&self, register: RegisterId, bits: i32) -> Reading {
        Reading { register, bits, profile: self.profile }
    }

    /// A register's value as people read it.
    pub fn text(&self, reading: &Reading) -> String {
        match (self.raw, reading.name()) {
            (true, _) => reading.digits().to_string(),
            _ if reading.is_current() => self.current_row(reading.digits()).text,
            (false, Some(name)) if reading.register != RegisterId::TARGET_MOTOR => {
                format!("{name} ({:#x})", reading.digits())
            }
            _ => reading.to_string(),
        }
    }

    /// A current: with --full-scale in A, with its digits behind it.
    pub fn current_row(&self, digits: i64) -> Row {
        Row::current("", digits, self.full_scale)
    }

    /// The digits of a current: of A with --full-scale, otherwise the number itself.
    pub fn current<T: TryFrom<i64>>(&self, current: f64) -> Result<T, Failure> {
        let unfit = |why: String| Failure::usage(format!("{why}; nothing was sent"));
        let digits = match self.full_scale {
            Some(full_scale) => {
                full_scale.scale().wanted(current).map_err(|error| unfit(error.to_string()))?
            }
            None => {
                let whole = Scale::plain(i64::MIN, i64::MAX).wanted(current);
                let whole = whole.ok().filter(|&digits| digits as f64 == current);
                let unit = Unit::S16A.symbol();
                whole.ok_or_else(|| {
                    unfit(format!(
                        "{current} is not a whole number, and a current is in digits, {unit}"
                    ))
                    .trying("for currents in A add --full-scale")
                })?
            }
        };
        let unit = Unit::S16A.symbol();
        T::try_from(digits).map_err(|_| unfit(format!("{digits} {unit} does not fit the message")))
    }

    /// The bits of a value for a register: a current as [`current`](Self::current).
    pub fn bits(&self, register: RegisterId, text: &str) -> Result<i32, Failure> {
        let is_current = self.reading(register, 0).is_current();
        match text.parse::<f64>() {
            Ok(amps) if is_current && self.full_scale.is_some() => {
                Ok(i32::from(self.current::<i16>(amps)?))
            }
            Err(_) if is_current && self.full_scale.is_some() => Err(Failure::usage(format!(
                "`{text}` is not a current: with --full-scale give a number in A; nothing was sent"
            ))),
            _ => Ok(parse_value(register, text, self.profile, self.raw)?),
        }
    }
}
