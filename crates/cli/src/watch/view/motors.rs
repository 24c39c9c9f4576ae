//! The page with a row for each motor.

use ratatui::text::{Line, Span};

use super::super::model::Model;
use super::super::row::Row;
use super::parts::{Shown, Theme, first, listed, notices, trend};
use crate::text::{fit, right};

/// The widths of the sparklines.
struct Columns {
    /// Of the speed.
    speeds: usize,
    /// Of the current; 0: no sparkline.
    currents: usize,
}

const NAME: usize = 10;
const STATE: usize = 15;
const SPEED: usize = 10;
const CURRENT: usize = 11;
const TEMPERATURE: usize = 6;
const VOLTAGE: usize = 6;
const RATE: usize = 9;
/// The mark, and a space after each column except the last.
const REST: usize = 1 + 7;
const FIXED: usize = NAME + STATE + SPEED + CURRENT + TEMPERATURE + VOLTAGE + RATE + REST;
/// The longest sparkline.
const LONGEST: usize = 50;
/// Up to this height there is no header, to show more motors.
const HEADED: usize = 2;
/// Lines for notices, if the terminal is high enough.
const NOTICES: usize = 5;

impl Columns {
    fn of(width: usize) -> Self {
        let left = width.saturating_sub(FIXED);
        match left {
            0..=29 => Columns { speeds: left, currents: 0 },
            _ => {
                let each = ((left - 1) / 2).min(LONGEST);
                Columns { speeds: each, currents: each }
            }
        }
    }
}

pub fn lines(shown: &Shown<'_>, theme: &Theme, width: usize, height: usize) -> Vec<Line<'static>> {
    let (model, place) = (shown.model, shown.place);
    let columns = Columns::of(width);
    // A line below the rows shows their range.
    let notices_height = NOTICES.min(height / 3);
    let rows = model.rows.len().min(height.saturating_sub(1 + notices_height).max(1));
    let mut lines = Vec::new();
    if height > HEADED {
        lines.push(Line::styled(header(&columns), theme.dim()));
    }
    let begin = first(place.row, rows);
    for (at, row) in model.rows.iter().enumerate().skip(begin).take(rows) {
        lines.push(listed(spans(model, row, &columns, theme), at == place.row, theme));
    }
    if rows < model.rows.len() {
        let text = format!("rows {} to {} of {}", begin + 1, begin + rows, model.rows.len());
        lines.push(Line::styled(text, theme.dim()));
    }
    lines.extend(notices(shown, theme, width, height.saturating_sub(lines.len())));
    lines
}

fn header(columns: &Columns) -> String {
    let fixed = [
        fit("motor", NAME),
        fit("state", STATE),
        right("speed", SPEED),
        right("current", CURRENT),
        right("temp", TEMPERATURE),
        right("supply", VOLTAGE),
        right("got/asked", RATE),
    ];
    let mut line = format!(" {}", fixed.join(" "));
    let [speeds, currents] = match columns.currents {
        0 => ["trend", ""],
        _ => ["trend of the speed", "trend of the current"],
    };
    line += &format!(" {}", fit(speeds, columns.speeds));
    if columns.currents > 0 {
        line += &format!(" {}", fit(currents, columns.currents));
    }
    line
}

fn spans(model: &Model, row: &Row, columns: &Columns, theme: &Theme) -> Vec<Span<'static>> {
    let (state, is_bad) = model.state(row);
    let value = |source| {
        match row.value(source) {
            Some(sample) => model.units.short(source, sample),
            // The details show the reason.
            None if row.refused.contains_key(&source) => "?".to_owned(),
            None => "-".to_owned(),
        }
    };
    let rate = row
        .rate()
        .filter(|_| !row.is_gone)
        .map_or_else(|| "-".to_owned(), |(asked, had)| format!("{}/{}", short(had), short(asked)));
    let main = row.main;
    let mut rest = [
        String::new(),
        right(&value(main.speed), SPEED),
        right(&value(main.current), CURRENT),
        right(&value(main.temperature), TEMPERATURE),
        right(&value(main.voltage), VOLTAGE),
        right(&rate, RATE),
    ]
    .join(" ");
    rest += &format!(" {}", trend(&row.speeds, columns.speeds));
    if columns.currents > 0 {
        rest += &format!(" {}", trend(&row.currents, columns.currents));
    }
    vec![
        Span::raw(fit(&row.name, NAME) + " "),
        Span::styled(fit(&state, STATE), theme.of(is_bad)),
        Span::raw(rest),
    ]
}

/// A rate in few characters.
pub fn short(hertz: f64) -> String {
    match hertz {
        ..99.95 => format!("{hertz:.1}"),
        _ => format!("{hertz:.0}"),
    }
}
