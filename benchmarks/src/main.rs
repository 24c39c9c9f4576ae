//! The benchmark: the cost of encoding, exchanges and cycles, compared with the limits of the
//! machine and the wire. `make bench` runs it.

mod can;
mod codec;
mod decode;
mod engine;
mod exchange;
mod line;
mod machine;
mod python;
mod report;
mod share;
mod simulation;

use std::fs;
use std::path::PathBuf;

use clap::{Parser, Subcommand};

use motorlink_kernels::kernel::Kernel;
use motorlink_kernels::result::Result;
use report::{Goal, Section};

/// Measures Motorlink on this machine. Reports missed goals; the exit code is 0 nevertheless.
#[derive(Parser)]
#[command(name = "motorlink-bench")]
struct Args {
    #[command(subcommand)]
    what: What,
}

#[derive(Subcommand)]
enum What {
    /// Everything below
    All {
        /// How long to read the motors of the engine, s
        #[arg(long, default_value_t = ENGINE_SECONDS)]
        seconds: u32,
        /// Write the command, the machine and all tables into this page: docs/BENCHMARKS.md
        #[arg(long)]
        update: Option<PathBuf>,
    },
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
    let (seconds, page) = match &args.what {
        What::All { seconds, update } => (*seconds, update.clone()),
        What::Engine { seconds } => (*seconds, None),
        _ => (ENGINE_SECONDS, None),
    };
    let engine = || engine::measure(seconds);
    let parts: &[Part<'_>] = match args.what {
        What::All { .. } => &[
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
        What::Exchange => &[&exchange::measure],
        What::Share => &[&share::measure],
        What::Python => &[&python::measure],
        What::Simulation => &[&simulation::measure],
        What::Kernel { name, count } => {
            kernel(&name).ok_or_else(|| format!("no kernel is called {name}"))?.repeat(count);
            return Ok(());
        }
        What::Sitting { line } => return line::sitting(&line),
        What::Respond { count } => return line::respond(count),
        What::Drives => return engine::serve(),
    };
    let machine = machine::lines();
    machine.iter().for_each(|(name, value)| println!("{name:<9}  {value}"));
    let (mut sections, mut goals) = (Vec::new(), Vec::new());
    for part in parts {
        let (measured, outcomes) = part()?;
        measured.iter().for_each(Section::print);
        sections.extend(measured);
        goals.extend(outcomes);
    }
    let goals = report::goals(&goals);
    goals.print();
    sections.push(goals);
    if let Some(page) = page {
        let text = report::updated(fs::read_to_string(&page)?, &machine, &sections);
        fs::write(&page, text)?;
    }
    Ok(())
}

/// The kernel that runs under the instruction counter, see `Counter`.
fn kernel(name: &str) -> Option<Kernel> {
    let mut kernels = codec::kernels().chain(share::kernels());
    kernels.find(|kernel| kernel.name == name).or_else(|| motorlink_kernels::named(name))
}
