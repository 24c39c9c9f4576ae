//! `motorlink fleet settings diff`: what differs between motors that should be the same.

use std::collections::BTreeMap;
use std::thread;

use motorlink::settings::{Dump, Tunable, fact};
use motorlink::{rmd, st};
use motorlink_fleet::key::Name;
use motorlink_fleet::network::Network;
use motorlink_fleet::remote::Remote;
use motorlink_telemetry::share::address::Address;
use motorlink_telemetry::share::drive_protocol::DriveProtocol;
use motorlink_telemetry::share::message::{Line, Protocol};
use serde_json::json;

use super::args::Motors;
use super::found::found;
use crate::failure::Failure;
use crate::output::{Printer, note};
use crate::text::counted;

#[derive(clap::Args)]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(clap::Subcommand)]
enum Command {
    /// Show what differs between motors of the same kind: firmware and settings (exit code 1 if some
    /// differ)
    Diff(Motors),
}

/// The settings of a motor as text, by name.
type Values = BTreeMap<String, String>;
/// The settings of motors of one kind, in the order of the motors.
type OfKind = Vec<(String, Values)>;
/// The motors with each value of a setting.
type Holders<'a> = BTreeMap<&'a str, Vec<&'a str>>;

/// What a setting is that a motor does not have.
const ABSENT: &str = "absent";

pub fn run(args: &Args) -> Result<(), Failure> {
    let Command::Diff(args) = &args.command;
    let network = args.at.via.network();
    let mut readers = Vec::new();
    for (node, info) in found(&network, &args.nodes)?.whole()? {
        for line in info.lines {
            let motors: Vec<_> = args.of_line(&node, &line).collect();
            if motors.is_empty() {
                continue;
            }
            let (node, network) = (node.clone(), network.clone());
            readers.push(thread::spawn(move || read_line(&node, network, &line, &motors)));
        }
    }
    let (mut kinds, mut failed): (BTreeMap<&str, OfKind>, _) = (BTreeMap::new(), 0_u64);
    for reader in readers {
        // A line that could not be read must not be left out.
        let read = reader.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        for Read { protocol, name, values } in read {
            match values {
                Ok(values) => kinds.entry(protocol).or_default().push((name, values)),
                Err(why) => {
                    note(format!("{name}: {why}"));
                    failed += 1;
                }
            }
        }
    }
    let mut differing = 0_u64;
    for (kind, motors) in &kinds {
        for (setting, holders) in differences(motors) {
            differing += 1;
            show(kind, setting, &holders, args.at.json)?;
        }
    }
    if failed > 0 {
        let motors = counted(failed, "motor");
        return Err(Failure::link(format!("the settings of {motors} could not be read")));
    }
    if let Some((kind, motors)) = kinds.iter().find(|(_, motors)| motors.len() == 1) {
        let only = &motors[0].0;
        return Err(Failure::link(format!(
            "{only} is the only {kind} motor: nothing to compare with"
        )));
    }
    let compared: Vec<_> = kinds
        .iter()
        .map(|(kind, motors)| format!("{} of {kind}", counted(motors.len() as u64, "motor")))
        .collect();
    let compared = compared.join(", ");
    match differing {
        _ if kinds.is_empty() => {
            Err(Failure::link("no motor has answered, so nothing was compared"))
        }
        0 => {
            note(format!("{compared}: no difference"));
            Ok(())
        }
        count => Err(Failure::differs(format!("{compared}: {} differ", counted(count, "setting")))),
    }
}

/// What was read of a motor.
struct Read {
    protocol: &'static str,
    name: String,
    values: Result<Values, String>,
}

