//! What the demo shows: a live table on a terminal, plain lines elsewhere.

use std::time::{Duration, Instant};

use console::{Term, style, truncate_str};

/// How often a plain line is printed for a motor that is being watched.
const PLAIN_EVERY: Duration = Duration::from_millis(500);

/// One motor as the table shows it.
#[derive(Debug, Clone, Default)]
pub struct Row {
    pub motor: String,
    pub state: String,
    pub speed: String,
    pub current: String,
    pub temperature: String,
    pub voltage: String,
    pub alarm: bool,
}

pub struct Screen {
    term: Term,
    live: bool,
    /// Lines of the table that stand on the terminal now.
    drawn: usize,
    began: Instant,
    printed: Option<Instant>,
}

impl Screen {
    pub fn new(plain: bool) -> Self {
        let term = Term::stdout();
        let live = !plain && term.features().is_attended();
        if live {
            let _ = term.hide_cursor();
        }
        Screen { term, live, drawn: 0, began: Instant::now(), printed: None }
    }

    pub fn title(&mut self, lines: &[&str]) {
        for line in lines {
            self.write(line);
        }
        self.write("");
    }

    /// Says what happens next; stays on the screen.
    pub fn say(&mut self, text: &str) {
        self.erase();
        let at = self.began.elapsed().as_secs_f64();
        let mark = style(format!("{at:5.1} s")).dim();
        self.write(&format!("{mark}  {}", style(text).bold()));
        self.printed = None;
    }

    /// Shows the motors as they are now.
    pub fn show(&mut self, rows: &[Row]) {
        if self.live {
            self.erase();
            let mut lines = vec![style(header()).dim().to_string()];
            lines.extend(rows.iter().map(table_line));
            for line in &lines {
                self.write(line);
            }
            self.drawn = lines.len();
        } else if self.printed.is_none_or(|at| at.elapsed() >= PLAIN_EVERY) {
            self.printed = Some(Instant::now());
            let moving = |row: &&Row| row.alarm || !row.speed.trim_start().starts_with("0 ");
            for row in rows.iter().filter(moving) {
                self.write(&format!("         {}", plain_line(row)));
            }
        }
    }

    /// Leaves what stands on the screen.
    pub fn end(&mut self) {
        self.drawn = 0;
        if self.live {
            let _ = self.term.show_cursor();
        }
    }

    fn erase(&mut self) {
        let _ = self.term.clear_last_lines(std::mem::take(&mut self.drawn));
    }

    /// A reader that is gone is noticed by the summary.
    fn write(&self, line: &str) {
        // A line that wraps could not be erased.
        let width = if self.live { usize::from(self.term.size().1) } else { usize::MAX };
        let _ = self.term.write_line(&truncate_str(line, width, ""));
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        self.end();
    }
}

fn header() -> String {
    format!(
        "  {:<8}{:<28}{:>12}{:>12}{:>9}{:>10}",
        "motor", "state", "speed", "current", "temp", "voltage"
    )
}

fn table_line(row: &Row) -> String {
    let state = format!("{:<28}", row.state);
    let state = if row.alarm { style(state).red().bold() } else { style(state).green() };
    format!(
        "  {:<8}{state}{:>12}{:>12}{:>9}{:>10}",
        row.motor, row.speed, row.current, row.temperature, row.voltage
    )
}

fn plain_line(row: &Row) -> String {
    format!(
        "{:<8}{:<24}{:>12}{:>12}{:>9}{:>10}",
        row.motor, row.state, row.speed, row.current, row.temperature, row.voltage
    )
}
