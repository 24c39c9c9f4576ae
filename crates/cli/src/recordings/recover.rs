//! `motorlink recover`: checks a recording, and writes what can be read of a broken one into a new
//! file.

use std::fs::File;
use std::path::PathBuf;

use motorlink_link::printable;
use motorlink_recording::read::{Damage, Recording, lost};
use motorlink_recording::schema::Time;
use serde_json::{Map, json};

use super::input::Input;
use crate::failure::Failure;
use crate::json;
use crate::output::Printer;

#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    input: Input,
    /// The new file [default: `RUN.recovered.mcap` beside the old one if it is broken, else none]
    #[arg(short, long, value_name = "FILE.mcap", value_hint = clap::ValueHint::FilePath)]
    output: Option<PathBuf>,
    /// Replace the new file if it exists
    #[arg(long)]
    force: bool,
    /// Print one line of JSON instead of text
    #[arg(long)]
    json: bool,
}

pub fn run(args: &Args) -> Result<(), Failure> {
    let input = &args.input;
    let file = File::open(&input.file).map_err(|error| input.failed(&error))?;
    if file.metadata().is_ok_and(|it| it.is_file() && it.len() == 0) {
        let why = "is empty: its writer ended before it had written anything";
        return Err(Failure::lost(format!("{} {why}", input.name())));
    }
    let mut recording = Recording::checked(file).map_err(|error| input.unreadable(&error))?;
    let is_whole = recording.losses().is_empty();
    let path = args
        .output
        .clone()
        .or_else(|| (!is_whole).then(|| input.file.with_extension("recovered.mcap")));
    if let Some(path) = &path {
        let output = input.output("--output", path, args.force, false)?;
        output.write(|out| recording.write_to(out).map(drop))?;
    }
    let losses = recording.losses().to_vec();
    let times = recording.times();
    let messages = recording.message_count();
    let path = path.map(|path| printable(&path.display().to_string()));
    let why = lost(&losses);
    let mut object = Map::new();
    object.insert("ok".to_owned(), is_whole.into());
    object.insert("recording".to_owned(), input.name().into());
    object.insert("messages".to_owned(), messages.into());
    if let Some([first, last]) = times {
        let seconds = (last - first) as f64 / 1e9;
        object.insert("last".to_owned(), Time(last).text().into());
        object.insert("duration".to_owned(), json::quantity(seconds, 3, "s"));
    }
    if let Some(why) = &why {
        let missing = losses.iter().find_map(|loss| match loss.damage {
            Damage::Fewer { missing } => Some(missing),
            _ => None,
        });
        let mut lost = json!({ "bytes": recording.lost_bytes(), "why": why });
        if let Some(missing) = missing {
            lost["messages"] = missing.into();
        }
        object.insert("lost".to_owned(), lost);
    }
    object.extend(path.iter().map(|path| ("file".to_owned(), path.clone().into())));
    let mut lines = Vec::new();
    let mut row = |name: &str, text: String| lines.push(format!("{name:<9}  {text}"));
    let until = times.map_or(String::new(), |[first, last]| {
        format!(" in {:.3} s, until {}", (last - first) as f64 / 1e9, Time(last).text())
    });
    row(if is_whole { "whole" } else { "recovered" }, format!("{messages} messages{until}"));
    row("lost", why.clone().unwrap_or_else(|| "nothing".to_owned()));
    if let Some(path) = path {
        row("written", path);
    }
    Printer { json: args.json }.result(lines.join("\n"), object)?;
    match why {
        None => Ok(()),
        Some(why) => Err(Failure::lost(format!("{} is not whole: {why}", input.name()))),
    }
}
