//! Cases on a motor.

use std::borrow::Cow;

use motorlink_proto::rmd::Code;

use super::harness::Harness;
use crate::case::{Case, Stop};

/// Ids of clauses.
pub(super) type Clauses = &'static [&'static str];

/// A case on a motor.
pub(super) fn case(
    name: impl Into<Cow<'static, str>>,
    clauses: Clauses,
    run: impl Fn(&mut Harness) -> Result<(), Stop> + 'static,
) -> Case<Harness> {
    Case::new(name, clauses, run)
}

/// The name of a case about a command.
pub(super) fn subject(name: &str, code: Code) -> String {
    format!("{name}[{:#04X}]", u8::from(code))
}
