//! What the demo shows: a live table on a terminal, plain lines elsewhere.

use std::time::{Duration, Instant};

use console::{StyledObject, Term, style, truncate_str};

use super::table::{self, Row};
use crate::text::flow;

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
}

impl Screen {
    /// Draws a table if stdout is a terminal that can, and `plain` is false.
    pub fn new(plain: bool) -> Self {
        let term = Term::stdout();
        let is_live = !plain && can_draw(&term);
        if is_live {
            let _ = term.hide_cursor();
        }
        Screen { term, is_live, drawn: 0, began: Instant::now(), printed: None }
    }

    pub fn title(&mut self, lines: &[&str]) {
        for line in lines {
            flow(line.split(' '), " ", "", self.width()).iter().for_each(|part| self.write(part));
        }
        self.write("");
    }

    /// Prints what happens next, above the table.
    pub fn say(&mut self, text: &str) {
        self.erase();
        let at = self.began.elapsed().as_secs_f64();
        let room = self.width().saturating_sub(INDENT);
        for (n, part) in flow(text.split(' '), " ", "", room).into_iter().enumerate() {
            let time = if n == 0 { format!("{at:5.1} s  ") } else { " ".repeat(INDENT) };
            self.write(&format!("{}{}", self.styled(time).dim(), self.styled(part).bold()));
        }
        self.printed = None;
    }

    /// Shows the motors as they are now.
    pub fn show(&mut self, rows: &[Row]) {
        if self.is_live {
            self.erase();
            let lines = table::lines(rows, self.width());
            self.write("");
            lines.iter().for_each(|line| self.write(line));
            self.drawn = 1 + lines.len();
        } else if self.printed.is_none_or(|at| at.elapsed() >= PLAIN_EVERY) {
            self.printed = Some(Instant::now());
            let moving = |row: &&Row| row.is_fault || !row.speed.starts_with("0 ");
            for row in rows.iter().filter(moving) {
                self.write(&table::line(row, WIDTH, false));
            }
        }
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

    /// Text that has a style where a table is drawn.
    fn styled(&self, text: String) -> StyledObject<String> {
        style(text).force_styling(self.is_live)
    }

    /// A closed stdout is reported when the summary is printed.
    fn write(&self, line: &str) {
        let _ = self.term.write_line(&truncate_str(line, self.width(), ""));
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
