//! The table on the screen, with keys.

use std::time::{Duration, Instant};

use motorlink_fleet::view::View;
use ratatui::Frame;
use ratatui::crossterm::event::{KeyCode, KeyEvent, KeyModifiers};
use ratatui::text::Line;
use ratatui::widgets::Paragraph;

use super::table::{self, Only, Row, Shown, Sort, Sum};
use crate::failure::Failure;
use crate::interrupt;
use crate::text::fit;
use crate::watch::screen::{self, Screen};
use crate::watch::view::Theme;

/// The longest wait for a key.
const TICK: Duration = Duration::from_millis(50);
/// How often the table is drawn.
const PICTURE: Duration = Duration::from_millis(250);
const KEYS: &str = "s sort  f filter  n by node  ↑↓ scroll  / name  q quit";

/// What was chosen with keys.
pub struct Choice {
    sort: Sort,
    only: Only,
    by_node: bool,
    /// A part of the names of drives.
    name: String,
    /// Whether keys are text of the name.
    types: bool,
    /// The first row that is shown.
    first: usize,
}

pub fn require_terminal() -> Result<(), Failure> {
    screen::require_terminal_of(
        "fleet watch",
        "give --once, or --every TIME, with --json for programs",
    )
}

pub fn show(view: &View, mut place: Choice) -> Result<(), Failure> {
    interrupt::take_over();
    let mut screen = Screen::enter()?;
    let theme = Theme::of_terminal();
    let mut drawn: Option<Instant> = None;
    while !interrupt::interrupted() {
        let is_cleared = screen.obey()?;
        if is_cleared || drawn.is_none_or(|at| at.elapsed() >= PICTURE) {
            let shown = Shown::of(view, place.sort, place.only, &place.name);
            screen.terminal.draw(|frame| draw(frame, &shown, &mut place, &theme))?;
            drawn = Some(Instant::now());
        }
        match screen.input(TICK, |_, key| Ok(place.press(key)))? {
            None => return Ok(()),
            Some(true) => drawn = None,
            Some(false) => {}
        }
    }
    Ok(())
}

impl Choice {
    pub fn new(sort: Sort, only: Only, by_node: bool, name: String) -> Self {
        Choice { sort, only, by_node, name, types: false, first: 0 }
    }

    /// Handles a key. `false`: the end.
    fn press(&mut self, key: KeyEvent) -> bool {
        if self.types {
            match key.code {
                KeyCode::Enter | KeyCode::Esc => self.types = false,
                KeyCode::Backspace => drop(self.name.pop()),
                KeyCode::Char(character) => self.name.push(character),
                _ => {}
            }
            return true;
        }
        let is_control = key.modifiers.contains(KeyModifiers::CONTROL);
        match key.code {
            KeyCode::Char('q') | KeyCode::Esc => return false,
            KeyCode::Char('c') if is_control => return false,
            KeyCode::Char('s') => self.sort = table::next(self.sort),
            KeyCode::Char('f') => self.only = table::next(self.only),
            KeyCode::Char('n') => self.by_node = !self.by_node,
            KeyCode::Char('/') => {
                self.types = true;
                self.name.clear();
            }
            KeyCode::Down => self.first += 1,
            KeyCode::Up => self.first = self.first.saturating_sub(1),
            KeyCode::PageDown => self.first += 20,
            KeyCode::PageUp => self.first = self.first.saturating_sub(20),
            KeyCode::Home => self.first = 0,
            _ => {}
        }
        true
    }
}

fn draw(frame: &mut Frame<'_>, shown: &Shown, place: &mut Choice, theme: &Theme) {
    let area = frame.area();
    let (columns, height) = (usize::from(area.width), usize::from(area.height));
    let width = shown.name_width(place.by_node);
    let (header, rows): (String, Vec<(String, bool)>) = match place.by_node {
        true => {
            let rows = shown.sums.iter().map(|it| (it.text(width), it.is_bad()));
            (Sum::header(width), rows.collect())
        }
        false => {
            let rows = shown.rows.iter().map(|it| (it.text(width), it.is_bad()));
            (Row::header(width), rows.collect())
        }
    };
    let room = height.saturating_sub(4);
    place.first = place.first.min(rows.len().saturating_sub(room));
    let mut lines = vec![
        Line::styled(fit(&table::summary(&shown.sums), columns), theme.bold()),
        Line::styled(fit(&header, columns), theme.dim()),
    ];
    let in_view = rows.iter().skip(place.first).take(room);
    lines.extend(in_view.map(|(text, bad)| Line::styled(fit(text, columns), theme.of(*bad))));
    lines.resize(height.saturating_sub(2), Line::default());
    let name = match (place.types, place.name.is_empty()) {
        (true, _) => format!(", name: {}_", place.name),
        (false, false) => format!(", name: {}", place.name),
        (false, true) => String::new(),
    };
    let last = (place.first + room).min(rows.len());
    let at = format!(
        "{} to {last} of {}, sorted by {}, {}{name}",
        (place.first + 1).min(last),
        rows.len(),
        table::word(&place.sort),
        table::word(&place.only)
    );
    lines.push(Line::raw(fit(&at, columns)));
    lines.push(Line::styled(fit(KEYS, columns), theme.dim()));
    frame.render_widget(Paragraph::new(lines), area);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_typed_and_its_letters_are_no_keys() {
        let mut place = Choice::new(Sort::Name, Only::All, false, "old".to_owned());
        let mut press = |code| place.press(KeyEvent::from(code));
        assert!(press(KeyCode::Char('/')));
        for letter in "arms/q1".chars() {
            assert!(press(KeyCode::Char(letter)));
        }
        assert!(press(KeyCode::Backspace));
        assert!(press(KeyCode::Enter));
        assert!(!press(KeyCode::Char('q')));
        assert_eq!((place.name.as_str(), place.types), ("arms/q", false));
    }
}
