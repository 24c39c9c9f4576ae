//! `motorlink sim presets`: the presets of motors, with all values.

use motorlink_testbench::preset;
use serde_json::{Value, json};

use crate::failure::Failure;
use crate::output::print_line;

#[derive(clap::Args)]
pub struct Args {
    /// Print one line of JSON per preset instead of lines of TOML
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

/// As JSON, with the fewest digits that give the same `f32`; `to_value` would widen it to `f64`.
fn shortest(plant: &impl serde::Serialize) -> Result<Value, Failure> {
    let text = serde_json::to_string(plant);
    let value = text.and_then(|text| serde_json::from_str(&text));
    value.map_err(|error| Failure::link(format!("a preset cannot be written: {error}")))
}

/// Prints each value as a line of TOML. Absent values are left out.
fn settings(key: &str, value: &Value) -> Result<(), Failure> {
    match value {
        Value::Null => Ok(()),
        Value::Object(members) => {
            members.iter().try_for_each(|(name, value)| settings(&format!("{key}.{name}"), value))
        }
        value => print_line(&format!("{key} = {value}")),
    }
}
