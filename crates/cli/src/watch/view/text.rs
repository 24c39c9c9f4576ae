//! Text of a given width.

/// Heights of a bar.
const BARS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];

/// Text of exactly this width. If it is cut, it ends with `…`.
pub fn fit(text: &str, width: usize) -> String {
    let length = text.chars().count();
    if length <= width {
        return format!("{text:<width$}");
    }
    let kept: String = text.chars().take(width.saturating_sub(1)).collect();
    if width == 0 { kept } else { kept + "…" }
}

/// As [`fit`], right-aligned.
pub fn right(text: &str, width: usize) -> String {
    match text.chars().count() <= width {
        true => format!("{text:>width$}"),
        false => fit(text, width),
    }
}

/// Text in lines of at most this width. Lines after the first are indented.
pub fn wrapped(text: &str, width: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    let mut line = String::new();
    for word in text.split_whitespace() {
        let used = line.chars().count();
        if used > 0 && used + 1 + word.chars().count() > width {
            lines.push(std::mem::replace(&mut line, "  ".to_owned()));
        } else if !line.trim().is_empty() {
            line.push(' ');
        }
        line += word;
    }
    lines.push(line);
    lines
}

/// Words in lines of at most this width, with `gap` between two words.
pub fn flow(words: &[String], gap: &str, width: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in words {
        match lines.last_mut() {
            Some(line) if line.chars().count() + gap.len() + word.chars().count() <= width => {
                *line += gap;
                *line += word;
            }
            _ => lines.push(word.clone()),
        }
    }
    lines
}

/// The last values as bars. The height of a bar is the magnitude of its value.
pub fn sparkline(values: impl ExactSizeIterator<Item = f64>, width: usize) -> String {
    let skipped = values.len().saturating_sub(width);
    let last: Vec<f64> = values.skip(skipped).map(f64::abs).collect();
    let most = last.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    let bar = |value: &f64| {
        let step = (value / most * (BARS.len() - 1) as f64).round() as usize;
        BARS[step.min(BARS.len() - 1)]
    };
    let text: String = last.iter().map(bar).collect();
    fit(&text, width)
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
        let words = ["a 1", "b 2", "c 3"].map(str::to_owned);
        assert_eq!(flow(&words, "  ", 8), ["a 1  b 2", "c 3"]);
    }

    #[test]
    fn a_sparkline_has_the_last_values_without_sign() {
        assert_eq!(sparkline([9.0, 0.0, 350.0, -700.0].into_iter(), 3), "▁▅█");
        assert_eq!(sparkline([0.0, 0.0].into_iter(), 3), "▁▁ ");
        assert_eq!(sparkline([].into_iter(), 2), "  ");
    }
}
