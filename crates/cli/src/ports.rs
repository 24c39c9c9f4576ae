//! `motorlink ports`

use motorlink::list::{self, PortInfo};
use motorlink::port::Carries;
use serde_json::json;

use crate::failure::Failure;
use crate::output::{Printer, print_line};

#[derive(clap::Args)]
pub struct Args {
    /// Print a JSON object a port
    #[arg(long)]
    json: bool,
}

pub fn run(args: Args) -> Result<(), Failure> {
    let ports = list::ports();
    if ports.is_empty() && !args.json {
        print_line(&"No serial device and no CAN interface is connected.")?;
        return print_line(&"Without hardware: `motorlink demo`, or `-p sim:` with any command.");
    }
    let width = ports.iter().map(|port| port.name.len()).max().unwrap_or(0);
    for port in &ports {
        Printer { json: args.json }.result(text(port, width), object(port))?;
    }
    Ok(())
}

fn kind(port: &PortInfo) -> &'static str {
    match port.carries {
        Carries::Bytes => "serial",
        Carries::Frames => "CAN",
        Carries::Both => "both",
    }
}

fn text(port: &PortInfo, width: usize) -> String {
    let description = port.description.as_deref().unwrap_or("");
    let mut text = format!("{:<width$}  {:<6}  {description}", port.name, kind(port));
    if let Some(path) = &port.stable_path {
        text += &format!("\n{:width$}          always {}", "", path.display());
    }
    match &port.problem {
        Some(problem) => {
            let mark = console::style("!").yellow().bold();
            text += &format!("\n{:width$}        {mark} {problem}", "");
        }
        None => text += &format!("  {}", console::style("ready").green()),
    }
    text
}

fn object(port: &PortInfo) -> serde_json::Value {
    json!({
        "port": port.name,
        "kind": kind(port).to_lowercase(),
        "description": port.description,
        "stable_path": port.stable_path,
        "problem": port.problem,
    })
}
