//! What is drawn: panels of signals over a common time, and the moments of events.

use std::ops::Range;

use motorlink_testbench::scenario::Mark;

use crate::palette::Meaning;

pub struct Figure<'a> {
    pub title: String,
    /// End of the time axis, s. It begins at 0.
    pub end: f64,
    /// Events with their names.
    pub marks: Vec<Mark>,
    /// Moments of events that are not named, s.
    pub unnamed: Vec<f64>,
    pub signals: Vec<Signal<'a>>,
    pub panels: Vec<Panel>,
}

pub struct Panel {
    pub title: String,
    /// Places of its signals in [`Figure::signals`]: numbers of one unit, or states.
    pub signals: Vec<usize>,
    /// Range of the axis; by default that of the samples.
    pub range: Option<[f64; 2]>,
}

pub struct Signal<'a> {
    pub name: String,
    pub meaning: Meaning,
    pub samples: Samples<'a>,
    /// Of a signal whose values have names: name and meaning of a value.
    pub states: Option<States<'a>>,
}

pub type States<'a> = Box<dyn Fn(f64) -> (String, Meaning) + 'a>;

/// The samples of a signal.
pub struct Samples<'a> {
    pub values: &'a [f64],
    pub times: Times<'a>,
    /// End of the time axis, s.
    pub end: f64,
}

/// When samples were taken.
pub enum Times<'a> {
    /// At equal intervals from 0 to the end.
    Even,
    /// At these times, s. The line is interrupted where two are further apart than `gap`, and where a
    /// value is not drawn.
    At { times: &'a [f64], gap: f64 },
}

/// Whether a value is drawn. Drives have no larger ones, and an axis for all `f64` has no end.
pub fn is_drawn(value: f64) -> bool {
    value.abs() <= f64::from(f32::MAX)
}

impl Samples<'_> {
    /// Where a sample is on an axis of this length.
    pub fn place(&self, n: usize, length: f64) -> f64 {
        match self.times {
            Times::Even => length * n as f64 / (self.values.len() - 1) as f64,
            Times::At { times, .. } => length * times[n] / self.end,
        }
    }

    /// Time of a sample, s.
    pub fn time(&self, n: usize) -> f64 {
        match self.times {
            Times::Even => n as f64 * (self.end / (self.values.len() - 1) as f64),
            Times::At { times, .. } => times[n],
        }
    }

    /// Samples without a gap between them.
    pub fn segments(&self) -> Vec<Range<usize>> {
        let mut segments: Vec<Range<usize>> = Vec::new();
        let Times::At { times, gap } = self.times else {
            segments.push(0..self.values.len());
            return segments;
        };
        for n in (0..self.values.len()).filter(|n| is_drawn(self.values[*n])) {
            match segments.last_mut() {
                Some(last) if last.end == n && times[n] - times[n - 1] <= gap => last.end += 1,
                _ => segments.push(n..n + 1),
            }
        }
        segments
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_interrupted_by_missing_values_and_by_missing_samples() {
        let values = [1.0, 2.0, f64::NAN, 3.0, 4.0, 5.0];
        let times = [0.0, 0.1, 0.2, 0.3, 1.0, 1.1];
        let samples =
            Samples { values: &values, times: Times::At { times: &times, gap: 0.3 }, end: 2.0 };
        assert_eq!(samples.segments(), [0..2, 3..4, 4..6]);
        assert_eq!((samples.time(4), samples.place(4, 100.0)), (1.0, 50.0));
        let even = Samples { values: &values, times: Times::Even, end: 2.0 };
        assert_eq!(even.segments().len(), 1);
        assert_eq!((even.time(5), even.place(0, 100.0)), (2.0, 0.0));
    }
}
