//! `motorlink monitor`: a share with a page for browsers.

mod listen;
mod shown;

use std::io;
use std::net::TcpListener;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use motorlink_monitor::message::Role;
use motorlink_monitor::server::{self, Options, Settings, Tls};
use motorlink_telemetry::share::address::{Address, Local};
use motorlink_telemetry::share::message::{Answer, Ask, Line};
use motorlink_telemetry::share::port_config::Limits;
use motorlink_telemetry::share::server::Server;
use serde_json::json;

use crate::failure::Failure;
use crate::interrupt;
use crate::output;
use crate::share::{self, Connection, Lines, PROGRAM};
use crate::span::span_up_to;

use listen::Listen;
use shown::{Running, Shown};

/// Signs of life come each 50 ms.
const SHORTEST_DEADLINE: Duration = Duration::from_millis(200);
/// Simulated drives, without -p.
const SIMULATED: &str = "sim:";
/// How long simulated drives may take for a reply: on a busy machine longer than a motor.
const SIMULATED_TIMEOUT: Duration = Duration::from_millis(500);

#[derive(clap::Args)]
#[command(after_help = "\
Without -p the drives are simulated. -p and --profile are as for `motorlink share`, and the monitor is \
a share: other programs use the drives at the same time at --at. With --share, or with -p \
share:PATH/LINE, it shows all lines of a share that runs already. With --fleet it shows all nodes of a \
network, also those that come later.

Who may do what: the first address is for operators. The second one is for viewers, who see everything \
and can stop, nothing else. The third one is for programs that speak Foxglove's protocol, and read \
only. Each has a token: who has the address may do that. Only programs of this \
computer can connect, unless --listen has another address. That needs --tls-cert and --tls-key, or \
--insecure: without TLS anybody on the network can read the tokens.

Safety: a motor that a page turned stops when the page ends, or gives no sign of life for --deadline: \
the browser hangs, the tab is hidden, the network fails. The monitor cannot stop a motor if it is \
killed with SIGKILL or frozen, if the cable to the drive is cut, or if the computer stops. `motorlink \
guard` between monitor and drive stops it after SIGKILL, and with --silence if the monitor is frozen. So \
does the share of another process, with --share. \
If people can be hurt, use an emergency stop in hardware.

Output: the addresses, then one line per event. SIGINT, SIGTERM and the other signals that end a program \
stop the motors first. Exit code 0, or 3 if a motor did not confirm that it stops.")]
pub struct Args {
    #[command(flatten)]
    lines: Lines,
    /// Where other programs connect: unix:PATH. Only you can connect [default: a new folder]
    #[arg(long, value_name = "PORT", value_hint = clap::ValueHint::AnyPath)]
    at: Option<String>,
    #[command(flatten)]
    running: Running,
    #[command(flatten)]
    listen: Listen,
    /// How long a page may give no sign of life until its motors stop, 200ms to 2s
    #[arg(long, value_name = "TIME", default_value = "300ms",
        value_parser = span_up_to(Duration::from_secs(2)))]
    deadline: Duration,
    /// The folder of the recordings that pages make and show. The first recording makes it
    #[arg(long, value_name = "DIR", default_value = "recordings",
        value_hint = clap::ValueHint::DirPath)]
    recordings: PathBuf,
    /// Open the address of operators in the browser of this desktop
    #[arg(long)]
    open: bool,
    /// Print JSON, one object per line
    #[arg(long)]
    json: bool,
}

/// Where browsers connect, and how.
struct Web {
    listener: TcpListener,
    tls: Option<Tls>,
    foxglove: Option<TcpListener>,
}

pub fn run(mut args: Args) -> Result<(), Failure> {
    if args.deadline < SHORTEST_DEADLINE {
        return Err(Failure::usage("--deadline is 200ms to 2s: signs of life come each 50 ms"));
    }
    let running = args.running.shown(&args.lines, args.at.is_some())?;
    // Before the ports: if no browser can connect, no drive is touched.
    let web = Web {
        tls: args.listen.tls()?,
        listener: args.listen.bind()?,
        foxglove: args.listen.bind_foxglove()?,
    };
    output::never_wait(if args.json { output::missed } else { output::missed_text });
    interrupt::hold();
    match running {
        Some(share) => show(&args, share, web),
        None => hold(&mut args, web),
    }
}

