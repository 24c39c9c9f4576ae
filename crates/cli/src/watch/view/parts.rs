//! What several views share.

use std::collections::BTreeMap;

use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Span};

use super::super::keys::Place;
use super::super::model::{Model, Said, Stop, age};
use super::super::settings::Item;
use super::text::wrapped;

/// Before the selected line of a list.
pub const MARK: &str = ">";

/// What is shown.
pub struct Shown<'a> {
    pub model: &'a Model,
    pub place: &'a Place,
    /// Values of the list of registers.
    pub read: &'a BTreeMap<(usize, Item), Result<String, String>>,
}

/// Styles. Colours only support what words say.
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

/// What has to be known: stops that are not confirmed, ports that are gone, faults, then confirmed
/// stops, then what happened, the newest at the end.
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
    // Often all motors have the same reason.
    let mut reasons: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for row in &model.rows {
        if let Stop::NotConfirmed(why) = &row.stop {
            reasons.entry(why).or_default().push(&row.name);
        }
    }
    for (why, names) in reasons {
        let names = names.join(" ");
        say(format!("stop NOT CONFIRMED, may still be turning: {names}: {why}"), theme.bad());
    }
    for port in &model.ports {
        if let Some((since, why)) = &port.gone {
            let gone = age(*since);
            say(format!("{}: port gone for {gone}: {why}", port.label), theme.bad());
        }
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
        let of = match confirmed.len() == model.rows.len() {
            true => format!("all {}", confirmed.len()),
            false => format!("{} of {}", confirmed.len(), model.rows.len()),
        };
        say(format!("stop confirmed by {of}: {}", confirmed.join(" ")), theme.bold());
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

/// A line of a list, which is marked if it is selected.
pub fn listed(spans: Vec<Span<'static>>, is_selected: bool, theme: &Theme) -> Line<'static> {
    let mark = if is_selected { MARK } else { " " };
    let line = Line::from([vec![Span::raw(mark)], spans].concat());
    if is_selected { line.style(theme.selected()) } else { line }
}

/// The first of the lines of a list that are shown, so that the selected one is among them.
pub fn first(selected: usize, height: usize) -> usize {
    (selected + 1).saturating_sub(height.max(1))
}
