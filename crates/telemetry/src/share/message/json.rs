//! Texts as JSON.

use serde::Serialize;
use serde::de::DeserializeOwned;

/// A value of a message that is one word.
pub(super) fn word(word: impl Serialize) -> String {
    let word = serde_json::to_value(word).ok();
    word.and_then(|word| Some(word.as_str()?.to_owned())).unwrap_or_default()
}

/// A text that is not a message of this version.
#[derive(Debug, thiserror::Error)]
#[error("not a message of a share: {0}")]
pub struct MessageError(#[from] serde_json::Error);

pub(super) fn is_false(value: &bool) -> bool {
    !value
}

/// A text of either side as JSON.
pub fn encode(message: &impl Serialize) -> Vec<u8> {
    // The messages have string keys and no maps, which is all that could fail.
    serde_json::to_vec(message).unwrap_or_default()
}

/// A text of either side from JSON.
///
/// # Errors
/// It is none.
pub fn decode<M: DeserializeOwned>(payload: &[u8]) -> Result<M, MessageError> {
    Ok(serde_json::from_slice(payload)?)
}
