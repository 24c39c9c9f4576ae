//! What the demo shows: a live table on a terminal, plain lines elsewhere.

use std::time::{Duration, Instant};

use console::{Style, Term};

use super::line::{Ink, Line, wrap};
use super::table::{self, Row};

/// How often a plain line is printed for a motor that is being watched.
const PLAIN_EVERY: Duration = Duration::from_millis(500);
/// Width without a terminal.
const WIDTH: usize = 80;
/// Lines that a terminal needs for the table.
const LEAST_LINES: u16 = 12;
/// Where the text of a step begins, behind its time.
const INDENT: usize = 9;

pub struct Screen {
    term: Term,
    is_live: bool,
    /// Lines of the table on the terminal now.
    drawn: usize,
    began: Instant,
    printed: Option<Instant>,
    /// All lines above the table, for a picture.
    said: Vec<Line>,
}

impl Screen {
    /// Draws a table if stdout is a terminal that can, and `plain` is false.
    pub fn new(plain: bool) -> Self {
        let term = Term::stdout();
        let is_live = !plain && can_draw(&term);
        if is_live {
            let _ = term.hide_cursor();
        }
        let (drawn, printed, said) = (0, None, Vec::new());
        Screen { term, is_live, drawn, began: Instant::now(), printed, said }
    }

    pub fn title(&mut self, lines: &[&str]) {
        for line in lines {
            self.add(0, Line::plain(line));
        }
        self.add(0, Line::plain(""));
    }

    /// Prints what happens next, above the table.
    pub fn say(&mut self, text: &str) {
        self.erase();
        let at = self.began.elapsed().as_secs_f64();
        let mut line = Line::new(Ink::Dim, format!("{at:5.1} s  "));
        line.push(Ink::Bold, text);
        self.add(INDENT, line);
        self.printed = None;
    }

    /// Shows the motors as they are now.
    pub fn show(&mut self, rows: &[Row]) {
        if self.is_live {
            self.erase();
            let lines = self.table(rows);
            lines.iter().for_each(|line| self.write(line));
            self.drawn = lines.len();
        } else if self.printed.is_none_or(|at| at.elapsed() >= PLAIN_EVERY) {
            self.printed = Some(Instant::now());
            let moving = |row: &&Row| row.is_fault || !row.speed.starts_with("0 ");
            for row in rows.iter().filter(moving) {
                self.write(&table::line(row, WIDTH));
            }
        }
    }

    /// The screen as it is now, at 80 columns.
    pub fn picture(&self, rows: &[Row]) -> Vec<Line> {
        let command = Line::plain("$ motorlink demo");
        std::iter::once(command).chain(self.said.iter().cloned()).chain(self.table(rows)).collect()
    }

    /// The table, apart from the lines above.
    fn table(&self, rows: &[Row]) -> Vec<Line> {
        let table = table::lines(rows, self.width());
        std::iter::once(Line::default()).chain(table).collect()
    }

    /// Leaves what is on the screen.
    pub fn end(&mut self) {
        self.drawn = 0;
        if self.is_live {
            let _ = self.term.show_cursor();
        }
    }

    fn erase(&mut self) {
        let _ = self.term.clear_last_lines(std::mem::take(&mut self.drawn));
    }

    fn width(&self) -> usize {
        if self.is_live { usize::from(self.term.size().1) } else { WIDTH }
    }

    /// Prints a line that stays, broken at the terminal's width.
    fn add(&mut self, indent: usize, line: Line) {
        for part in wrap(&line, self.width(), indent) {
            self.write(&part);
            self.said.push(part);
        }
    }

    /// A closed stdout is reported when the summary is printed.
    fn write(&self, line: &Line) {
        let text = line.parts().map(|(ink, text)| match self.is_live {
            true => style(ink).apply_to(text).to_string(),
            false => text.to_owned(),
        });
        let _ = self.term.write_line(&text.collect::<String>());
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        self.end();
    }
}

/// Whether a terminal obeys cursor codes, and its user wants them.
fn can_draw(term: &Term) -> bool {
    let is_dumb = std::env::var_os("TERM").is_none_or(|name| name.is_empty() || name == "dumb");
    let no_colour = std::env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty());
    let is_high = term.size_checked().is_none_or(|(lines, _)| lines >= LEAST_LINES);
    term.features().is_attended() && !is_dumb && !no_colour && is_high
}

fn style(ink: Ink) -> Style {
    match ink {
        Ink::Plain => Style::new(),
        Ink::Dim => Style::new().dim(),
        Ink::Bold => Style::new().bold(),
        Ink::Running => Style::new().green(),
        Ink::Fault => Style::new().red().bold(),
    }
}
