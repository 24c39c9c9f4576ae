//! The table of motors: columns that fit a terminal.

use console::{style, truncate_str};

/// One motor as the table shows it.
#[derive(Debug, Clone, Default)]
pub struct Row {
    pub motor: String,
    pub state: String,
    pub speed: String,
    pub current: String,
    pub temperature: String,
    pub voltage: String,
    pub is_turning: bool,
    pub is_fault: bool,
}

/// Width of the columns for a motor and its state, which are always there.
const MOTOR: usize = 9;
const STATE: usize = 26;

/// The other columns: title, width, value. A narrow terminal has the first of them.
type Column = (&'static str, usize, fn(&Row) -> &str);
const COLUMNS: [Column; 4] = [
    ("speed", 11, |row| &row.speed),
    ("current", 13, |row| &row.current),
    ("temp", 8, |row| &row.temperature),
    ("voltage", 10, |row| &row.voltage),
];

/// The table with its header, in colour; no line is wider than `width`.
pub fn lines(rows: &[Row], width: usize) -> Vec<String> {
    let mut header = format!("{:<MOTOR$}{:<STATE$}", "  motor", "state");
    for (title, size, _) in columns(width) {
        header += &format!("{title:>size$}");
    }
    let header = style(truncate_str(&header, width, "")).dim().force_styling(true).to_string();
    std::iter::once(header).chain(rows.iter().map(|row| line(row, width, true))).collect()
}

/// A row of the table.
pub fn line(row: &Row, width: usize, is_coloured: bool) -> String {
    let motor = format!("  {:<1$}", row.motor, MOTOR - 2);
    let state = style(format!("{:<STATE$}", row.state)).force_styling(is_coloured);
    let state = match (row.is_fault, row.is_turning) {
        (true, _) => state.red().bold(),
        (false, true) => state.green(),
        (false, false) => state,
    };
    let values = columns(width).map(|(_, size, value)| format!("{:>size$}", value(row)));
    let line = format!("{motor}{state}{}", values.collect::<String>());
    truncate_str(&line, width, "").into_owned()
}

/// The columns that fit.
fn columns(width: usize) -> impl Iterator<Item = Column> {
    COLUMNS.into_iter().scan(MOTOR + STATE, move |used, column| {
        *used += column.1;
        (*used <= width).then_some(column)
    })
}

#[cfg(test)]
mod tests {
    use console::measure_text_width;

    use super::*;

    #[test]
    fn the_whole_table_fits_80_columns_and_its_first_columns_fit_any_terminal() {
        let row = Row {
            motor: "RMD 4".to_owned(),
            state: "FAULT_NOW SPEED_FDBK".to_owned(),
            speed: "-12000 °/s".to_owned(),
            current: "-32768 s16A".to_owned(),
            temperature: "100 °C".to_owned(),
            voltage: "325.0 V".to_owned(),
            ..Row::default()
        };
        let whole = lines(std::slice::from_ref(&row), 80);
        for value in ["-12000 °/s", " -32768 s16A", " 100 °C", " 325.0 V"] {
            assert!(whole[1].contains(value), "{value}");
        }
        for width in 0..=200 {
            for line in lines(std::slice::from_ref(&row), width) {
                assert!(measure_text_width(&line) <= width.min(80), "{width}: {line}");
            }
        }
        let narrow = lines(&[row], 50);
        assert!(narrow[0].contains("speed") && !narrow[0].contains("current"));
    }
}
