//! Ranges of integers.

use serde_json::{Value, json};

/// Both ends are in the range.
pub fn range(least: i64, most: i64) -> Value {
    json!({ "least": least, "most": most })
}
