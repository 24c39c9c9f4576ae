//! The tables as JSON, for other generators. docs/spec.schema.json describes it.

mod payload;
mod range;
mod rmd;
mod st;

use serde_json::{Value, json};

/// The number of the format. It grows if something is renamed, moved or removed, or if its meaning
/// changes. New members do not change it.
pub const FORMAT: u32 = 1;

/// The tables of both protocols.
pub fn json() -> Value {
    json!({ "format": "motorlink-spec", "version": FORMAT, "st": st::tables(), "rmd": rmd::tables() })
}
