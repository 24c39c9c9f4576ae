//! What is printed.

use serde_json::Value;

pub fn line(value: Value) {
    println!("{value}");
}

pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
