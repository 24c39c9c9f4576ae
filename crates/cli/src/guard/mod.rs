//! `motorlink guard`: holds a drive's line and stops the motors when its client is gone.

mod prove;
mod supervisor;
mod words;

use std::ffi::OsString;
use std::time::Duration;

use motorlink::port::PortName;
use motorlink::relay::{Event, Relay, RelayOptions};
use motorlink::rmd::StopAction;
use motorlink_link::serve::ServeName;
use motorlink_link::serve::Served;
use serde_json::json;

use crate::connection::Port;
use crate::failure::Failure;
use crate::interrupt::{self, interrupted};
use crate::output::{self, note};
use crate::span::parse_span;
use prove::{Proof, Spin};
use supervisor::Supervisor;

/// How soon a signal is noticed.
const SIGNAL_PERIOD: Duration = Duration::from_millis(50);

#[derive(clap::Args)]
#[command(
    args_conflicts_with_subcommands = true,
    after_help = "\
Without `st` or `rmd` it guards an ST drive; options go behind that word. `motorlink guard rmd --help` \
has more options.

ST's protocol has no watchdog: a drive that was told START_MOTOR turns until it is told STOP_MOTOR, \
whatever became of the program that started it. An RMD motor goes on until its shutdown time, if the \
vendor's tool has set one. A guard is a process of its own between that program and the drive. It \
passes everything on as it is and notes which motors are set turning. When the program closes its \
line, crashes or is killed, the guard stops those motors, says so, and waits for the next program. So \
a one-shot `motorlink st start` through a guard is stopped as soon as it ends.

One program at a time: over TCP and Unix sockets a second one is closed at once; on a pty one that \
locks its port, as motorlink does, is told that it is in use. Baud rates and bitrates of programs have \
no effect, the guard's count.

What it cannot do: stop a motor when the guard itself is killed with SIGKILL, when the cable to the \
drive is cut, or when the machine stops. Whoever may get hurt needs an emergency stop in hardware.

Prints one JSON line per port once it is ready; with --json, also one for each thing that happens. \
Output that is not read is dropped. Every signal that asks for the end stops the motors and then ends \
it: exit code 0, or 3 if a motor did not say that it stops. contrib/ has a unit for systemd."
)]
pub struct Args {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    st: StArgs,
}

#[derive(clap::Subcommand)]
enum Command {
    /// Guard an ST drive on a serial line
    St(StArgs),
    /// Guard RMD motors on a CAN bus
    Rmd(RmdArgs),
    /// The program that `--prove` kills
    #[command(hide = true)]
    Spin(Spin),
}

#[derive(clap::Args)]
struct StArgs {
    #[command(flatten)]
    port: Port,
    /// Serve the line here: pty:PATH, unix-listen:PATH or tcp-listen:ADDRESS:PORT; may be given several
    /// times
    #[arg(long, value_name = "PORT", default_value = "pty:./drive")]
    serve: Vec<String>,
    /// The motor of --prove
    #[arg(long, value_name = "N", default_value_t = 1, requires = "prove",
        value_parser = clap::value_parser!(u8).range(1..=7))]
    motor: u8,
    #[command(flatten)]
    common: Common,
}

#[derive(clap::Args)]
struct RmdArgs {
    #[command(flatten)]
    port: Port,
    /// Serve slcan here: slcan-pty:PATH, unix-listen:PATH or tcp-listen:ADDRESS:PORT; may be given
    /// several times
    #[arg(long, value_name = "PORT", default_value = "slcan-pty:./bus")]
    serve: Vec<String>,
    /// What is done to motors whose program is gone: off (0x80) lets go, so that a load drops; stop
    /// (0x81) holds still
    #[arg(long, value_name = "ACTION", default_value = "stop")]
    on_loss: OnLoss,
    /// The motor of --prove
    #[arg(long, value_name = "ID", default_value_t = 1, requires = "prove",
        value_parser = clap::value_parser!(u8).range(1..=32))]
    id: u8,
    #[command(flatten)]
    common: Common,
}

#[derive(Clone, Copy, clap::ValueEnum)]
enum OnLoss {
    Off,
    Stop,
}

