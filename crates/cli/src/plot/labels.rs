//! Labels of events above the panels: placed so that no line of an event crosses a text.

use motorlink_testbench::scenario::Mark;

use super::style::{LEFT, PLOT, WIDTH, width};

/// Label of the events at one moment.
pub struct Label {
    pub text: String,
    /// Where the line of the moment is, which goes down from the label.
    pub x: i32,
    pub row: i32,
    /// Left end of the text. It is left of the line where the right side has no room.
    pub from: i32,
}

impl Label {
    fn to(&self) -> i32 {
        self.from + width(&self.text)
    }

    /// Whether the line of `other` would cross this text.
    fn is_crossed_by(&self, other: &Label) -> bool {
        other.row < self.row && (self.from - 3..self.to() + 3).contains(&other.x)
    }

    fn overlaps(&self, other: &Label) -> bool {
        self.row == other.row && self.from < other.to() + 10 && other.from < self.to() + 10
    }
}

/// Where a moment of a run is that ends at `end` s.
pub fn place_of(at: f64, end: f64) -> i32 {
    LEFT + (f64::from(PLOT) * at / end).round() as i32
}

/// Places labels of a run that ends at `end` s, in few rows.
pub fn place(marks: &[Mark], end: f64) -> Vec<Label> {
    let mut labels: Vec<Label> = Vec::new();
    for marks in marks.chunk_by(|a, b| a.at == b.at) {
        let words: Vec<&str> = marks.iter().map(|mark| mark.label.as_str()).collect();
        let text = words.join(", ");
        let x = place_of(marks[0].at, end);
        let right = x + 5;
        let from = if right + width(&text) <= WIDTH { right } else { x - 5 - width(&text) };
        let mut label = Label { text, x, row: 0, from };
        let is_free = |label: &Label| {
            let collides = |other: &Label| {
                label.overlaps(other) || label.is_crossed_by(other) || other.is_crossed_by(label)
            };
            !labels.iter().any(collides)
        };
        let rows = labels.iter().map(|other| other.row + 1).max().unwrap_or(0);
        let mut free = (0..=rows).filter(|&row| {
            label.row = row;
            is_free(&label)
        });
        // In a row below all others at most older lines cross it; they are interrupted there.
        label.row = free.next().unwrap_or(rows);
        labels.push(label);
    }
    labels
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mark(at: f64, label: &str) -> Mark {
        Mark { at, label: label.to_owned() }
    }

    #[test]
    fn labels_and_lines_do_not_cross_and_stay_in_the_picture() {
        let marks = [
            mark(0.0, "a long label at the beginning"),
            mark(0.1, "a second event"),
            mark(0.1, "at the same moment"),
            mark(1.0, "under the line of which is text"),
            mark(3.0, "short"),
            mark(6.0, "far away"),
            mark(10.0, "a long label at the end"),
        ];
        let labels = place(&marks, 10.0);
        assert_eq!(labels[1].text, "a second event, at the same moment");
        assert_eq!((labels[0].row, labels[4].from > labels[4].x), (0, true));
        assert!(labels.last().unwrap().from < labels.last().unwrap().x, "turned to the left");
        for (n, a) in labels.iter().enumerate() {
            assert!(a.from >= 0 && a.to() <= WIDTH, "{}", a.text);
            for b in &labels[..n] {
                assert!(
                    !a.overlaps(b) && !a.is_crossed_by(b) && !b.is_crossed_by(a),
                    "{} / {}",
                    a.text,
                    b.text
                );
            }
        }
    }
}
