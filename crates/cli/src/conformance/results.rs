//! Results of a run: where they go, and which failure they are.

use std::io::Write;
use std::path::Path;

use motorlink_conformance::Report;

use super::args::Results;
use super::screen::Screen;
use crate::failure::Failure;
use crate::output;

impl Results {
    pub fn wants(&self, name: &str, clauses: &[&str]) -> bool {
        let Some(only) = &self.only else { return true };
        name.contains(only) || clauses.iter().any(|clause| clause.contains(only))
    }

    /// A screen for so many cases.
    pub fn screen(&self, cases: usize) -> Result<Screen, Failure> {
        match &self.only {
            Some(only) if cases == 0 => {
                Err(Failure::usage(format!("no case has `{only}` in its name or its clauses")))
            }
            _ => Ok(Screen::new(cases, self.json_to_stdout(), self.verbose)),
        }
    }

    pub fn save(&self, name: &str, report: &Report) -> Result<(), Failure> {
        if let Some(path) = &self.junit {
            write(path, &report.to_junit(name))?;
        }
        match &self.json {
            Some(_) if self.json_to_stdout() => output::print_line(&report.to_json()),
            Some(path) => write(path, &format!("{:#}\n", report.to_json())),
            None => Ok(()),
        }
    }

    /// `--json` without a file.
    pub fn json_to_stdout(&self) -> bool {
        self.json.as_deref() == Some(Path::new("-"))
    }
}

fn write(path: &Path, text: &str) -> Result<(), Failure> {
    let written = std::fs::File::create(path).and_then(|mut file| file.write_all(text.as_bytes()));
    written.map_err(|error| Failure::usage(format!("cannot write `{}`: {error}", path.display())))
}

/// `who` is what was tested.
pub fn verdict(report: &Report, who: &str) -> Result<(), Failure> {
    if report.is_clean() {
        return Ok(());
    }
    match report.count("not run") {
        0 => Err(refused(report, who)),
        count => Err(Failure::link(format!("{count} cases were not run: {}", report.lost()))),
    }
}

pub fn refused(report: &Report, who: &str) -> Failure {
    Failure::refused(format!(
        "{} of {} cases failed: {who} differs from its document",
        report.failed().count(),
        report.outcomes.len()
    ))
}
