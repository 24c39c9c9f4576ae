//! The screen: lines of text. The last lines list keys.

mod details;
mod help;
mod motors;
mod parts;
pub mod settings;

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::Line;
use ratatui::widgets::Paragraph;

use super::keys::{Field, HELP, Selection, View};
use crate::text::{self, counted, wrapped};
use parts::MARK;
pub use parts::{Shown, Theme};

/// The character after typed text.
const CURSOR: char = '_';

/// Draws the screen.
pub fn draw(frame: &mut Frame<'_>, shown: &Shown<'_>, theme: &Theme) {
    let area = frame.area();
    let (width, height) = (usize::from(area.width), usize::from(area.height));
    let top = top(shown, theme, width, height);
    let mut bottom: Vec<Line<'_>> = field(shown, theme, width);
    // In a low terminal only the first keys are listed.
    let keys = keys(shown.place, width).into_iter().take((height / 3).max(1));
    bottom.extend(keys.map(|line| Line::styled(line, theme.dim())));
    let left = height.saturating_sub(top.len() + bottom.len());
    let mut lines = top;
    let mut body = match (shown.place.shows_help, shown.place.view) {
        (true, _) => help::lines(theme, width),
        (_, View::Motors) => motors::lines(shown, theme, width, left),
        (_, View::Details) => details::lines(shown, theme, width, left),
        (_, View::Settings) => settings::lines(shown, theme, width, left),
    };
    body.resize(left, Line::default());
    lines.extend(body);
    lines.extend(bottom);
    // Screen readers read at the cursor, so it is visible and at the selection.
    let starts = |line: &Line<'_>, mark: &str| {
        line.spans.first().is_some_and(|span| span.content.starts_with(mark))
    };
    let (at, mark) = match shown.place.field {
        Field::None => (lines.iter().position(|line| starts(line, MARK)), 0),
        _ => {
            let at = lines.iter().rposition(|line| line.to_string().ends_with(CURSOR));
            (at, at.map_or(0, |at| lines[at].width().saturating_sub(1)))
        }
    };
    let (x, y) = (mark.min(width.saturating_sub(1)), at.unwrap_or(0).min(height.saturating_sub(1)));
    frame.set_cursor_position((x as u16, y as u16));
    frame.render_widget(Paragraph::new(lines), Rect { x: 0, y: 0, ..area });
}

/// The first lines: title, latch, and stops that are not confirmed.
fn top(shown: &Shown<'_>, theme: &Theme, width: usize, height: usize) -> Vec<Line<'static>> {
    let model = shown.model;
    let mut lines = Vec::new();
    if height >= TITLED {
        let ports = counted(model.ports.len() as u64, "port");
        let motors = counted(model.rows.len() as u64, "motor");
        let hertz = 1.0 / model.period.as_secs_f64();
        let text = format!("motorlink watch: {motors} on {ports}, {hertz:.1} Hz asked for");
        lines.push(Line::styled(text::fit(&text, width), theme.bold()));
    }
    let loud = theme.bad().patch(theme.selected());
    if let Some((ports, by)) = model.latched() {
        let of = match ports.len() == model.ports.len() {
            true => "every motion".to_owned(),
            false => format!("motion of {}", ports.join(" ")),
        };
        let text = format!("LATCHED (u releases it): {of} is refused since {by} stopped all");
        lines.push(Line::styled(text::fit(&text, width), loud));
    }
    if let Some((ports, why)) = model.unlatched_shares() {
        let ports = ports.join(" ");
        let text = format!("NOT LATCHED for other programs of the share: {ports}: {why}");
        lines.push(Line::styled(text::fit(&text, width), loud));
    }
    let rows = model.rows.iter().filter(|row| row.unconfirmed.is_some());
    let names: Vec<&str> = rows.map(|row| row.name.as_str()).collect();
    if !names.is_empty() {
        let names = names.join(" ");
        let text = format!("stop NOT CONFIRMED, may still be turning: {names}");
        let text = wrapped(&text, width).into_iter().take((height / LOUD).max(1));
        lines.extend(text.map(|line| Line::styled(text::fit(&line, width), loud)));
    }
    lines
}

/// Least height of a terminal with a title.
const TITLED: usize = 6;
/// The part of the height for the names of motors whose stop is not confirmed: one line in so many.
const LOUD: usize = 8;

/// The typed text, or the question that needs a y.
fn field(shown: &Shown<'_>, theme: &Theme, width: usize) -> Vec<Line<'static>> {
    let place = shown.place;
    let text = match &place.field {
        Field::None => return Vec::new(),
        Field::Search => format!("search: {}{CURSOR}", place.search),
        Field::Edit(item, text) => {
            let name = &shown.model.rows[place.row].name;
            format!("{name}: new value of {}: {text}{CURSOR}", item.name())
        }
        Field::Release => match shown.model.latched() {
            Some((_, by)) => format!(
                "release the latch of {by}, so that motors can be started again? y or n: {CURSOR}"
            ),
            None => format!("no latch is set: any key goes back {CURSOR}"),
        },
    };
    wrapped(&text, width).into_iter().map(|line| Line::styled(line, theme.bold())).collect()
}

/// The last lines: the keys of the view.
fn keys(place: &Selection, width: usize) -> Vec<String> {
    let is_shown = |view: Option<View>| view.is_none_or(|view| view == place.view);
    let words: Vec<String> = match &place.field {
        Field::None => HELP
            .iter()
            .filter(|key| is_shown(key.view) && !key.short.is_empty())
            .filter(|key| key.key != "Esc" || place.view != View::Motors)
            .filter(|key| key.key != "r" || place.view != View::Settings)
            .filter(|key| key.key != "n" || place.view == View::Motors)
            .map(|key| {
                let mut names = key.key.split(' ');
                let first = names.next().unwrap_or_default();
                let first = if first == "up" { "up/down" } else { first };
                format!("{first} {}", key.short)
            })
            .collect(),
        Field::Release => vec!["SPACE STOP ALL".into(), "y release".into(), "n leave it".into()],
        Field::Search | Field::Edit(..) => {
            vec!["SPACE STOP ALL".into(), "Enter done".into(), "Esc cancel".into()]
        }
    };
    text::flow(words, "  ", "", width)
}
