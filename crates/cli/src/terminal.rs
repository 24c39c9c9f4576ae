//! The last look at a line before it is printed.

use std::borrow::Cow;
use std::fmt::Write;

use motorlink_link::is_printable;

/// Text without characters that control a terminal, except ends of lines, tabs and the colours of this
/// program. In a line of JSON such a character becomes an escape, so that its value stays.
pub fn safe(text: &str) -> Cow<'_, str> {
    if text.chars().all(|c| is_printable(c) || matches!(c, '\n' | '\t')) {
        return Cow::Borrowed(text);
    }
    let is_json = text.starts_with('{');
    let mut out = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(c) = rest.chars().next() {
        let colour = colour(rest);
        let (shown, behind) = rest.split_at(colour.unwrap_or(c.len_utf8()));
        rest = behind;
        match c {
            _ if colour.is_some() || is_printable(c) || matches!(c, '\n' | '\t') => out += shown,
            _ if is_json => {
                for unit in c.encode_utf16(&mut [0; 2]) {
                    // Writing to a string does not fail.
                    let _ = write!(out, "\\u{unit:04x}");
                }
            }
            _ => out.push(char::REPLACEMENT_CHARACTER),
        }
    }
    Cow::Owned(out)
}

/// Length of the colour sequence with which a text begins, in the form that `console` writes.
fn colour(text: &str) -> Option<usize> {
    let parameters = text.strip_prefix("\x1B[")?;
    let end = parameters.find(|c: char| !c.is_ascii_digit() && c != ';')?;
    parameters[end..].starts_with('m').then_some("\x1B[".len() + end + "m".len())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_pass_and_other_sequences_do_not() {
        let coloured = "\x1B[31m\x1B[1merror:\x1B[0m ü\n\tb";
        assert_eq!(safe(coloured), coloured);
        assert_eq!(
            safe("a\x1B[2Jb\x1B]0;title\x07c\rd"),
            "a\u{FFFD}[2Jb\u{FFFD}]0;title\u{FFFD}c\u{FFFD}d"
        );
        assert_eq!(safe("\x1B[31"), "\u{FFFD}[31");
        assert_eq!(safe("\u{202E}x\u{9B}2J"), "\u{FFFD}x\u{FFFD}2J");
    }

    #[test]
    fn json_keeps_its_value() {
        let object = serde_json::json!({ "name": "\u{9B}2J \u{202E} \u{E0001} \x1B[31m ü" });
        let line = object.to_string();
        let shown = safe(&line);
        assert!(shown.chars().all(is_printable), "{shown}");
        assert_eq!(serde_json::from_str::<serde_json::Value>(&shown).unwrap(), object);
    }
}
