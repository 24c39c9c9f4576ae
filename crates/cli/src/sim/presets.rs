//! `motorlink sim presets`: the motors that are there to start from, with every value.

use motorlink_testbench::preset;
use serde_json::{Value, json};

use crate::failure::Failure;
use crate::output::print_line;

#[derive(clap::Args)]
pub struct Args {
    /// A line of JSON a preset instead of the lines of a configuration
    #[arg(long)]
    json: bool,
}

pub fn run(args: &Args) -> Result<(), Failure> {
    for (name, config) in preset::ALL {
        let plant = shortest(&config())?;
        if args.json {
            print_line(&json!({ "preset": name, "plant": plant }))?;
        } else {
            print_line(&format!("# {name}"))?;
            settings("plant", &plant)?;
        }
    }
    Ok(())
}

/// As JSON, with the fewest digits that say which `f32` is meant; `to_value` would widen to `f64`.
fn shortest(plant: &impl serde::Serialize) -> Result<Value, Failure> {
    let text = serde_json::to_string(plant);
    let value = text.and_then(|text| serde_json::from_str(&text));
    value.map_err(|error| Failure::link(format!("a preset cannot be written: {error}")))
}

/// Prints each value as a line of TOML. What is not there has none.
fn settings(key: &str, value: &Value) -> Result<(), Failure> {
    match value {
        Value::Null => Ok(()),
        Value::Object(members) => {
            members.iter().try_for_each(|(name, value)| settings(&format!("{key}.{name}"), value))
        }
        value => print_line(&format!("{key} = {value}")),
    }
}