/// Reads all settings of motors of a line.
fn read_line(node: &Name, network: Network, line: &Line, motors: &[(String, u8)]) -> Vec<Read> {
    let port = Remote::new(node.clone(), network).port(&line.line);
    let protocol = line.protocol.word();
    let read = |values: &dyn Fn(u8) -> Result<Values, String>| {
        let one = |(name, motor): &(String, u8)| Read {
            protocol,
            name: name.clone(),
            values: values(*motor),
        };
        motors.iter().map(one).collect()
    };
    let failed = |why: String| read(&|_| Err(why.clone()));
    let port = match port.parse() {
        Ok(port) => port,
        Err(error) => return failed(format!("{error}")),
    };
    match line.protocol {
        Protocol::St => {
            let profile =
                DriveProtocol::of(line).and_then(DriveProtocol::profile).unwrap_or_default();
            let options = st::Options { profile, ..Default::default() };
            match st::Client::open(&port, options) {
                Ok(client) => read(&|number| values(client.motor(number).map_err(text)?)),
                Err(error) => failed(error.to_string()),
            }
        }
        Protocol::Rmd => match rmd::Client::open(&port, rmd::Options::default()) {
            Ok(client) => read(&|id| values(client.motor(id).map_err(text)?)),
            Err(error) => failed(error.to_string()),
        },
    }
}

fn values<M: Tunable<Error: std::fmt::Display>>(motor: M) -> Result<Values, String> {
    let dump = Dump::reading(motor.tuning()).run(&motor).map_err(text)?;
    let mut values: Values = dump
        .values()
        .map(|(setting, digits)| (setting.name.clone(), setting.shown(digits)))
        .collect();
    for line in dump.identity() {
        let (what, is) = fact(line);
        values.insert(what.to_owned(), is.to_owned());
    }
    values.extend(dump.absent().iter().map(|name| (name.clone(), "refused".to_owned())));
    Ok(values)
}

fn text(error: impl std::fmt::Display) -> String {
    error.to_string()
}

/// The settings that are not the same in all motors.
fn differences(motors: &[(String, Values)]) -> Vec<(&str, Holders<'_>)> {
    let mut names: Vec<&str> =
        motors.iter().flat_map(|(_, values)| values.keys().map(String::as_str)).collect();
    names.sort_unstable();
    names.dedup();
    let holders = |setting: &str| {
        let mut holders = Holders::new();
        for (motor, values) in motors {
            let value = values.get(setting).map_or(ABSENT, String::as_str);
            holders.entry(value).or_default().push(motor);
        }
        holders
    };
    let all = names.into_iter().map(|setting| (setting, holders(setting)));
    all.filter(|(_, holders)| holders.len() > 1).collect()
}

/// Shows a setting: the value that most motors have first.
fn show(kind: &str, setting: &str, holders: &Holders<'_>, json: bool) -> Result<(), Failure> {
    let mut sorted: Vec<_> = holders.iter().collect();
    sorted.sort_by_key(|(_, motors)| std::cmp::Reverse(motors.len()));
    let width = sorted.iter().map(|(value, _)| value.chars().count()).max().unwrap_or(0);
    let lines: Vec<_> = sorted
        .iter()
        .map(|(value, motors)| format!("  {value:<width$}  {}", motors.join(", ")))
        .collect();
    let values: Vec<_> =
        sorted.iter().map(|(value, motors)| json!({"value": value, "drives": motors})).collect();
    Printer { json }.result(
        format!("{setting} ({kind})\n{}", lines.join("\n")),
        json!({"protocol": kind, "setting": setting, "values": values}),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_setting_that_is_the_same_is_not_shown() {
        let values = |pairs: &[(&str, &str)]| -> Values {
            pairs.iter().map(|(name, value)| ((*name).to_owned(), (*value).to_owned())).collect()
        };
        let motors = vec![
            ("arm1/st0/1".to_owned(), values(&[("SPEED_KP", "249"), ("SPEED_KI", "89")])),
            ("arm2/st0/1".to_owned(), values(&[("SPEED_KP", "249"), ("SPEED_KI", "90")])),
            ("arm3/st0/1".to_owned(), values(&[("SPEED_KP", "249")])),
        ];
        let found = differences(&motors);
        assert_eq!(found.len(), 1);
        let (setting, holders) = &found[0];
        assert_eq!(*setting, "SPEED_KI");
        assert_eq!(holders["89"], ["arm1/st0/1"]);
        assert_eq!(holders["absent"], ["arm3/st0/1"]);
    }
}
