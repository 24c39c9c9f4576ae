//! What a person sees of a run: a bar while it runs, a row for what did not pass, a table by
//! paragraph.

use console::style;
use indicatif::ProgressBar;
use motorlink_conformance::{Outcome, Report, Verdict, rmd, st};

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

    /// Prints what came of it.
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
        paragraphs(report)?;
        reasons(report)
    }
}

fn row(outcome: &Outcome) -> Result<(), Failure> {
    let word = outcome.verdict.word();
    let word = match outcome.verdict {
        Verdict::Passed => style(word).green(),
        Verdict::Skipped(_) => style(word).dim(),
        Verdict::Failed(_) | Verdict::NotRun(_) => style(word).red().bold(),
    };
    output::line(&format!(
        "{word:<8} {}  {}",
        outcome.name,
        style(outcome.clauses.join(" ")).dim()
    ))?;
    match &outcome.verdict {
        Verdict::Passed => Ok(()),
        Verdict::Failed(finding) => {
            output::line(&format!(
                "           sent     {}\n           expected {}\n           received {}",
                finding.sent, finding.expected, finding.received
            ))?;
            demands(outcome.clauses)
        }
        Verdict::Skipped(why) | Verdict::NotRun(why) => output::line(&format!("           {why}")),
    }
}

/// What the clauses of a case demand.
fn demands(clauses: &[&str]) -> Result<(), Failure> {
    for id in clauses {
        let mut all = st::CLAUSES.iter().chain(rmd::CLAUSES);
        if let Some(clause) = all.find(|clause| clause.id == *id) {
            output::line(&format!("           {id:<10} {}", style(clause.text).dim()))?;
        }
    }
    Ok(())
}

/// A line a paragraph, in the order of the document.
fn paragraphs(report: &Report) -> Result<(), Failure> {
    let mut table: Vec<(&str, [usize; 4])> = Vec::new();
    for outcome in &report.outcomes {
        let clause = outcome.clauses.first().copied().unwrap_or("");
        let paragraph = clause.rsplit_once('-').map_or(clause, |(paragraph, _)| paragraph);
        let column = match outcome.verdict {
            Verdict::Passed => 0,
            Verdict::Failed(_) => 1,
            Verdict::Skipped(_) => 2,
            Verdict::NotRun(_) => 3,
        };
        match table.iter_mut().find(|(known, _)| *known == paragraph) {
            Some((_, counts)) => counts[column] += 1,
            None => {
                let mut counts = [0; 4];
                counts[column] = 1;
                table.push((paragraph, counts));
            }
        }
    }
    table.sort_by_key(|(paragraph, _)| place(paragraph));
    output::line(&format!(
        "{:<10} {:>7} {:>7} {:>8} {:>8}",
        "paragraph", "passed", "failed", "skipped", "not run"
    ))?;
    let mut total = [0; 4];
    for (paragraph, counts) in table {
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

fn counted(name: &str, [passed, failed, skipped, not_run]: [usize; 4]) -> Result<(), Failure> {
    let failed = match failed {
        0 => style(failed),
        _ => style(failed).red().bold(),
    };
    output::line(&format!("{name:<10} {passed:>7} {failed:>7} {skipped:>8} {not_run:>8}"))
}

/// Why cases were skipped, each reason once.
fn reasons(report: &Report) -> Result<(), Failure> {
    let mut reasons: Vec<(&str, usize)> = Vec::new();
    for outcome in &report.outcomes {
        if let Verdict::Skipped(why) = &outcome.verdict {
            match reasons.iter_mut().find(|(known, _)| known == why) {
                Some((_, count)) => *count += 1,
                None => reasons.push((why, 1)),
            }
        }
    }
    for (why, count) in reasons {
        output::line(&format!("{count} skipped: {why}"))?;
    }
    Ok(())
}
