//! The keys and their actions.

use ratatui::crossterm::event::{KeyCode, KeyEvent, KeyModifiers};

use super::settings::Item;

/// The page on the screen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum View {
    Motors,
    Details,
    Settings,
}

/// The field that receives typed text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Field {
    None,
    /// A part of a name in the list of registers.
    Search,
    /// A value for an item.
    Edit(Item, String),
    /// The question: release the latch?
    Release,
}

/// The action of a key outside the view: on motors, on the terminal.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Ask {
    StopAll,
    /// Stops the motor of the selected row.
    Stop,
    Release,
    /// Looks for more motors.
    Find,
    Write(Item, String),
    Suspend,
    Quit,
}

/// The page, the selection and the typed text.
pub struct Selection {
    pub view: View,
    pub field: Field,
    pub shows_help: bool,
    /// The selected row.
    pub row: usize,
    pub rows: usize,
    /// The registers of the motor, and the text of the search in them.
    pub items: Vec<Item>,
    pub search: String,
    /// The selected register of those with this text.
    pub item: usize,
    /// The result of the last edit, and whether it failed.
    pub message: Option<(String, bool)>,
}

/// A key of the help: its page (`None`: all), name and action, and a short form for the last line.
pub struct Help {
    pub view: Option<View>,
    pub key: &'static str,
    pub does: &'static str,
    pub short: &'static str,
}

const fn key(
    view: Option<View>,
    key: &'static str,
    does: &'static str,
    short: &'static str,
) -> Help {
    Help { view, key, does, short }
}

/// All keys, in the order of the help.
pub const HELP: &[Help] = &[
    key(None, "SPACE ! F12 Ctrl-X", "stop all motors, and latch; while typing, too", "STOP ALL"),
    key(Some(View::Motors), "up down j k", "select a motor; also PgUp PgDn Home End", "select"),
    key(Some(View::Motors), "Enter", "details of the motor", "details"),
    key(Some(View::Details), "up down j k", "the motor above, below", "motor"),
    key(Some(View::Settings), "up down j k", "select; also PgUp PgDn Home End", "select"),
    key(Some(View::Settings), "/", "search; Enter keeps the search, Esc ends it", "search"),
    key(Some(View::Settings), "e Enter", "type a value; it is written and read back", "edit"),
    key(None, "r", "all registers of the motor (RMD: gains)", "registers"),
    key(None, "s", "stop the selected motor, without the latch", "stop"),
    key(None, "u", "release the latch, after a y", "unlatch"),
    key(None, "n", "look for more motors on all ports", "new motors"),
    key(None, "Esc", "back", "back"),
    key(None, "?", "this help", "help"),
    key(None, "Ctrl-Z", "suspend; `fg` goes on", ""),
    key(None, "q Ctrl-C", "quit", "quit"),
];

impl Selection {
    pub fn new(rows: usize) -> Self {
        Selection {
            view: View::Motors,
            field: Field::None,
            shows_help: false,
            row: 0,
            rows,
            items: Vec::new(),
            search: String::new(),
            item: 0,
            message: None,
        }
    }

    /// The registers whose name or meaning has the text of the search.
    pub fn found(&self) -> Vec<Item> {
        let search = self.search.to_lowercase();
        let is_found = |item: &&Item| {
            let is_in = |text: &str| text.to_lowercase().contains(&search);
            is_in(&item.name()) || is_in(&item.meaning())
        };
        self.items.iter().filter(is_found).copied().collect()
    }

    /// Shows the list of registers.
    pub fn list(&mut self, items: Vec<Item>) {
        (self.items, self.item, self.message) = (items, 0, None);
        self.search.clear();
        self.view = View::Settings;
    }

