//! The page with the details of one motor.

use std::time::Duration;

use motorlink_telemetry::sample::Sample;
use ratatui::text::Line;

use super::super::model::{Model, age, span};
use super::super::row::{Row, hertz};
use super::super::values::details;
use super::motors::short;
use super::parts::{Shown, Theme, events, trend};
use crate::text::{fit, right, wrapped};

/// The least number of lines for events.
const EVENTS: usize = 1;

pub fn lines(shown: &Shown<'_>, theme: &Theme, width: usize, height: usize) -> Vec<Line<'static>> {
    let model = shown.model;
    let Some(row) = model.rows.get(shown.place.row) else { return Vec::new() };
    let port = &model.ports[row.port];
    let (state, is_bad) = model.state(row);
    let text = format!("{}  {state}  on {}", row.name, port.name);
    let mut lines = vec![Line::styled(fit(&text, width), theme.of(is_bad).patch(theme.bold()))];
    let (trouble, is_bad) = trouble(model, row);
    let trouble = wrapped(&trouble, width).into_iter();
    lines.extend(trouble.map(|line| Line::styled(line, theme.of(is_bad))));
    let signals = details(row.motor);
    let names = signals.iter().map(|signal| signal.source.to_string().len()).max().unwrap_or(0);
    let values = width.saturating_sub(names + 2 + RATES).max(VALUE);
    let columns = |name: &str, value: &str, rates: [&str; 4]| {
        let rates = rates.map(|text| right(text, RATE)).concat();
        fit(&format!("{name:<names$}  {}{rates}", fit(value, values)), width)
    };
    let header = columns("signal", "value", ["age", "got Hz", "asked", "possible"]);
    lines.push(Line::styled(header, theme.dim()));
    for signal in signals {
        let source = signal.source;
        let value = match (row.value(source), row.refused.get(&source)) {
            (Some(sample), _) => model.units.text(source, sample),
            (None, Some(why)) => format!("none: {why}"),
            (None, None) => "-".to_owned(),
        };
        let age = row.age(source).map_or_else(|| "-".to_owned(), tenths);
        let rate = row.rates.iter().find(|rate| rate.signal == signal);
        let [got, asked, line] = match rate {
            Some(rate) => [rate.achieved, hertz(rate.asked), hertz(rate.predicted)].map(short),
            None => ["-"; 3].map(str::to_owned),
        };
        lines.push(Line::raw(columns(&source.to_string(), &value, [&age, &got, &asked, &line])));
    }
    let (replies, silences, lost) = (row.replies, row.silences, port.lost);
    let counts = format!("replies {replies}, silent {silences} times, lost by this view {lost}");
    lines.push(Line::raw(fit(&counts, width)));
    let main =
        [("speed", row.main.speed, &row.speeds), ("current", row.main.current, &row.currents)];
    for (name, source, history) in main {
        let by_value = |one: &&Sample, other: &&Sample| one.value.total_cmp(&other.value);
        let least = history.iter().min_by(by_value);
        let most = history.iter().max_by(by_value);
        if let (Some(least), Some(most)) = (least, most) {
            let [least, most] = [least, most].map(|it| model.units.short(source, *it));
            let range = fit(&format!("{name} {least} to {most}"), RANGE);
            let bars = trend(history, width.saturating_sub(RANGE + 1));
            lines.push(Line::raw(fit(&format!("{range} {bars}"), width)));
        }
    }
    lines.truncate(height.saturating_sub(EVENTS));
    let own = model.events.iter().filter(|said| said.row.is_none_or(|at| at == shown.place.row));
    lines.extend(events(own, theme, width, height.saturating_sub(lines.len())));
    lines
}

/// Why there are no values, or the faults; and whether this is bad.
fn trouble(model: &Model, row: &Row) -> (String, bool) {
    let silent = row.silent.as_ref().map(|(since, why)| ("no answer", since, why));
    let gone = model.ports[row.port].gone.as_ref().map(|(since, why)| ("port gone", since, why));
    if let Some((what, since, why)) = gone.or(silent) {
        return (format!("{what} for {}: {why}", age(*since)), true);
    }
    match model.faults(row) {
        Some(faults) => (faults, true),
        None => ("no fault is reported".to_owned(), false),
    }
}

/// The age of a value.
fn tenths(age: Duration) -> String {
    match age.as_secs() {
        0..10 => format!("{:.1}s", age.as_secs_f64()),
        _ => span(age),
    }
}

/// Width of the least and the largest value of a sparkline.
const RANGE: usize = 36;
/// Least width of a value.
const VALUE: usize = 16;
/// Width of the age, and of each rate.
const RATE: usize = 9;
const RATES: usize = 4 * RATE;
