//! `motorlink fleet watch`: what the drives of all nodes do, as the nodes publish it.

mod live;
mod table;

use std::collections::BTreeSet;
use std::time::{Duration, Instant};

use motorlink_fleet::key::Name;
use motorlink_fleet::view::View;

use super::args::Via;
use super::found::twins;
use crate::failure::Failure;
use crate::interrupt;
use crate::output::{Printer, print_line};
use crate::span::span_up_to;
use live::Choice;
use table::{Only, Row, Shown, Sort, Sum};

/// How long the first values may take.
const FIRST: Duration = Duration::from_secs(2);
/// How often they are looked for.
const LOOK: Duration = Duration::from_millis(20);

#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    via: Via,
    /// What is shown first
    #[arg(long, value_enum, default_value_t)]
    sort: Sort,
    /// Which drives are shown
    #[arg(long, value_enum, default_value_t)]
    only: Only,
    /// Drives with this in their name, such as arm1/ or /st0/
    #[arg(long, value_name = "TEXT", default_value = "")]
    name: String,
    /// A line for each node in the place of one for each drive
    #[arg(long)]
    by_node: bool,
    /// Print the table once, and end
    #[arg(long, conflicts_with = "every")]
    once: bool,
    /// Print the table again and again, 100ms to 1h
    #[arg(long, value_name = "TIME", value_parser = span_up_to(Duration::from_secs(3600)))]
    every: Option<Duration>,
    /// Print JSON, one object per line
    #[arg(long)]
    json: bool,
}

pub fn run(args: &Args) -> Result<(), Failure> {
    if args.every.is_some_and(|every| every < Duration::from_millis(100)) {
        return Err(Failure::usage("--every is 100ms to 1h"));
    }
    let prints = args.once || args.every.is_some();
    if !prints {
        if args.json {
            return Err(Failure::usage("--json needs --once or --every TIME"));
        }
        live::require_terminal()?;
    }
    let view = View::open(&args.via.network())?;
    if !prints {
        let Args { sort, only, by_node, .. } = *args;
        return live::show(&view, Choice::new(sort, only, by_node, args.name.clone()));
    }
    wait_for_values(&view);
    loop {
        print(&Shown::of(&view, args.sort, args.only, &args.name), args)?;
        match args.every {
            Some(every) if interrupt::wait(every) => {}
            _ => break,
        }
    }
    if let Some(node) = view.twins() {
        return Err(twins(&node));
    }
    let away = view.away();
    let away = away.keys().map(|(node, _)| node);
    let missing: BTreeSet<_> = view.silent().into_iter().chain(away).collect();
    if missing.is_empty() {
        return Ok(());
    }
    let names: Vec<_> = missing.into_iter().map(Name::as_str).collect();
    Err(Failure::link(format!("no answer of {}", names.join(", "))))
}

/// Waits until each motor has values, for a moment.
fn wait_for_values(view: &View) {
    let end = Instant::now() + FIRST;
    let is_waiting = || {
        let drives = view.drives();
        drives.iter().any(|drive| drive.at.is_none()) && Instant::now() < end
    };
    while is_waiting() && interrupt::wait(LOOK) {}
}

fn print(shown: &Shown, args: &Args) -> Result<(), Failure> {
    let printer = Printer { json: args.json };
    if !args.json {
        print_line(&table::summary(&shown.sums))?;
    }
    let width = shown.name_width(args.by_node);
    if args.by_node {
        if !args.json && !shown.sums.is_empty() {
            print_line(&Sum::header(width))?;
        }
        return shown.sums.iter().try_for_each(|it| printer.result(it.text(width), it.object()));
    }
    if !args.json && !shown.rows.is_empty() {
        print_line(&Row::header(width))?;
    }
    shown.rows.iter().try_for_each(|it| printer.result(it.text(width), it.object()))
}
