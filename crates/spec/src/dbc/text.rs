//! Texts as a DBC file has them.

/// The text in quotation marks.
pub fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('"', "'"))
}

/// The text with words for the symbols of units.
pub fn ascii(text: &str) -> String {
    let mut ascii = String::with_capacity(text.len());
    for letter in text.chars() {
        match letter {
            '°' if ascii.ends_with(|before: char| before.is_ascii_digit()) => ascii += " deg",
            '°' => ascii += "deg",
            '²' => ascii += "^2",
            '±' => ascii += "+-",
            other => ascii.push(other),
        }
    }
    ascii
}
