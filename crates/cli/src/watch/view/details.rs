//! Everything of one motor.

use ratatui::text::Line;

use super::super::model::{age, hertz};
use super::super::values::details;
use super::parts::{Shown, Theme, events};
use super::text::{fit, sparkline};

/// Least lines for events.
const EVENTS: usize = 4;

pub fn lines(shown: &Shown<'_>, theme: &Theme, width: usize, height: usize) -> Vec<Line<'static>> {
    let model = shown.model;
    let Some(row) = model.rows.get(shown.place.row) else { return Vec::new() };
    let port = &model.ports[row.port];
    let (state, is_bad) = model.state(row);
    let text = format!("{}  {state}  on {}", row.name, port.name);
    let mut lines = vec![Line::styled(fit(&text, width), theme.of(is_bad).patch(theme.bold()))];
    let faults = model.faults(row).map_or("no fault is reported".to_owned(), |faults| faults);
    lines.push(Line::styled(fit(&faults, width), theme.of(model.faults(row).is_some())));
    let signals = details(row.motor);
    let names = signals.iter().map(|signal| signal.source.to_string().len()).max().unwrap_or(0);
    let values = width.saturating_sub(names + 4 + RATES).max(VALUE);
    for signal in signals {
        let source = signal.source;
        let value = match (row.value(source), row.refused.get(&source)) {
            (Some(sample), _) => model.units.text(source, sample),
            (None, Some(why)) => format!("none: {why}"),
            (None, None) => "-".to_owned(),
        };
        let rate = row.rates.iter().find(|rate| rate.signal == signal);
        let rate = rate.map_or_else(String::new, |rate| {
            let [asked, can] = [hertz(rate.asked), hertz(rate.predicted)];
            format!("{:.1} Hz, asked {asked:.1}, line {can:.1}", rate.achieved)
        });
        let text = format!("{:<names$}  {}  {rate}", source.to_string(), fit(&value, values));
        lines.push(Line::raw(fit(&text, width)));
    }
    let silent = row
        .silent
        .as_ref()
        .map_or_else(String::new, |(since, why)| format!(", no answer for {}: {why}", age(*since)));
    let (replies, silences, lost) = (row.replies, row.silences, port.lost);
    let counts =
        format!("replies {replies}, silent {silences} times{silent}, not shown in time {lost}");
    lines.push(Line::raw(fit(&counts, width)));
    for (name, values) in [("speed", &row.speeds), ("current", &row.currents)] {
        let bars = sparkline(values.iter(), width.saturating_sub(LABEL).min(values.len()));
        lines.push(Line::raw(fit(name, LABEL) + &bars));
    }
    lines.truncate(height.saturating_sub(EVENTS));
    let own = model.events.iter().filter(|said| said.row.is_none_or(|at| at == shown.place.row));
    lines.extend(events(own, theme, width, height.saturating_sub(lines.len())));
    lines
}

/// Least width of a value.
const VALUE: usize = 16;
/// Width of the rates: 100.0 Hz, asked 100.0, line 100.0.
const RATES: usize = 35;
/// Width of the name of a sparkline.
const LABEL: usize = 8;
