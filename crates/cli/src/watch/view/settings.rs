//! The page with the registers of an ST drive, or the gains of an RMD motor.

use ratatui::text::{Line, Span};

use super::super::keys::Selection;
use super::super::settings::Item;
use super::parts::{Shown, Theme, first, listed};
use crate::text::{fit, wrapped};

/// The number of registers around the selected one that are read. Terminals show fewer lines.
const AROUND: usize = 60;
const NAME: usize = 24;
const VALUE: usize = 24;
/// The mark, the name, the value, and an `e` if the value can be edited.
const FIXED: usize = 1 + NAME + 1 + VALUE + 1 + 1 + 1;

/// The registers that are read repeatedly.
pub fn in_view(place: &Selection) -> Vec<Item> {
    let found = place.found();
    let begin = place.item.saturating_sub(AROUND / 2);
    found.into_iter().skip(begin).take(AROUND).collect()
}

pub fn lines(shown: &Shown<'_>, theme: &Theme, width: usize, height: usize) -> Vec<Line<'static>> {
    let place = shown.place;
    let Some(row) = shown.model.rows.get(place.row) else { return Vec::new() };
    let found = place.found();
    let search = match place.search.as_str() {
        "" => String::new(),
        text => format!(", with `{text}`"),
    };
    let model = shown.model;
    let (state, is_bad) = model.state(row);
    let present = [row.main.speed, row.main.current].map(|source| {
        row.value(source).map_or_else(|| "-".to_owned(), |it| model.units.short(source, it))
    });
    let text = format!(
        "{}  {state}  {}  {} of {} registers{search}",
        row.name,
        present.join("  "),
        found.len(),
        place.items.len(),
    );
    let mut lines = vec![Line::styled(fit(&text, width), theme.of(is_bad).patch(theme.bold()))];
    let about = about(shown, width);
    let message: Vec<Line<'static>> = place
        .message
        .iter()
        .flat_map(|(text, is_bad)| {
            let style = theme.of(*is_bad).patch(theme.bold());
            wrapped(text, width).into_iter().map(move |line| Line::styled(line, style))
        })
        .collect();
    let last = about.len() + message.len();
    let listed_lines = height.saturating_sub(lines.len() + last).max(1);
    let begin = first(place.item, listed_lines);
    for (at, item) in found.iter().enumerate().skip(begin).take(listed_lines) {
        let read = shown.read.get(&(place.row, *item));
        let value = match read {
            Some(Ok(value)) => value.clone(),
            Some(Err(why)) => format!("({why})"),
            None => "...".to_owned(),
        };
        let is_writable = item.unwritable(&model.units).is_none() && !matches!(read, Some(Err(_)));
        let text = format!(
            "{} {} {} {}",
            fit(&item.name(), NAME),
            fit(&value, VALUE),
            if is_writable { "e" } else { " " },
            fit(&item.meaning(), width.saturating_sub(FIXED))
        );
        lines.push(listed(vec![Span::raw(text)], at == place.item, theme));
    }
    lines.resize(lines.len().max(height.saturating_sub(last)), Line::default());
    lines.extend(about.into_iter().map(|line| Line::styled(line, theme.dim())));
    lines.extend(message);
    lines
}

/// The lines with all text of the selected register.
fn about(shown: &Shown<'_>, width: usize) -> Vec<String> {
    let place = shown.place;
    let Some(item) = place.found().get(place.item).copied() else { return Vec::new() };
    let value = match shown.read.get(&(place.row, item)) {
        Some(Ok(value)) => format!(" is {value}"),
        Some(Err(why)) => format!(": {why}"),
        None => String::new(),
    };
    wrapped(&format!("{}{value}: {}", item.name(), item.meaning()), width)
}