#[derive(clap::Args)]
struct Common {
    /// Stop the motors, too, when the program is there and sends nothing for so long, such as 2s
    #[arg(long, value_name = "TIME", value_parser = parse_span)]
    silence: Option<Duration>,
    /// Print what happens as JSON, an object a line
    #[arg(long)]
    json: bool,
    /// Turn a motor, kill the program that did so, and show how long it takes until the motor stands
    /// still; then end
    #[arg(long, requires = "spin", conflicts_with = "serve")]
    prove: bool,
    /// How fast --prove turns the motor: rpm (ST), or °/s (RMD)
    #[arg(long, value_name = "SPEED", requires = "prove", allow_negative_numbers = true)]
    spin: Option<i32>,
}

pub fn run(args: Args, program: &[OsString]) -> Result<(), Failure> {
    match args.command {
        None => guard_st(&args.st, program),
        Some(Command::St(args)) => guard_st(&args, program),
        Some(Command::Rmd(args)) => guard_rmd(&args, program),
        Some(Command::Spin(spin)) => spin.run(),
    }
}

fn guard_st(args: &StArgs, program: &[OsString]) -> Result<(), Failure> {
    let port = args.port.name()?;
    if port.as_line().is_none() {
        return Err(Failure::usage(format!(
            "`{port}` is a CAN bus, and an ST drive is on a serial line"
        ))
        .trying(format!("for RMD motors use `motorlink guard rmd -p {port}`")));
    }
    hold();
    let relay = Relay::st(&port, args.common.options())?;
    match args.common.spin {
        Some(speed) => Proof::st(port, args.motor, speed).show(program, relay, args.common.json),
        None => serve(relay, "st", &port, &args.serve, args.common.json),
    }
}

fn guard_rmd(args: &RmdArgs, program: &[OsString]) -> Result<(), Failure> {
    let port = args.port.name()?;
    let on_loss = match args.on_loss {
        OnLoss::Off => StopAction::Off,
        OnLoss::Stop => StopAction::Stop,
    };
    hold();
    let relay = Relay::rmd(&port, on_loss, args.common.options())?;
    match args.common.spin {
        Some(speed) => Proof::rmd(port, args.id, speed).show(program, relay, args.common.json),
        None => serve(relay, "rmd", &port, &args.serve, args.common.json),
    }
}

/// Motors depend on this process from now on.
fn hold() {
    output::never_wait();
    interrupt::hold();
}

impl Common {
    fn options(&self) -> RelayOptions {
        RelayOptions { silence: self.silence }
    }
}

/// Guards until a signal comes.
fn serve(
    mut relay: Relay,
    protocol: &str,
    port: &PortName,
    names: &[String],
    json: bool,
) -> Result<(), Failure> {
    let names: Vec<ServeName> = names.iter().map(|name| name.parse()).collect::<Result<_, _>>()?;
    let served: Vec<Served> =
        names.iter().map(|name| relay.serve(name)).collect::<Result<_, _>>()?;
    for Served { port: name, path } in served {
        output::print_line(&json!({
            "port": name, "protocol": protocol, "path": path, "guards": port.to_string(),
        }))?;
    }
    let mut supervisor = Supervisor::ready();
    let mut outcome = Ok(());
    while !interrupted() && outcome.is_ok() {
        supervisor.alive();
        outcome = relay
            .turn(SIGNAL_PERIOD)
            .map_err(Failure::from)
            .and_then(|events| events.iter().try_for_each(|event| tell(event, json, &supervisor)));
    }
    supervisor.stopping();
    // Whatever ended it, the motors come first.
    let last = relay.end();
    let told = last.iter().try_for_each(|event| tell(event, json, &supervisor));
    if last.iter().any(words::leaves_something_turning) {
        return Err(Failure::link("motors may still turn: not all said that they stop"));
    }
    outcome.and(told)
}

fn tell(event: &Event, json: bool, supervisor: &Supervisor) -> Result<(), Failure> {
    let (text, object) = words::of(event);
    supervisor.status(&text);
    note(text);
    if json { output::print_line(&object) } else { Ok(()) }
}
