//! Samples as points of a line.

use super::figure::{Samples, Signal, is_drawn};

/// Least and greatest value of signals, with some room around.
pub fn whole_range<'a>(signals: impl Iterator<Item = &'a Signal<'a>>) -> [f64; 2] {
    let values = signals.flat_map(|signal| signal.samples.values).filter(|v| is_drawn(**v));
    let range = values.fold(None, |range: Option<[f64; 2]>, &value| {
        let [low, high] = range.unwrap_or([value; 2]);
        Some([low.min(value), high.max(value)])
    });
    let [low, high] = range.unwrap_or([0.0, 1.0]);
    let room = match high - low {
        flat if flat <= 1e-9 * high.abs().max(1e-3) => high.abs().max(1.0) / 2.0,
        span => span * 0.06,
    };
    [low - room, high + room]
}

/// The points of a signal, within the range, a line for each part without a gap: of each pixel's
/// samples those that can be seen. `pixels` is the width.
pub fn thin(samples: &Samples<'_>, low: f64, high: f64, pixels: usize) -> Vec<Vec<(f64, f64)>> {
    let every = samples.values.len().div_ceil(2 * pixels).max(1);
    let mut lines = Vec::new();
    for segment in samples.segments() {
        let column = &samples.values[segment.clone()];
        let mut points = Vec::new();
        for (n, part) in column.chunks(every).enumerate() {
            let order = |a: &usize, b: &usize| part[*a].total_cmp(&part[*b]);
            let least = (0..part.len()).min_by(order);
            let most = (0..part.len()).max_by(order);
            let mut seen = [least, most].map(Option::unwrap_or_default);
            seen.sort_unstable();
            let seen = if seen[0] == seen[1] { &seen[..1] } else { &seen };
            let point = |&k: &usize| {
                (samples.time(segment.start + n * every + k), part[k].clamp(low, high))
            };
            points.extend(seen.iter().map(point));
        }
        lines.push(points);
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::super::figure::Times;
    use super::*;

    #[test]
    fn a_thinned_line_keeps_its_peaks_and_its_order() {
        let mut column: Vec<f64> = (0..100_001).map(|n| f64::from(n % 7)).collect();
        column[12_345] = 50.0;
        column[77_777] = -50.0;
        let samples = Samples { values: &column, times: Times::Even, end: 10.0 };
        let points = thin(&samples, -20.0, 100.0, 860).remove(0);
        assert!(points.len() < 4000);
        assert!(points.is_sorted_by(|a, b| a.0 < b.0));
        assert!(points.contains(&(12_345.0 * 1e-4, 50.0)));
        assert!(points.contains(&(77_777.0 * 1e-4, -20.0)), "the range ends there");
        let few = Samples { values: &[1.0, 2.0, 3.0], times: Times::Even, end: 2.0 };
        assert_eq!(thin(&few, 0.0, 9.0, 860), [[(0.0, 1.0), (1.0, 2.0), (2.0, 3.0)]]);
    }

    #[test]
    fn each_part_between_gaps_keeps_its_peaks() {
        let mut column = vec![0.0; 100_000];
        column[50_000] = f64::NAN;
        column[50_001] = 9.0;
        column[99_999] = -9.0;
        let at: Vec<f64> = (0..100_000).map(f64::from).collect();
        let times = Times::At { times: &at, gap: 3.0 };
        let samples = Samples { values: &column, times, end: 1e5 };
        let lines = thin(&samples, -10.0, 10.0, 800);
        assert_eq!(lines.len(), 2);
        assert!(lines[1].contains(&(50_001.0, 9.0)) && lines[1].contains(&(99_999.0, -9.0)));
        assert!(lines.iter().flatten().count() < 4000);
    }
}
