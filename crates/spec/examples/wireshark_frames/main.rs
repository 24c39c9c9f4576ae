//! Prints frames of both protocols with what `motorlink-proto` reads in them, one JSON object a line.
//! The tests of the dissector compare it with Wireshark.
//!
//! `set` is the capture, `answers` says that the frame is the reply to the frame before it. `fields`
//! are the fields of the dissector, by name.

mod rmd;
mod st;

use serde_json::Value;

fn main() {
    rmd::frames();
    st::frames();
}

fn line(value: Value) {
    println!("{value}");
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
