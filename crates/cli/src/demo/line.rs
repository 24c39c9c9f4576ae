//! A line of the demo: text in parts, each with its ink.

/// How a part of a line looks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ink {
    Plain,
    Dim,
    Bold,
    /// A motor that turns.
    Running,
    /// A motor with a fault.
    Fault,
}

#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Line(Vec<(Ink, String)>);

impl Line {
    pub fn new(ink: Ink, text: impl Into<String>) -> Self {
        Line(vec![(ink, text.into())])
    }

    pub fn plain(text: &str) -> Self {
        Line::new(Ink::Plain, text)
    }

    pub fn push(&mut self, ink: Ink, text: &str) {
        self.0.push((ink, text.to_owned()));
    }

    pub fn parts(&self) -> impl Iterator<Item = (Ink, &str)> {
        self.0.iter().map(|(ink, text)| (*ink, text.as_str()))
    }

    /// Characters; each takes a column.
    pub fn width(&self) -> usize {
        self.0.iter().map(|(_, text)| text.chars().count()).sum()
    }

    /// The first `width` characters.
    pub fn cut(&self, width: usize) -> Line {
        let mut room = width;
        let mut parts = Vec::new();
        for (ink, text) in &self.0 {
            let kept: String = text.chars().take(room).collect();
            room -= kept.chars().count();
            parts.push((*ink, kept));
        }
        Line(parts)
    }
}

/// Breaks a line between words so that no part is wider than `width`. The parts behind the first are
/// indented. A word that is wider is cut on a terminal of its own width only.
pub fn wrap(line: &Line, width: usize, indent: usize) -> Vec<Line> {
    if line.width() <= width {
        return vec![line.clone()];
    }
    let mut done = Vec::new();
    let (mut now, mut column, mut is_empty) = (Line::default(), 0, true);
    for (ink, text) in line.parts() {
        for word in text.split_inclusive(' ') {
            let bare = word.trim_end().chars().count();
            if column + bare > width && !is_empty {
                done.push(std::mem::replace(&mut now, Line::plain(&" ".repeat(indent))));
                (column, is_empty) = (indent, true);
            }
            is_empty &= bare == 0 || column < indent;
            column += word.chars().count();
            now.push(ink, word);
        }
    }
    done.push(now);
    done.iter().map(|line| line.cut(width)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texts(lines: &[Line]) -> Vec<String> {
        lines.iter().map(|line| line.parts().map(|(_, text)| text).collect()).collect()
    }

    #[test]
    fn lines_break_between_words_and_keep_their_ink() {
        let mut line = Line::new(Ink::Dim, "  1.0 s  ");
        line.push(Ink::Bold, "a ramp to 1500 rpm");
        assert_eq!(wrap(&line, 80, 9), [line.clone()]);
        let broken = wrap(&line, 20, 9);
        assert_eq!(texts(&broken), ["  1.0 s  a ramp to ", "         1500 rpm"]);
        assert_eq!(broken[1].parts().last(), Some((Ink::Bold, "rpm")));
        for width in 1..30 {
            assert!(wrap(&line, width, 9).iter().all(|line| line.width() <= width), "{width}");
        }
    }
}
