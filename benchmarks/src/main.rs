//! The benchmark: the cost of encoding, exchanges and cycles, compared with the limits of the
//! machine and the wire. `make bench` runs it.

mod can;
mod codec;
mod decode;
mod engine;
mod exchange;
mod kernel;
mod line;
mod machine;
mod python;
mod report;
mod result;
mod share;
mod simulation;

use clap::{Parser, Subcommand};

use report::{Goal, Section, Style};
use result::Result;

/// Measures Motorlink on this machine. Reports missed goals; the exit code is 0 nevertheless.
#[derive(Parser)]
#[command(name = "motorlink-bench")]
struct Args {
    #[command(subcommand)]
    what: What,
    /// Print Markdown, with the command and the machine, for docs/BENCHMARKS.md
    #[arg(long, global = true)]
    markdown: bool,
}

#[derive(Subcommand)]
enum What {
    /// Everything below
    All,
    /// Time and instructions to encode and decode each message
    Codec,
    /// Exchanges per second through real lines, against a raw loop
    Line,
    /// Cycles on a simulated 1 Mbit/s CAN bus, against the wire's ceiling
    Can,
    /// The engine: 36 motors at 100 Hz, and stops on saturated ports
    Engine {
        /// How long to read the motors, s
        #[arg(long, default_value_t = ENGINE_SECONDS)]
        seconds: u32,
    },
    /// A log of a CAN bus, decoded by `motorlink decode` and by cantools
    Decode,
    /// Instructions of an ST exchange, master and slave together
    Exchange,
    /// Instructions of an exchange of a share, with and without the frames that it keeps
    Share,
    /// Exchanges per second through Python, compared with pyserial
    Python,
    /// Simulated drives compared with real time and with other simulators
    Simulation,
    /// Repeats one piece of work, to be counted from outside
    #[command(hide = true)]
    Kernel { name: String, count: u32 },
    /// Measures one line for a while, in a process of its own
    #[command(hide = true)]
    Sitting { line: String },
    /// Replies on this number of ptys until the end of standard input
    #[command(hide = true)]
    Respond { count: u32 },
    /// Decodes a log as `motorlink decode rmd` does
    #[command(hide = true)]
    DecodeLog { log: std::path::PathBuf },
    /// Serves the drives of the engine until the end of standard input
    #[command(hide = true)]
    Drives,
}

/// How long the engine reads its motors, s.
const ENGINE_SECONDS: u32 = 10;

/// One part of the benchmark: its tables, and the results of its goals.
type Part<'a> = &'a dyn Fn() -> Result<(Vec<Section>, Vec<Goal>)>;

fn main() -> Result<()> {
    let args = Args::parse();
    let style = if args.markdown { Style::Markdown } else { Style::Plain };
    let seconds = match args.what {
        What::Engine { seconds } => seconds,
        _ => ENGINE_SECONDS,
    };
    let engine = || engine::measure(seconds);
    let parts: &[Part<'_>] = match args.what {
        What::All => &[
            &codec::measure,
            &line::measure,
            &python::measure,
            &can::measure,
            &engine,
            &exchange::measure,
            &share::measure,
            &simulation::measure,
            &decode::measure,
        ],
        What::Codec => &[&codec::measure],
        What::Line => &[&line::measure],
        What::Can => &[&can::measure],
        What::Engine { .. } => &[&engine],
        What::Decode => &[&decode::measure],
        What::DecodeLog { log } => return decode::decode(&log),
        What::Exchange => &[&exchange::measure],
        What::Share => &[&share::measure],
        What::Python => &[&python::measure],
        What::Simulation => &[&simulation::measure],
        What::Kernel { name, count } => return repeat(&name, count),
        What::Sitting { line } => return line::sitting(&line),
        What::Respond { count } => return line::respond(count),
        What::Drives => return engine::serve(),
    };
    machine::describe(style);
    let mut goals = Vec::new();
    for part in parts {
        let (sections, outcomes) = part()?;
        sections.iter().for_each(|section| section.print(style));
        goals.extend(outcomes);
    }
    report::goals(&goals).print(style);
    Ok(())
}

/// Runs under the instruction counter, see [`kernel::Counter`].
fn repeat(name: &str, count: u32) -> Result<()> {
    let kernels = codec::kernels().chain(exchange::kernels()).chain(share::kernels());
    let kernels = kernels.chain(simulation::kernels());
    let mut found = kernels.into_iter().filter(|kernel| kernel.name == name);
    found.next().ok_or_else(|| format!("no kernel is called {name}"))?.repeat(count);
    Ok(())
}
