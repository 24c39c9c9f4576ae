//! Parts that several pages use.

use std::collections::{BTreeMap, VecDeque};

use motorlink_telemetry::sample::Sample;
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Span};

use super::super::keys::Selection;
use super::super::model::{Model, Said, age};
use super::super::row::HISTORY;
use super::super::settings::Item;
use crate::text::{sparkline, wrapped};

/// The mark of the selected line.
pub const MARK: &str = ">";

/// The data of the screen.
pub struct Shown<'a> {
    pub model: &'a Model,
    pub place: &'a Selection,
    /// Values of registers, or why there is none.
    pub read: &'a BTreeMap<(usize, Item), Result<String, String>>,
}

/// Styles. No information is in the colour alone.
pub struct Theme {
    has_colours: bool,
}

impl Theme {
    /// Without colours if NO_COLOR is set.
    pub fn of_terminal() -> Self {
        Theme { has_colours: console::colors_enabled() }
    }

    #[cfg(test)]
    pub fn plain() -> Self {
        Theme { has_colours: false }
    }

    pub fn bold(&self) -> Style {
        Style::new().add_modifier(Modifier::BOLD)
    }

    pub fn dim(&self) -> Style {
        Style::new().add_modifier(Modifier::DIM)
    }

    pub fn selected(&self) -> Style {
        Style::new().add_modifier(Modifier::REVERSED)
    }

    pub fn bad(&self) -> Style {
        match self.has_colours {
            true => self.bold().fg(Color::Red),
            false => self.bold(),
        }
    }

    pub fn of(&self, is_bad: bool) -> Style {
        if is_bad { self.bad() } else { Style::new() }
    }
}

/// Notices in the order of importance: stops that are not confirmed, lost ports, faults, confirmed
/// stops. Then events, the newest at the end.
pub fn notices(
    shown: &Shown<'_>,
    theme: &Theme,
    width: usize,
    height: usize,
) -> Vec<Line<'static>> {
    let model = shown.model;
    let mut lines: Vec<Line<'static>> = Vec::new();
    let mut say = |text: String, style: Style| {
        lines.extend(wrapped(&text, width).into_iter().map(|line| Line::styled(line, style)));
    };
    // Motors with the same reason share a notice.
    let mut reasons: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for row in &model.rows {
        if let Some(why) = &row.unconfirmed {
            reasons.entry(why).or_default().push(&row.name);
        }
    }
    for (why, names) in reasons {
        let names = names.join(" ");
        let text = format!("stop NOT CONFIRMED by {names}, repeated after the next reply: {why}");
        say(text, theme.bad());
    }
    let gone: Vec<String> = model
        .ports
        .iter()
        .filter_map(|port| Some(format!("{} for {}", port.label, age(port.gone.as_ref()?.0))))
        .collect();
    if !gone.is_empty() {
        let text = format!("port gone, opened again when it is back: {}", gone.join(", "));
        say(text, theme.bad());
    }
    for row in &model.rows {
        if let Some(faults) = model.faults(row) {
            say(format!("{}: {faults}", row.name), theme.bad());
        }
    }
    let confirmed: Vec<String> = model
        .rows
        .iter()
        .filter(|row| model.has_confirmed(row))
        .map(|row| row.name.clone())
        .collect();
    if !confirmed.is_empty() {
        let (some, all) = (confirmed.len(), model.rows.len());
        let text = match some == all {
            true => format!("stop confirmed by all {all} motors"),
            false => format!("stop confirmed by {some} of {all}: {}", confirmed.join(" ")),
        };
        say(text, theme.bold());
    }
    let hidden = lines.len().saturating_sub(height);
    if hidden > 0 {
        lines.truncate(height.saturating_sub(1));
        let text = format!("... {} more lines: Enter shows one motor", hidden + 1);
        lines.push(Line::styled(text, theme.bad()));
    }
    let more = height.saturating_sub(lines.len());
    lines.extend(events(model.events.iter(), theme, width, more));
    lines.truncate(height);
    lines
}

/// The last events that fit, the newest at the end.
pub fn events<'a>(
    events: impl DoubleEndedIterator<Item = &'a Said>,
    theme: &Theme,
    width: usize,
    height: usize,
) -> Vec<Line<'static>> {
    let mut lines: Vec<Line<'static>> = Vec::new();
    for said in events.rev() {
        let style = theme.of(said.is_bad);
        let text = format!("{} {}", said.time, said.text);
        let mut all: Vec<Line<'static>> =
            wrapped(&text, width).into_iter().map(|line| Line::styled(line, style)).collect();
        if lines.len() + all.len() > height {
            break;
        }
        all.extend(lines);
        lines = all;
    }
    lines
}

/// The last values of a signal as bars.
pub fn trend(history: &VecDeque<Sample>, width: usize) -> String {
    sparkline(history.iter().map(|sample| sample.value), width, HISTORY)
}

/// A line of a list, with a mark if it is selected.
pub fn listed(spans: Vec<Span<'static>>, is_selected: bool, theme: &Theme) -> Line<'static> {
    let mark = if is_selected { MARK } else { " " };
    let line = Line::from([vec![Span::raw(mark)], spans].concat());
    if is_selected { line.style(theme.selected()) } else { line }
}

/// The first visible line of a list, so that the selected line is visible.
pub fn first(selected: usize, height: usize) -> usize {
    (selected + 1).saturating_sub(height.max(1))
}
