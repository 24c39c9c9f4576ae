//! Text that came from outside.

/// The text of a drive or a device, with U+FFFD where a terminal would take it for a command.
pub fn printable(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { char::REPLACEMENT_CHARACTER } else { c }).collect()
}
