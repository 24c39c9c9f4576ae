//! Text from outside, made safe to show: in a terminal, a picture, a table.

/// Text on one line. Each character that controls a terminal, ends a line, or changes the direction of
/// the text around it becomes U+FFFD.
///
/// For names and texts of drives, devices and files. What is left is valid in XML, too.
pub fn printable(text: &str) -> String {
    text.chars().map(|c| if is_printable(c) { c } else { char::REPLACEMENT_CHARACTER }).collect()
}

/// As [`printable`], for text of several lines: ends of lines and tabs stay.
pub fn printable_lines(text: &str) -> String {
    let stays = |c| is_printable(c) || matches!(c, '\n' | '\t');
    text.chars().map(|c| if stays(c) { c } else { char::REPLACEMENT_CHARACTER }).collect()
}

/// Whether a character only shows itself.
pub fn is_printable(c: char) -> bool {
    let is_format = matches!(c,
        // Marks, embeddings, overrides and isolates of direction; separators of lines.
        '\u{61C}' | '\u{200B}' | '\u{200E}' | '\u{200F}' | '\u{2028}'..='\u{202E}'
        | '\u{2060}'..='\u{206F}' | '\u{FEFF}' | '\u{FFF9}'..='\u{FFFB}' | '\u{E0000}'..='\u{E007F}');
    // XML has no U+FFFE and U+FFFF; the other planes have such characters, too.
    let is_no_character =
        matches!(u32::from(c), 0xFDD0..=0xFDEF) || u32::from(c) & 0xFFFE == 0xFFFE;
    !(c.is_control() || is_format || is_no_character)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_stays_and_control_characters_do_not() {
        let text = "Überdrehzahl 5 °C <&> 東京 ‰ 👩\u{200D}🔧";
        assert_eq!(printable(text), text);
        let controls = "\0\x07\x08\t\n\r\x1B\x7F\u{80}\u{9B}\u{85}\u{2028}\u{202E}\u{2066}\u{FFFF}";
        assert!(printable(controls).chars().all(|c| c == char::REPLACEMENT_CHARACTER));
        assert_eq!(printable(controls).chars().count(), controls.chars().count());
        assert_eq!(printable_lines("a\n\tb\r\x1B[2J"), "a\n\tb\u{FFFD}\u{FFFD}[2J");
    }
}
