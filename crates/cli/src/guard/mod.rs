//! `motorlink guard`: holds a drive's line and stops the motors when its client is gone.

mod prove;
mod supervisor;
mod words;

use std::ffi::OsString;
use std::time::Duration;

use motorlink::port::{Carries, PortName};
use motorlink::relay::{Event, Relay, RelayOptions};
use motorlink::rmd::StopAction;
use motorlink_link::serve::ServeName;
use motorlink_link::serve::Served;
use motorlink_telemetry::share::message::Protocol;
use serde_json::json;

use crate::connection::Port;
use crate::failure::Failure;
use crate::hint;
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
`motorlink guard` without `st` or `rmd` guards an ST drive. Write options behind `st` or `rmd`.

Why: ST's protocol has no watchdog. After START_MOTOR a drive turns until STOP_MOTOR, even if the \
program that started it is dead. An RMD motor turns until its shutdown time, if the vendor's tool has \
set one. A guard is a separate process between your program and the drive. It passes all data on \
unchanged, and records which motors were started. When your program closes the port, crashes or is \
killed, the guard stops these motors, prints this, and waits for the next program. Therefore a motor \
started by a single `motorlink st start` through a guard stops when this command ends.

One program at a time: over TCP and Unix sockets a second connection is closed at once. On a pty a \
second program that locks its port, as motorlink does, gets an error. The baud rate or bitrate of a \
program has no effect; the rate of the guard is used.

With --silence: a program that is silent while a motor may turn loses its connection after the stop, \
so that a frozen program that continues gets an error. The guard prints when a program turns motors \
again. On a pty a new pty is made, and the link moves to it: open the link, not its path.

Limits: a guard cannot stop a motor if the guard is killed with SIGKILL, if the cable to the drive is \
cut, or if the computer stops. If people can be hurt, use an emergency stop in hardware.

Output: one JSON line per port when it is ready; with --json also one line per event. Lines that are \
not read in time are dropped. SIGINT, SIGTERM and the other signals that end a program stop the motors \
first. Exit code 0, or 3 if a motor did not confirm that it stops. contrib/ has a systemd unit."
)]
pub struct Args {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(
        flatten,
        next_help_heading = "Options for an ST drive, as of `guard st` (for RMD: `motorlink guard rmd --help`)"
    )]
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
    /// Serve the line at this port: pty:PATH, unix-listen:PATH or tcp-listen:ADDRESS:PORT; may be
    /// repeated
    #[arg(long, value_name = "PORT", default_value = "pty:./drive")]
    serve: Vec<String>,
    /// The motor for --prove
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
    /// Serve slcan at this port: slcan-pty:PATH, unix-listen:PATH or tcp-listen:ADDRESS:PORT; may be
    /// repeated
    #[arg(long, value_name = "PORT", default_value = "slcan-pty:./bus")]
    serve: Vec<String>,
    /// How motors are stopped when the program ends: stop (0x81) holds them; off (0x80) lets them turn
    /// freely, so a load may fall
    #[arg(long, value_name = "ACTION", default_value = "stop",
          value_parser = hint::one_of(&[("off", StopAction::Off), ("stop", StopAction::Stop)]))]
    on_loss: StopAction,
    /// The motor for --prove
    #[arg(long, value_name = "ID", default_value_t = 1, requires = "prove",
        value_parser = clap::value_parser!(u8).range(1..=32))]
    id: u8,
    #[command(flatten)]
    common: Common,
}

#[derive(clap::Args)]
struct Common {
    /// Also stop the motors when the program sends nothing for this time, such as 2s, and close its
    /// connection
    #[arg(long, value_name = "TIME", value_parser = parse_span)]
    silence: Option<Duration>,
    /// Print events as JSON, one object per line
    #[arg(long)]
    json: bool,
    /// Test the guard: turn a motor, kill the program that turns it, and measure the time until the
    /// motor is still
    #[arg(long, requires = "spin", conflicts_with = "serve")]
    prove: bool,
    /// Speed for --prove: rpm (ST) or °/s (RMD)
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
    if !port.carries(Carries::Bytes) {
        return Err(Failure::usage(format!(
            "`{port}` is a CAN bus, but an ST drive needs a serial line"
        ))
        .trying(format!("for RMD motors use `motorlink guard rmd -p {port}`")));
    }
    hold();
    let relay = Relay::st(&port, args.common.options())?;
    match args.common.spin {
        Some(speed) => {
            let (protocol, motor) = (Protocol::St, args.motor);
            Proof { protocol, port, motor, speed }.show(program, relay, args.common.json)
        }
        None => serve(relay, Protocol::St, &port, &args.serve, args.common.json),
    }
}

fn guard_rmd(args: &RmdArgs, program: &[OsString]) -> Result<(), Failure> {
    let port = args.port.name()?;
    hold();
    let relay = Relay::rmd(&port, args.on_loss, args.common.options())?;
    match args.common.spin {
        Some(speed) => {
            let (protocol, motor) = (Protocol::Rmd, args.id);
            Proof { protocol, port, motor, speed }.show(program, relay, args.common.json)
        }
        None => serve(relay, Protocol::Rmd, &port, &args.serve, args.common.json),
    }
}

/// Motors depend on this process from now on.
fn hold() {
    output::never_wait(output::missed);
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
    protocol: Protocol,
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
        return Err(Failure::link("motors may still turn: not all confirmed that they stop"));
    }
    outcome.and(told)
}

fn tell(event: &Event, json: bool, supervisor: &Supervisor) -> Result<(), Failure> {
    let (text, object) = words::of(event);
    supervisor.status(&text);
    note(text);
    if json { output::print_line(&object) } else { Ok(()) }
}
