//! Samples as points of a line.

use motorlink_testbench::scenario::{Panel, Run};

/// Least and greatest value of the panel's signals, with some room around.
pub fn whole_range(panel: &Panel, run: &Run) -> [f64; 2] {
    let values = panel.signals.iter().flat_map(|&n| &run.columns[n]).filter(|v| v.is_finite());
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

/// The points of a line, within the range: of each pixel's samples those that can be seen. `pixels` is the width.
pub fn thin(column: &[f64], end: f64, low: f64, high: f64, pixels: usize) -> Vec<(f64, f64)> {
    let step = end / (column.len() - 1) as f64;
    let every = column.len().div_ceil(2 * pixels).max(1);
    let mut points = Vec::new();
    for (n, samples) in column.chunks(every).enumerate() {
        let order = |a: &usize, b: &usize| samples[*a].total_cmp(&samples[*b]);
        let least = (0..samples.len()).min_by(order);
        let most = (0..samples.len()).max_by(order);
        let mut seen = [least, most].map(Option::unwrap_or_default);
        seen.sort_unstable();
        let seen = if seen[0] == seen[1] { &seen[..1] } else { &seen };
        let point = |&k: &usize| ((n * every + k) as f64 * step, samples[k].clamp(low, high));
        points.extend(seen.iter().map(point));
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thinned_line_keeps_its_peaks_and_its_order() {
        let mut column: Vec<f64> = (0..100_001).map(|n| f64::from(n % 7)).collect();
        column[12_345] = 50.0;
        column[77_777] = -50.0;
        let points = thin(&column, 10.0, -20.0, 100.0, 860);
        assert!(points.len() < 4000);
        assert!(points.is_sorted_by(|a, b| a.0 < b.0));
        assert!(points.contains(&(12_345.0 * 1e-4, 50.0)));
        assert!(points.contains(&(77_777.0 * 1e-4, -20.0)), "the range ends there");
        assert_eq!(
            thin(&[1.0, 2.0, 3.0], 2.0, 0.0, 9.0, 860),
            [(0.0, 1.0), (1.0, 2.0), (2.0, 3.0)]
        );
    }
}
