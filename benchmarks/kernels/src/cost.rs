//! Instructions of the kernels, compared with a table.

use std::fmt::Write as _;
use std::fs;
use std::num::NonZeroU32;

use motorlink_kernels::compiler;
use motorlink_kernels::kernel::Counter;
use motorlink_kernels::result::Result;

const TABLE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/cost.txt");
/// How much more fails, and how much less deserves a new table.
const TOLERANCE: f64 = 0.02;
const UPDATE: &str = "`make cost UPDATE=1` writes a new table: a commit of its own that says why";

/// The table: the compiler, and the instructions of each kernel.
#[derive(Debug, PartialEq)]
struct Table {
    compiler: String,
    rows: Vec<(String, f64)>,
}

/// Compares the kernels with the table, or writes it.
pub fn check(update: bool) -> Result<()> {
    let Some(counter) = Counter::find() else {
        println!("SKIPPED: cost: valgrind is not installed");
        return Ok(());
    };
    let count = |name: String| {
        let count = counter.count(&name)?;
        Ok((name, count))
    };
    let rows = motorlink_kernels::names().map(count).collect::<Result<_>>()?;
    let counted = Table { compiler: compiler(), rows };
    if update {
        return Ok(fs::write(TABLE, counted.text())?);
    }
    let (lines, is_kept) = counted.compare(&Table::parse(&fs::read_to_string(TABLE)?)?);
    lines.iter().for_each(|line| println!("{line}"));
    if is_kept {
        Ok(())
    } else {
        Err("the instructions are not those of benchmarks/kernels/cost.txt".into())
    }
}

impl Table {
    fn text(&self) -> String {
        let mut text = format!("{}\n", self.compiler);
        for (name, count) in &self.rows {
            writeln!(text, "{count:6.0} {name}").expect("a text takes every line");
        }
        text
    }

    fn parse(text: &str) -> Result<Self> {
        let (compiler, rows) = text.split_once('\n').ok_or("the table is empty")?;
        let mut table = Table { compiler: compiler.trim_end().to_owned(), rows: Vec::new() };
        for line in rows.lines() {
            let (count, name) = line.trim().split_once(' ').ok_or("a row has no name")?;
            let count: NonZeroU32 = count.parse().map_err(|error| format!("{line}: {error}"))?;
            if table.rows.iter().any(|(known, _)| known == name) {
                return Err(format!("{name}: two rows").into());
            }
            table.rows.push((name.to_owned(), count.get().into()));
        }
        Ok(table)
    }

    /// A line for each kernel, and whether the table is kept.
    fn compare(&self, wanted: &Table) -> (Vec<String>, bool) {
        let (mut lines, mut is_kept) = (Vec::new(), true);
        let mut fails = |line: String| {
            is_kept = false;
            format!("{line}. {UPDATE}")
        };
        // Another compiler makes other code, so a new one needs a new table.
        if self.compiler != wanted.compiler {
            let Table { compiler, .. } = wanted;
            lines.push(fails(format!("counted with {compiler}, this is {}", self.compiler)));
        }
        for (name, count) in &self.rows {
            let found = wanted.rows.iter().find(|(known, _)| known == name);
            let Some((_, before)) = found else {
                lines.push(fails(format!("{name}: {count:.0} instructions, not in the table")));
                continue;
            };
            let more = count / before - 1.0;
            let line = format!("{name}: {count:.0} instructions, {:+.1} %", 100.0 * more);
            lines.push(match more {
                more if more > TOLERANCE => fails(line),
                more if more < -TOLERANCE => format!("{line}. {UPDATE}"),
                _ => line,
            });
        }
        for (name, _) in &wanted.rows {
            if !self.rows.iter().any(|(known, _)| known == name) {
                lines.push(fails(format!("{name}: in the table, but not a kernel")));
            }
        }
        (lines, is_kept)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(rows: &[(&str, f64)]) -> Table {
        let rows = rows.iter().map(|&(name, count)| (name.to_owned(), count)).collect();
        Table { compiler: "rustc 1".to_owned(), rows }
    }

    #[test]
    fn a_table_is_read_as_it_was_written() {
        let written = table(&[("exchange with memory", 964.0), ("RMD", 12_350.0)]);
        assert_eq!(Table::parse(&written.text()).unwrap(), written);
        assert_eq!(Table::parse(&written.text().replace('\n', "\r\n")).unwrap(), written);
        for rows in ["1 a\n2 a", "NaN a", "inf a", "-5 a", "0 a", "5"] {
            assert!(Table::parse(&format!("rustc 1\n{rows}\n")).is_err(), "{rows}");
        }
    }

    #[test]
    fn more_instructions_and_other_kernels_fail_but_not_less() {
        let wanted = table(&[("a", 1000.0), ("b", 1000.0)]);
        let is_kept = |rows: &[_]| table(rows).compare(&wanted).1;
        assert!(is_kept(&[("a", 1019.0), ("b", 900.0)]));
        assert!(!is_kept(&[("a", 1021.0), ("b", 1000.0)]));
        assert!(!is_kept(&[("a", 1000.0)]));
        assert!(!is_kept(&[("a", 1000.0), ("b", 1000.0), ("c", 1.0)]));
        let other = Table { compiler: "rustc 2".to_owned(), ..table(&[("a", 1.0), ("b", 1.0)]) };
        assert!(!other.compare(&wanted).1);
    }

    #[test]
    fn a_line_says_how_much_more() {
        let (lines, _) = table(&[("a", 1100.0)]).compare(&table(&[("a", 1000.0)]));
        assert_eq!(lines, [format!("a: 1100 instructions, +10.0 %. {UPDATE}")]);
    }

    #[test]
    fn each_counted_kernel_can_be_repeated() {
        let table = Table::parse(&fs::read_to_string(TABLE).unwrap()).unwrap();
        assert!(table.rows.iter().all(|(name, _)| motorlink_kernels::named(name).is_some()));
    }
}
