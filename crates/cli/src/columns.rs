//! Samples as a table: a header with names and units, and one line per sample.
//!
//! A table that is wider than the terminal is folded: each sample takes several lines, and the header
//! too. If stdout is not a terminal, each sample is one line.

use std::ops::Range;

use console::Term;

use crate::failure::Failure;
use crate::json::Cell;
use crate::output::{in_words, print_line};

/// The minimum width of a number.
const NARROWEST: usize = 7;
/// The width of the time.
const TIME: usize = 10;
const GAP: &str = "  ";
/// The text of a value that the drive refused to give.
const NO_VALUE: &str = "-";

/// A table that grows with time.
pub struct Columns {
    columns: Vec<Column>,
    /// Lines and columns of the terminal.
    terminal: Option<(usize, usize)>,
    /// Lines that may follow before the header is due again; `None` before the first.
    room: Option<usize>,
}

#[derive(Clone)]
struct Column {
    name: String,
    unit: String,
    width: usize,
    is_number: bool,
}

impl Columns {
    pub fn on_stdout() -> Self {
        let size = Term::stdout().size_checked();
        let terminal = size.map(|(lines, columns)| (lines.into(), columns.into()));
        Columns { columns: Vec::new(), terminal, room: None }
    }

    /// The header comes before the next sample, as behind an outage.
    pub fn repeat_header(&mut self) {
        self.room = None;
    }

    /// Prints a sample, behind the header if that is due.
    pub fn print(&mut self, seconds: f64, cells: &[Cell]) -> Result<(), Failure> {
        self.lines(seconds, cells).iter().try_for_each(|line| print_line(line))
    }

    fn lines(&mut self, seconds: f64, cells: &[Cell]) -> Vec<String> {
        let is_wider = self.fit(cells);
        let folds = self.folds();
        let mut lines = Vec::new();
        if is_wider || self.room.is_none_or(|room| room < folds.len()) {
            lines.extend(self.header(&folds));
            let room = |(height, _): (usize, usize)| height.saturating_sub(lines.len() + 1);
            self.room = Some(self.terminal.map_or(usize::MAX, room));
        }
        let texts: Vec<&str> =
            cells.iter().map(|cell| cell.row().map_or(NO_VALUE, |row| row.short())).collect();
        for fold in &folds {
            let time = if fold.start == 0 { format!("{seconds:.3}") } else { String::new() };
            lines.push(self.line(fold, &time, fold.clone().map(|n| texts[n])));
        }
        self.room = self.room.map(|room| room.saturating_sub(folds.len()));
        lines
    }

    /// Widens the columns for a sample; whether they had been too narrow.
    fn fit(&mut self, cells: &[Cell]) -> bool {
        if self.columns.len() != cells.len() {
            self.columns = cells.iter().map(Column::of).collect();
            return true;
        }
        let mut is_wider = false;
        for (column, cell) in self.columns.iter_mut().zip(cells) {
            let now = Column::of(cell);
            is_wider |= now.width > column.width;
            column.width = column.width.max(now.width);
            if column.unit.is_empty() {
                column.unit = now.unit;
            }
        }
        is_wider
    }

    /// The columns of each line of a sample.
    fn folds(&self) -> Vec<Range<usize>> {
        let most = self.terminal.map_or(usize::MAX, |(_, columns)| columns);
        let (mut folds, mut start, mut width) = (Vec::new(), 0, TIME);
        for (n, column) in self.columns.iter().enumerate() {
            let wider = width + GAP.len() + column.width;
            if wider > most && n > start {
                folds.push(start..n);
                (start, width) = (n, TIME + GAP.len() + column.width);
            } else {
                width = wider;
            }
        }
        folds.push(start..self.columns.len());
        folds
    }

