//! Text of a given width.

use std::borrow::Cow;

use console::{Alignment, measure_text_width, pad_str};

/// Heights of a bar.
const BARS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];

/// Text of exactly this width. If it is cut, it ends with `…`.
pub fn fit(text: &str, width: usize) -> String {
    aligned(text, width, Alignment::Left)
}

/// As [`fit`], right-aligned.
pub fn right(text: &str, width: usize) -> String {
    aligned(text, width, Alignment::Right)
}

fn aligned(text: &str, width: usize, alignment: Alignment) -> String {
    let mark = if width == 0 { "" } else { "…" };
    pad_str(text, width, alignment, Some(mark)).into_owned()
}

/// Text in lines of at most this width. Lines after the first are indented.
pub fn wrapped(text: &str, width: usize) -> Vec<String> {
    flow(text.split_whitespace(), " ", "  ", width)
}

/// `1 message`, `2 messages`.
pub fn counted(count: u64, noun: &str) -> String {
    let plural = if count == 1 { "" } else { "s" };
    format!("{count} {noun}{plural}")
}

/// Whether a text is like a pattern in which `*` is any text and `?` is any letter of one byte.
pub fn is_like(pattern: &str, text: &str) -> bool {
    fn is_like(pattern: &[u8], text: &[u8]) -> bool {
        match (pattern, text) {
            ([], []) => true,
            ([b'*', rest @ ..], _) => (0..=text.len()).any(|taken| is_like(rest, &text[taken..])),
            ([b'?', rest @ ..], [_, after @ ..]) => is_like(rest, after),
            ([letter, rest @ ..], [first, after @ ..]) => letter == first && is_like(rest, after),
            _ => false,
        }
    }
    is_like(pattern.as_bytes(), text.as_bytes())
}

/// A text as a cell of a CSV file: in quotation marks where it needs them.
pub fn csv_cell(text: &str) -> Cow<'_, str> {
    match text.contains([',', '"', '\n']) {
        true => format!("\"{}\"", text.replace('"', "\"\"")).into(),
        false => text.into(),
    }
}

/// Words in lines of at most this width, with `gap` between two words. Lines after the first begin with
/// `indent`.
pub fn flow<W: AsRef<str>>(
    words: impl IntoIterator<Item = W>,
    gap: &str,
    indent: &str,
    width: usize,
) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in words {
        let word = word.as_ref();
        let added = gap.len() + measure_text_width(word);
        match lines.last_mut() {
            None => lines.push(word.to_owned()),
            Some(line) if measure_text_width(line) + added <= width => {
                *line += gap;
                *line += word;
            }
            Some(_) => lines.push(format!("{indent}{word}")),
        }
    }
    lines
}

/// The last `span` values as at most `width` bars. The height of a bar is the largest magnitude of
/// its values, so that a short peak is visible.
pub fn sparkline(
    values: impl DoubleEndedIterator<Item = f64>,
    width: usize,
    span: usize,
) -> String {
    let each = span.div_ceil(width.max(1));
    let magnitudes: Vec<f64> = values.rev().take(each * width).map(f64::abs).collect();
    let bars = magnitudes.chunks(each).rev();
    let heights: Vec<f64> = bars.map(|bar| bar.iter().copied().fold(0.0, f64::max)).collect();
    let most = heights.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    let bar = |height: &f64| {
        let step = (height / most * (BARS.len() - 1) as f64).round() as usize;
        BARS[step.min(BARS.len() - 1)]
    };
    fit(&heights.iter().map(bar).collect::<String>(), width)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_fits_its_place() {
        assert_eq!(fit("25 °C", 7), "25 °C  ");
        assert_eq!(right("25 °C", 7), "  25 °C");
        assert_eq!(fit("FAULT_NOW", 6), "FAULT…");
        assert_eq!(fit("x", 0), "");
        assert_eq!(wrapped("one two three", 7), ["one two", "  three"]);
        assert_eq!(wrapped("unbreakable", 4), ["unbreakable"]);
        assert_eq!(flow(["a 1", "b 2", "c 3"], "  ", "", 8), ["a 1  b 2", "c 3"]);
    }

    #[test]
    fn a_sparkline_has_the_last_values_without_sign() {
        assert_eq!(sparkline([9.0, 0.0, 350.0, -700.0].into_iter(), 3, 3), "▁▅█");
        assert_eq!(sparkline([0.0, 0.0].into_iter(), 3, 3), "▁▁ ");
        assert_eq!(sparkline([].into_iter(), 2, 2), "  ");
        assert_eq!(sparkline([1.0].into_iter(), 0, 2), "");
    }

    #[test]
    fn a_bar_of_several_values_shows_their_peak() {
        assert_eq!(sparkline([9.0, 4.0, 0.0, 0.0, -8.0].into_iter(), 2, 4), "▅█");
        assert_eq!(sparkline([8.0, 0.0, 0.0].into_iter(), 2, 4), "█▁");
    }
}
