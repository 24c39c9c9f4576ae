//! Registers: table 3 as typed constants ([`SPEED_MEAS`]) and by number ([`RegisterId`]).
//!
//! ```compile_fail
//! use motorlink_proto::st::register::{self, Writable};
//! fn write<T, A: Writable>(_: register::Register<T, A>, _: T) {}
//! write(register::SPEED_MEAS, 1500); // SPEED_MEAS is read-only: this does not compile
//! ```

mod access;
mod feature;
mod id;
mod index;
mod lookup;
mod plausible;
mod row;
mod shape;
mod table;
mod typed;
mod unit;
mod value;

pub use access::{Access, Origin, Writing};
pub use feature::{Feature, Features};
pub use id::RegisterId;
pub use lookup::segment_values;
pub(in crate::st) use row::{Conversion, Row};
pub use shape::{Shape, Text};
pub use table::*;
pub use typed::{Dac, Never, ReadOnly, ReadWrite, Readable, Register, Writable, WriteOnly};
pub use unit::Unit;
pub use value::{Type, Value};