    /// Handles a key. `list` returns the registers of the motor of a row. `unwritable` returns the reason
    /// why a register cannot be edited.
    pub fn press(
        &mut self,
        key: KeyEvent,
        list: impl FnOnce(usize) -> Vec<Item>,
        unwritable: impl FnOnce(Item) -> Option<String>,
    ) -> Option<Ask> {
        let is_control = key.modifiers.contains(KeyModifiers::CONTROL);
        // These work on every page, also while typing: no name and no value has a space or an `!`.
        match key.code {
            KeyCode::Char(' ' | '!') | KeyCode::F(12) => return Some(Ask::StopAll),
            KeyCode::Char('x') if is_control => return Some(Ask::StopAll),
            KeyCode::Char('c') if is_control => return Some(Ask::Quit),
            KeyCode::Char('z') if is_control => return Some(Ask::Suspend),
            KeyCode::Char(_) if is_control => return None,
            _ => {}
        }
        if self.field != Field::None {
            return self.type_in(key.code);
        }
        if self.shows_help {
            self.shows_help = false;
            return (key.code == KeyCode::Char('q')).then_some(Ask::Quit);
        }
        match (self.view, key.code) {
            (_, KeyCode::Char('q')) => return Some(Ask::Quit),
            (_, KeyCode::Char('?')) => self.shows_help = true,
            (_, KeyCode::Char('s')) => return Some(Ask::Stop),
            (_, KeyCode::Char('u')) => self.field = Field::Release,
            (_, KeyCode::Char('n')) => return Some(Ask::Find),
            (_, KeyCode::Char('r')) => {
                let items = list(self.row);
                self.list(items);
            }
            (View::Settings, KeyCode::Esc) if !self.search.is_empty() => {
                self.search.clear();
                self.item = 0;
            }
            (View::Details | View::Settings, KeyCode::Esc) => self.view = View::Motors,
            (View::Motors, KeyCode::Enter) => self.view = View::Details,
            (View::Settings, KeyCode::Char('/')) => {
                (self.field, self.item) = (Field::Search, 0);
                self.search.clear();
            }
            (View::Settings, KeyCode::Char('e') | KeyCode::Enter) => self.edit(unwritable),
            (_, code) => self.move_by(code),
        }
        None
    }

    fn edit(&mut self, unwritable: impl FnOnce(Item) -> Option<String>) {
        let Some(item) = self.found().get(self.item).copied() else { return };
        match unwritable(item) {
            Some(why) => self.message = Some((why, true)),
            None => {
                self.message = None;
                self.field = Field::Edit(item, String::new());
            }
        }
    }

    fn move_by(&mut self, code: KeyCode) {
        let (at, count) = match self.view {
            View::Motors | View::Details => (&mut self.row, self.rows),
            View::Settings => {
                let count = self.found().len();
                (&mut self.item, count)
            }
        };
        *at = match code {
            KeyCode::Up | KeyCode::Char('k') => at.saturating_sub(1),
            KeyCode::Down | KeyCode::Char('j') => *at + 1,
            KeyCode::PageUp => at.saturating_sub(PAGE),
            KeyCode::PageDown => *at + PAGE,
            KeyCode::Home => 0,
            KeyCode::End => count,
            _ => return,
        }
        .min(count.saturating_sub(1));
    }

    fn type_in(&mut self, code: KeyCode) -> Option<Ask> {
        let text = match &mut self.field {
            Field::Release => {
                self.field = Field::None;
                return (code == KeyCode::Char('y')).then_some(Ask::Release);
            }
            Field::Search => &mut self.search,
            Field::Edit(_, text) => text,
            Field::None => return None,
        };
        match code {
            KeyCode::Char(letter) if text.len() < LONGEST => text.push(letter),
            KeyCode::Backspace => drop(text.pop()),
            KeyCode::Esc => {
                if self.field == Field::Search {
                    self.search.clear();
                }
                self.field = Field::None;
            }
            KeyCode::Enter => {
                if let Field::Edit(item, text) = std::mem::replace(&mut self.field, Field::None)
                    && !text.is_empty()
                {
                    self.message = Some((format!("writing {} ...", item.name()), false));
                    return Some(Ask::Write(item, text));
                }
            }
            _ => {}
        }
        None
    }
}

/// Rows that PgUp and PgDn move.
const PAGE: usize = 10;
/// The longest name or value that can be typed, in characters.
const LONGEST: usize = 40;
