//! The tables of docs/RELIABILITY.md.

use std::fmt::Write;
use std::path::Path;

use motorlink_link::fault::{FaultError, Rng};
use motorlink_proto::st::{Frame, MAX_FRAME};

use crate::plan::{Speaks, Trial};
use crate::st::theory::share;
use crate::st::twice::Batches;
use crate::st::verified::Writes;
use crate::tally::Tally;

/// The marks before and after the tables.
const BEGIN: &str = "<!-- begin of what `make reliability` writes -->\n";
const END: &str = "<!-- end of what `make reliability` writes -->\n";

/// A Markdown table.
struct Table {
    text: String,
    columns: usize,
}

impl Table {
    fn new(columns: &[&str]) -> Self {
        let mut table = Table { text: String::new(), columns: columns.len() };
        table.row(columns.iter().map(|&column| column.to_owned()).collect());
        table.text += &format!("|---|{}\n", "---:|".repeat(columns.len() - 1));
        table
    }

    fn row(&mut self, cells: Vec<String>) {
        debug_assert_eq!(cells.len(), self.columns);
        self.text += &format!("| {} |\n", cells.join(" | "));
    }
}

/// One group of trials.
pub fn trials(title: &str, rows: &mut [(Trial, Tally)]) -> Result<String, FaultError> {
    let can = rows.iter().all(|(trial, _)| matches!(trial.speaks, Speaks::Rmd(_)));
    let mut columns = vec![
        "fault",
        "exchanges",
        "detected",
        "undetected",
        "theory",
        "carried out",
        "misplaced",
        "median, ms",
        "p99, ms",
        "max, ms",
        "longest, ms",
    ];
    if can {
        columns.insert(7, "twice");
    }
    let mut table = Table::new(&columns);
    for (trial, tally) in rows {
        let theory = trial.expected(tally)?;
        let recovery = tally.recovery();
        let time = |n: usize| match recovery {
            Some(times) => format!("{:.0}", times[n]),
            None => "-".to_owned(),
        };
        let mark = if trial.beyond { " (beyond)" } else { "" };
        let mut cells = vec![
            format!("`{}`{mark}", trial.faults),
            tally.exchanges.to_string(),
            tally.detected.to_string(),
            tally.undetected.to_string(),
            if theory == 0.0 { "0".to_owned() } else { format!("{theory:.1}") },
            tally.executed.to_string(),
            tally.misplaced.to_string(),
            time(0),
            time(1),
            time(2),
            format!("{:.0}", tally.longest.as_micros() as f64 / 1e3),
        ];
        if can {
            cells.insert(7, tally.repeated.to_string());
        }
        table.row(cells);
    }
    Ok(format!("### {title}\n\n{}\n", table.text))
}

/// Plain writes compared with verified ones.
pub fn writes(rows: &[(String, [Writes; 2])]) -> String {
    let mut table = Table::new(&[
        "line",
        "writes of each kind",
        "plain: done",
        "wrong",
        "beside",
        "verified: done",
        "wrong",
        "beside",
    ]);
    for (line, [plain, verified]) in rows {
        let kinds = [plain, verified].map(|kind| [kind.done, kind.wrong, kind.beside]);
        let cells = [line.clone(), plain.writes.to_string()].into_iter();
        table.row(cells.chain(kinds.into_iter().flatten().map(|n| n.to_string())).collect());
    }
    format!("### Plain and verified writes\n\n{}\n", table.text)
}

/// Reads of four registers on lines with duplicate replies, without and with confirmation.
pub fn twice(rows: &[(String, [Batches; 2])]) -> String {
    let mut table = Table::new(&[
        "line",
        "reads of four registers",
        "plain: detected",
        "wrong",
        "confirmed: detected",
        "wrong",
    ]);
    for (line, kinds) in rows {
        let counts = kinds.map(|kind| [kind.detected, kind.wrong]);
        let cells = [line.clone(), kinds[0].count.to_string()].into_iter();
        table.row(cells.chain(counts.into_iter().flatten().map(|n| n.to_string())).collect());
    }
    format!("### Replies that come twice, 1 to 20 ms apart\n\n{}\n", table.text)
}

/// The fraction of damaged frames that pass the checksum.
pub fn checksum() -> String {
    const FRAMES: u32 = 300;
    const WRONG: [usize; 6] = [1, 2, 3, 4, 6, 20];
    let mut rng = Rng::with_seed(1);
    let mut table = Table::new(&[
        "bytes of the frame",
        "1 wrong bit",
        "2",
        "closed form for 2",
        "3",
        "4",
        "6",
        "20",
    ]);
    for size in [4, 6, 9, 35, 131] {
        let mut sums = [0.0; WRONG.len()];
        for _ in 0..FRAMES {
            let mut payload = vec![0; size - 3];
            rng.fill(&mut payload);
            let mut out = [0; MAX_FRAME];
            let header = Frame::header(rng.u8(1..=0x0C), rng.u8(1..=2));
            let frame = Frame { header, payload: &payload };
            let bytes = frame.encode(&mut out).expect("at most 131 bytes").to_vec();
            for (sum, wrong) in sums.iter_mut().zip(WRONG) {
                *sum += share(&bytes, wrong, |_| true, &mut rng);
            }
        }
        let mut cells: Vec<String> =
            sums.iter().map(|sum| format!("{:.2} %", sum / f64::from(FRAMES) * 100.0)).collect();
        let bytes = size as f64;
        let closed = (bytes - 1.0) * (bytes - 2.0) / (2.0 * bytes * (8.0 * bytes - 1.0)) * 100.0;
        cells.insert(2, format!("{closed:.2} %"));
        cells.insert(0, size.to_string());
        table.row(cells);
    }
    format!("### What the checksum lets through\n\n{}\n", table.text)
}

/// Replaces the text between the marks of a file by `tables`.
pub fn update(path: &Path, tables: &str) -> Result<(), String> {
    let whole = std::fs::read_to_string(path).map_err(|error| format!("{path:?}: {error}"))?;
    let text = replaced(&whole, tables)
        .ok_or_else(|| format!("{path:?} lacks the lines {BEGIN:?} and {END:?}"))?;
    std::fs::write(path, text).map_err(|error| format!("{path:?}: {error}"))
}

fn replaced(whole: &str, tables: &str) -> Option<String> {
    let (before, rest) = whole.split_once(BEGIN)?;
    let (_, after) = rest.split_once(END)?;
    let mut text = String::new();
    write!(text, "{before}{BEGIN}\n{tables}{END}{after}").ok()?;
    Some(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_is_between_the_marks_is_replaced() {
        let whole = format!("# Title\n{BEGIN}old\n{END}prose\n");
        let once = replaced(&whole, "new\n").unwrap();
        assert_eq!(once, format!("# Title\n{BEGIN}\nnew\n{END}prose\n"));
        assert_eq!(replaced(&once, "new\n").unwrap(), once);
        assert_eq!(replaced("no marks", "new"), None);
    }
}