/// Shows a share that runs in another program.
fn show(args: &Args, Shown { share, at, is_fleet }: Shown, web: Web) -> Result<(), Failure> {
    let what = if is_fleet { "fleet" } else { "share" };
    let failed = |error: io::Error| {
        Failure::link(format!("the {what} at {at}: {error}")).trying(match is_fleet {
            true => "is a router or a node there? --via says where",
            false => "is it that of a running `motorlink share`?",
        })
    };
    let mut asked = Connection::open(&*share, PROGRAM).map_err(failed)?;
    let Answer::Lines { lines, .. } = asked.ask(Ask::Lines).map_err(failed)? else {
        return Err(failed(io::Error::other("it gives another answer")));
    };
    drop(asked);
    if !is_fleet {
        args.lines.check(&lines)?;
    }
    let monitor = start(args, share, true, web)?;
    ready(args, &monitor, (what, &at), &lines, false)?;
    while interrupt::wait(Duration::from_secs(3600)) {}
    Ok(())
}

/// Holds the ports, too.
fn hold(args: &mut Args, web: Web) -> Result<(), Failure> {
    let is_simulated = args.lines.is_empty();
    if is_simulated {
        args.lines.ports = vec![SIMULATED.to_owned()];
        args.lines.timeout.get_or_insert(SIMULATED_TIMEOUT);
    }
    let (path, _folder) = share::socket(args.at.as_deref())?;
    let server = Server::open(&path, PROGRAM, args.lines.open(Limits::default())?)?;
    let at = format!("unix:{}", path.display());
    let monitor = start(args, Arc::new(Local(path)), false, web)?;
    let ready = ready(args, &monitor, ("share", &at), &server.hub.lines(), is_simulated);
    // The motors stop first, then the pages are closed.
    let outcome = share::serve(server, args.json, ready);
    drop(monitor);
    outcome
}

fn start(
    args: &Args,
    share: Arc<dyn Address>,
    separate_share: bool,
    web: Web,
) -> Result<server::Server, Failure> {
    let settings = Settings {
        separate_share,
        opens_addresses: args.listen.opens_addresses(),
        deadline: args.deadline,
        program: PROGRAM.to_owned(),
    };
    let (names, recordings) = (args.listen.names(), args.recordings.clone());
    let Web { listener, tls, foxglove } = web;
    let options = Options { listener, tls, names, foxglove, share, recordings, settings };
    Ok(server::Server::start(options)?)
}

/// Says where browsers and programs connect.
fn ready(
    args: &Args,
    monitor: &server::Server,
    (what, at): (&str, &str),
    lines: &[Line],
    is_simulated: bool,
) -> Result<(), Failure> {
    let host = args.listen.host();
    let url = monitor.url(&host, Role::Operator);
    let viewer_url = monitor.url(&host, Role::Viewer);
    let foxglove_url = monitor.foxglove_url(&host);
    if args.open
        && let Err(error) = open::that_detached(&url)
    {
        output::note(format!("no browser can be opened: {error}; open the first address yourself"));
    }
    if args.json {
        let mut ready = json!({
            "event": "ready", "at": at, "lines": share::lines_in_json(lines), "url": url,
            "viewer_url": viewer_url, "foxglove_url": foxglove_url, "simulated": is_simulated,
        });
        if let Some(url) = monitor.bare_url() {
            ready["foxglove_url_without_token"] = json!(url);
        }
        return output::print_line(&ready);
    }
    output::print_line(&format!("monitor: {url}"))?;
    output::print_line(&format!("for viewers: {viewer_url}"))?;
    output::print_line(&format!("for Foxglove and Lichtblick: {foxglove_url}"))?;
    if let Some(url) = monitor.bare_url() {
        output::print_line(&format!("for PlotJuggler: {url}"))?;
    }
    output::print_line(&share::lines_in_words(&format!("{what} at {at}"), lines))?;
    match is_simulated {
        true => output::print_line(&"all drives are simulated; -p PORT shows real ones"),
        false => Ok(()),
    }
}
