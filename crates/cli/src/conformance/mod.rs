//! `motorlink conformance`: is this drive what its document says?

mod args;
mod host;
mod results;
mod screen;
mod world;

use motorlink::port::PortName;
use motorlink::st::Profile;
use motorlink::time::Micros;
use motorlink_conformance::{
    Case, Need, Report, Subject, host as hosts, rmd, run as run_cases, scenario_table, st,
};
use motorlink_telemetry::share::message::Protocol;

pub use args::Args;
use args::{Command, Run};
use results::verdict;
use world::Commands;

use crate::failure::Failure;
use crate::interrupt;
use crate::output;

pub fn run(args: Args) -> Result<(), Failure> {
    output::put_messages_in_json(match &args.command {
        Command::St { run, .. } | Command::Rmd { run, .. } => run.results.json_to_stdout(),
        Command::Host(args) => args.results.json_to_stdout(),
        Command::Scenarios { .. } | Command::Clauses { .. } => false,
    });
    match args.command {
        Command::St { port, run, motor, profile } => {
            let name = own(port.name()?)?;
            let link = name.open_bytes()?;
            let byte_time = byte_time(&name);
            let options = st::Options { profile, motor, allowed: run.allowed(), byte_time };
            let world = Box::new(Commands(run.clone()));
            let bench = st::Harness::new(link, world, options);
            interrupt::hold();
            conduct("st", &run, st::suite(profile), bench, |report| other_profile(profile, report))
        }
        Command::Rmd { port, run, write_rom, id, encoder } => {
            let link = own(port.name()?)?.open_can()?;
            let mut allowed = run.allowed();
            allowed.extend(write_rom.then_some(Need::Rom));
            let options = rmd::Options { id, encoder, allowed };
            let world = Box::new(Commands(run.clone()));
            let bench = rmd::Harness::new(link, world, options);
            interrupt::hold();
            conduct("rmd", &run, rmd::suite(), bench, |_| None)
        }
        Command::Host(args) => host::run(&args),
        Command::Scenarios { which: Protocol::St } => {
            output::print_line(&scenario_table(&hosts::st::scenarios()).trim_end())
        }
        Command::Scenarios { which: Protocol::Rmd } => {
            output::print_line(&scenario_table(&hosts::rmd::scenarios()).trim_end())
        }
        Command::Clauses { which: Protocol::St } => output::print_line(&st::table().trim_end()),
        Command::Clauses { which: Protocol::Rmd } => output::print_line(&rmd::table().trim_end()),
    }
}

/// A port that no other program holds. The holder would not pass on the frames of most cases.
fn own(name: PortName) -> Result<PortName, Failure> {
    match name.is_held() {
        true => Err(Failure::usage(format!(
            "`{name}` is held by another program, and the kit needs a port of its own"
        ))
        .trying("end the share, and give the port that it holds")),
        false => Ok(name),
    }
}

/// How long a start bit, eight data bits and a stop bit take, where there is a baud rate.
fn byte_time(name: &PortName) -> Micros {
    name.baud().map_or(Micros(0), |baud| Micros(10_000_000 / u64::from(baud)))
}

fn conduct<B: Subject>(
    name: &str,
    run: &Run,
    mut suite: Vec<Case<B>>,
    mut bench: B,
    advice: impl Fn(&Report) -> Option<String>,
) -> Result<(), Failure> {
    let results = &run.results;
    suite.retain(|case| results.wants(&case.name, case.clauses));
    let mut screen = results.screen(suite.len())?;
    let mut report = run_cases(&suite, &mut bench, |outcome| screen.show(outcome));
    if run.is_strict {
        report = report.strict();
    }
    screen.summary(&report)?;
    results.save(name, &report)?;
    if interrupt::interrupted() {
        return Err(Failure::Interrupted);
    }
    verdict(&report, "the drive").map_err(|failure| match advice(&report) {
        Some(advice) => failure.trying(advice),
        None => failure,
    })
}

/// What to try if the drive seems to follow the other profile.
fn other_profile(profile: Profile, report: &Report) -> Option<String> {
    let (other, failures) = st::other_profile(profile, report)?;
    Some(format!(
        "try --profile {}: {failures} of these cases exist only in profile {}",
        other.name(),
        profile.name()
    ))
}

impl Run {
    fn allowed(&self) -> Vec<Need> {
        let allowed = [
            (self.spin, Need::Spin),
            (self.power_cycle.is_some(), Need::PowerCycle),
            (self.fault_on.is_some(), Need::Fault),
        ];
        allowed.into_iter().filter_map(|(given, need)| given.then_some(need)).collect()
    }
}
