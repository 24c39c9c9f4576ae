//! `motorlink conformance`: is this drive what its document says?

mod args;
mod screen;
mod world;

use std::io::Write;
use std::path::Path;

use motorlink::port::{LineName, PortName};
use motorlink::time::Duration;
use motorlink_conformance::wire::Real;
use motorlink_conformance::{Case, Need, Report, Subject, markdown, rmd, run as run_cases, st};

pub use args::Args;
use args::{Command, Run, Which};
use screen::Screen;
use world::Commands;

use crate::failure::Failure;
use crate::interrupt;
use crate::output;

pub fn run(args: Args) -> Result<(), Failure> {
    match args.command {
        Command::St { port, run, motor, profile } => {
            let name = port.name()?;
            let link = name.open_line()?;
            let byte_time = byte_time(&name);
            let options = st::Options { profile, motor, allowed: run.allowed(), byte_time };
            let world = Box::new(Commands::new(&run));
            let bench = st::Bench::new(Box::new(Real::new(link)), world, options);
            interrupt::take_over();
            conduct("st", &run, st::suite(profile), bench)
        }
        Command::Rmd { port, run, id, encoder } => {
            let link = port.name()?.open_can()?;
            let options = rmd::Options { id, encoder, allowed: run.allowed() };
            let world = Box::new(Commands::new(&run));
            let bench = rmd::Bench::new(Box::new(Real::new(link)), world, options);
            interrupt::take_over();
            conduct("rmd", &run, rmd::suite(), bench)
        }
        Command::Clauses { which: Which::St, profile } => {
            output::line(&markdown(st::CLAUSES, &st::suite(profile)).trim_end())
        }
        Command::Clauses { which: Which::Rmd, .. } => {
            output::line(&markdown(rmd::CLAUSES, &rmd::suite()).trim_end())
        }
    }
}

/// How long a start bit, eight data bits and a stop bit take, where there is a baud rate.
fn byte_time(name: &PortName) -> Duration {
    match name {
        PortName::Line(LineName::Serial { baud, .. }) => {
            Duration(10_000_000 / u64::from((*baud).max(1)))
        }
        _ => Duration(0),
    }
}

fn conduct<B: Subject>(
    name: &str,
    run: &Run,
    mut suite: Vec<Case<B>>,
    mut bench: B,
) -> Result<(), Failure> {
    if let Some(only) = &run.only {
        suite.retain(|case| {
            case.name.contains(only) || case.clauses.iter().any(|clause| clause.contains(only))
        });
        if suite.is_empty() {
            return Err(Failure::Usage(format!("no case has `{only}` in its name or its clauses")));
        }
    }
    let mut screen = Screen::new(suite.len(), run.json_to_stdout(), run.verbose);
    let report = run_cases(&suite, &mut bench, |outcome| screen.show(outcome));
    screen.summary(&report)?;
    save(name, run, &report)?;
    if interrupt::interrupted() {
        return Err(Failure::Interrupted);
    }
    verdict(&report)
}

fn save(name: &str, run: &Run, report: &Report) -> Result<(), Failure> {
    if let Some(path) = &run.junit {
        write(path, &report.to_junit(name))?;
    }
    match &run.json {
        Some(_) if run.json_to_stdout() => output::line(&report.to_json()),
        Some(path) => write(path, &format!("{:#}\n", report.to_json())),
        None => Ok(()),
    }
}

fn write(path: &Path, text: &str) -> Result<(), Failure> {
    let written = std::fs::File::create(path).and_then(|mut file| file.write_all(text.as_bytes()));
    written.map_err(|error| Failure::Usage(format!("cannot write `{}`: {error}", path.display())))
}

fn verdict(report: &Report) -> Result<(), Failure> {
    if report.is_clean() {
        return Ok(());
    }
    match report.count("not run") {
        0 => Err(Failure::Refused(format!(
            "{} of {} cases failed: the drive does not do what its document says",
            report.failed().count(),
            report.outcomes.len()
        ))),
        count => Err(Failure::Line(format!("{count} cases were not run: {}", report.lost()))),
    }
}

impl Run {
    fn allowed(&self) -> Vec<Need> {
        let allowed = [
            (self.spin, Need::Spin),
            (self.write_rom, Need::Rom),
            (self.power_cycle.is_some(), Need::PowerCycle),
            (self.fault_on.is_some(), Need::Fault),
        ];
        allowed.into_iter().filter_map(|(given, need)| given.then_some(need)).collect()
    }

    /// `--json` without a file.
    fn json_to_stdout(&self) -> bool {
        self.json.as_deref() == Some(Path::new("-"))
    }
}