    /// Two lines a fold: names, and units.
    fn header(&self, folds: &[Range<usize>]) -> Vec<String> {
        let mut lines = Vec::new();
        for fold in folds {
            let (t, s) = if fold.start == 0 { ("t", "s") } else { ("", "") };
            let columns = &self.columns[fold.clone()];
            lines.push(self.line(fold, t, columns.iter().map(|column| &*column.name)));
            lines.push(self.line(fold, s, columns.iter().map(|column| &*column.unit)));
        }
        lines.retain(|line| !line.is_empty());
        lines
    }

    fn line<'a>(
        &self,
        fold: &Range<usize>,
        time: &str,
        texts: impl Iterator<Item = &'a str>,
    ) -> String {
        let mut line = format!("{time:>TIME$}");
        for (Column { width, is_number, .. }, text) in self.columns[fold.clone()].iter().zip(texts)
        {
            line += GAP;
            line += &if *is_number { format!("{text:>width$}") } else { format!("{text:<width$}") };
        }
        line.truncate(line.trim_end().len());
        line
    }
}

impl Column {
    fn of(cell: &Cell) -> Self {
        let name = in_words(&cell.name);
        let (unit, text) = cell.row().map_or(("", NO_VALUE), |row| (row.unit(), row.short()));
        let is_number = text == NO_VALUE || text.parse::<f64>().is_ok();
        let least = if is_number { NARROWEST } else { 0 };
        let widths = [&name, unit, text].map(|text: &str| text.chars().count());
        let width = widths.into_iter().fold(least, usize::max);
        Column { unit: unit.to_owned(), width, is_number, name }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::failure::Failure;
    use crate::json::Row;

    fn cells(speed: f64) -> Vec<Cell> {
        let refused = Err(Failure::refused("it says no"));
        vec![
            Row::quantity("SPEED_MEAS", speed, 0, "rpm").into(),
            Cell { name: "I_A".to_owned(), read: refused },
            Row::quantity("phase_a", 0.5, 3, "A").into(),
        ]
    }

    fn table(terminal: Option<(usize, usize)>) -> Columns {
        Columns { columns: Vec::new(), terminal, room: None }
    }

    #[test]
    fn the_header_comes_once_where_there_is_no_terminal() {
        let mut table = table(None);
        let lines = [table.lines(0.0, &cells(1500.0)), table.lines(0.1, &cells(-1500.0))].concat();
        let expected = [
            "         t  SPEED_MEAS      I_A  phase a",
            "         s         rpm                 A",
            "     0.000        1500        -    0.500",
            "     0.100       -1500        -    0.500",
        ];
        assert_eq!(lines, expected);
    }

    #[test]
    fn the_header_comes_again_after_a_screenful_and_an_outage() {
        let mut table = table(Some((5, 80)));
        let counts = |table: &mut Columns, samples: usize| -> Vec<usize> {
            (0..samples).map(|_| table.lines(0.0, &cells(1.0)).len()).collect()
        };
        assert_eq!(counts(&mut table, 5), [3, 1, 3, 1, 3]);
        table.repeat_header();
        assert_eq!(counts(&mut table, 2), [3, 1]);
    }

    #[test]
    fn a_wider_value_widens_its_column_under_a_new_header() {
        let mut table = table(None);
        assert_eq!(table.lines(0.0, &cells(1.0)).len(), 3);
        let wide = table.lines(1.0, &cells(-12_345_678_901.0));
        assert_eq!(wide.len(), 3);
        assert_eq!(wide[2], "     1.000  -12345678901        -    0.500");
        assert_eq!(table.lines(2.0, &cells(1.0)), ["     2.000             1        -    0.500"]);
    }

    #[test]
    fn a_table_wider_than_the_terminal_is_folded() {
        let mut table = table(Some((24, 32)));
        let lines = table.lines(0.0, &cells(1500.0));
        let expected = [
            "         t  SPEED_MEAS      I_A",
            "         s         rpm",
            "            phase a",
            "                  A",
            "     0.000        1500        -",
            "              0.500",
        ];
        assert_eq!(lines, expected);
    }
}
