//! What a person sees of a run: a bar while it runs, a row for what did not pass, a table by
//! paragraph.

use std::collections::BTreeMap;

use console::style;
use indexmap::IndexMap;
use indicatif::ProgressBar;
use motorlink_conformance::{Finding, Outcome, Reading, Report, Verdict, rmd, st};

use crate::failure::Failure;
use crate::output;

pub struct Screen {
    bar: ProgressBar,
    quiet: bool,
    verbose: bool,
}

impl Screen {
    /// A screen for a run of `cases`. A quiet one leaves stdout alone.
    pub fn new(cases: usize, quiet: bool, verbose: bool) -> Self {
        Screen { bar: output::progress(cases), quiet, verbose }
    }

    /// Notes that a case has ended.
    pub fn show(&mut self, outcome: &Outcome) {
        self.bar.set_message(outcome.name.clone());
        self.bar.inc(1);
    }

    /// Prints the results.
    pub fn summary(&self, report: &Report) -> Result<(), Failure> {
        self.bar.finish_and_clear();
        if self.quiet {
            return Ok(());
        }
        for outcome in &report.outcomes {
            if self.verbose || matches!(outcome.verdict, Verdict::Failed(_)) {
                row(outcome)?;
            }
        }
        readings(report)?;
        paragraphs(report)?;
        reasons(report)
    }
}

fn row(outcome: &Outcome) -> Result<(), Failure> {
    let word = outcome.verdict.word();
    let word = match outcome.verdict {
        Verdict::Passed => style(word).green(),
        Verdict::Reading => style(word).yellow(),
        Verdict::Skipped(_) => style(word).dim(),
        Verdict::Failed(_) | Verdict::NotRun(_) => style(word).red().bold(),
    };
    output::print_line(&format!(
        "{word:<8} {}  {}",
        outcome.name,
        style(outcome.clauses.join(" ")).dim()
    ))?;
    match &outcome.verdict {
        Verdict::Passed | Verdict::Reading => Ok(()),
        Verdict::Failed(finding) => {
            found(finding)?;
            demands(outcome.clauses)
        }
        Verdict::Skipped(why) | Verdict::NotRun(why) => {
            output::print_line(&format!("           {why}"))
        }
    }
}

/// What was sent, expected and received, and the reading that demands it.
fn found(Finding { sent, expected, received, reading }: &Finding) -> Result<(), Failure> {
    if let Some(Reading { row, text }) = reading {
        output::print_line(&format!("           reading  {row}: {text}"))?;
    }
    output::print_line(&format!(
        "           sent     {sent}\n           expected {expected}\n           received {received}"
    ))
}

/// Differences from readings by their row, each with what a first case found.
fn readings(report: &Report) -> Result<(), Failure> {
    let mut rows: IndexMap<Reading, (&Outcome, &Finding, usize)> = IndexMap::new();
    for outcome in &report.outcomes {
        for finding in &outcome.differences {
            let Some(reading) = finding.reading else { continue };
            rows.entry(reading).or_insert((outcome, finding, 0)).2 += 1;
        }
    }
    if rows.is_empty() {
        return Ok(());
    }
    output::print_line(
        &"Differences from our readings of what the document leaves open, which are no failures:",
    )?;
    for (Reading { row, text }, (outcome, finding, count)) in rows {
        output::print_line(&format!("{:<8} {text}", style(row).yellow()))?;
        let others = if count > 1 { format!(", and {} others", count - 1) } else { String::new() };
        output::print_line(&format!("           case     {}{others}", outcome.name))?;
        found(&Finding { reading: None, ..finding.clone() })?;
    }
    output::print_line(&"")
}

/// What the clauses of a case demand.
fn demands(clauses: &[&str]) -> Result<(), Failure> {
    for id in clauses {
        let mut all = st::CLAUSES.iter().chain(rmd::CLAUSES);
        if let Some(clause) = all.find(|clause| clause.id == *id) {
            output::print_line(&format!("           {id:<10} {}", style(clause.text).dim()))?;
        }
    }
    Ok(())
}

/// A line a paragraph, in the order of the document.
fn paragraphs(report: &Report) -> Result<(), Failure> {
    let mut table: BTreeMap<(Option<Vec<u32>>, &str), [usize; 5]> = BTreeMap::new();
    for outcome in &report.outcomes {
        let clause = outcome.clauses.first().copied().unwrap_or("");
        let paragraph = clause.rsplit_once('-').map_or(clause, |(paragraph, _)| paragraph);
        let column = match outcome.verdict {
            Verdict::Passed => 0,
            Verdict::Failed(_) => 1,
            Verdict::Reading => 2,
            Verdict::Skipped(_) => 3,
            Verdict::NotRun(_) => 4,
        };
        table.entry((place(paragraph), paragraph)).or_default()[column] += 1;
    }
    output::print_line(&format!(
        "{:<10} {:>7} {:>7} {:>8} {:>8} {:>8}",
        "paragraph", "passed", "failed", "reading", "skipped", "not run"
    ))?;
    let mut total = [0; 5];
    for ((_, paragraph), counts) in table {
        counted(paragraph, counts)?;
        total.iter_mut().zip(counts).for_each(|(sum, count)| *sum += count);
    }
    counted("all", total)
}

/// The numbers of a paragraph, so that 4.10 comes behind 4.9. Read as hexadecimal, which keeps that
/// order and puts chapters before commands.
fn place(paragraph: &str) -> Option<Vec<u32>> {
    let (_, numbers) = paragraph.rsplit_once('-')?;
    numbers.split('.').map(|number| u32::from_str_radix(number, 16).ok()).collect()
}

fn counted(
    name: &str,
    [passed, failed, reading, skipped, not_run]: [usize; 5],
) -> Result<(), Failure> {
    let failed = match failed {
        0 => style(failed),
        _ => style(failed).red().bold(),
    };
    output::print_line(&format!(
        "{name:<10} {passed:>7} {failed:>7} {reading:>8} {skipped:>8} {not_run:>8}"
    ))
}

/// Why cases were skipped, each reason once.
fn reasons(report: &Report) -> Result<(), Failure> {
    let mut reasons = IndexMap::new();
    for outcome in &report.outcomes {
        if let Verdict::Skipped(why) = &outcome.verdict {
            *reasons.entry(why).or_insert(0) += 1;
        }
    }
    for (why, count) in reasons {
        output::print_line(&format!("{count} skipped: {why}"))?;
    }
    Ok(())
}
