//! Events and load profiles of a scenario from their tables.

use std::path::Path;

use motorlink_link::printable;
use motorlink_proto::rmd::MotorId;
use motorlink_proto::st::{ErrorCode, MotorNumber};
use motorlink_proto::time::{Instant, Micros};
use serde::de::DeserializeOwned;
use toml::Table;

use super::act::{ERRORS, SILENT};
use super::event::{Action, Event, load};
use super::message::{RmdMessage, StMessage};
use super::moment::moment;
use super::profile::LoadProfile;
use crate::cast::{Cast, Target};
use crate::command::Command;
use crate::drives::Drives;

/// Context for reading events.
pub(super) struct Reader<'a> {
    pub(super) cast: &'a Cast,
    pub(super) targets: &'a [Target],
    pub(super) folder: &'a Path,
    pub(super) duration: Micros,
}

impl Reader<'_> {
    pub(super) fn event(&self, mut table: Table) -> Result<Event, String> {
        let at: f64 = take(&mut table, "at")?.ok_or("it needs a time, `at`, in s")?;
        let moment = moment(at, self.duration)?;
        let place = |why: String| format!("at {at} s: {why}");
        let label: Option<String> = take(&mut table, "label").map_err(place)?;
        let refused: Option<String> = take(&mut table, "refused").map_err(place)?;
        let target = self.target(&mut table).map_err(place)?;
        let (action, words) = self.action(target, table).map_err(place)?;
        if let Action::World(command) = &action {
            let mut trial = Drives::new(self.cast).map_err(|e| place(e.to_string()))?;
            trial.change(Instant(0), target, command).map_err(place)?;
        }
        if let Some(refused) = &refused {
            announced(refused, &action).map_err(place)?;
        }
        let words = printable(&words);
        let label = label.map(|label| printable(&label)).unwrap_or_else(|| match self.targets {
            [_] => words.clone(),
            _ => format!("{target} {words}"),
        });
        Ok(Event { at: moment, target, action, words, label, refused })
    }

    fn target(&self, table: &mut Table) -> Result<Target, String> {
        let st: Option<u8> = take(table, "st")?;
        let rmd: Option<u8> = take(table, "rmd")?;
        let target = match (st, rmd) {
            (Some(number), None) => MotorNumber::new(number).map(Target::St),
            (None, Some(id)) => MotorId::new(id).map(Target::Rmd),
            _ => return Err("name the motor: `st = 1` or `rmd = 1`".to_owned()),
        };
        target.filter(|target| self.targets.contains(target)).ok_or_else(|| {
            let names: Vec<String> = self.targets.iter().map(Target::to_string).collect();
            format!("unknown motor; the motors are: {}", names.join(", "))
        })
    }

    fn action(&self, target: Target, mut table: Table) -> Result<(Action, String), String> {
        let world: Option<String> = take(&mut table, "world")?;
        match (world, table.contains_key("send")) {
            (None, true) => {}
            (Some(word), false) => return world_event(target, word, table),
            _ => return Err("use either `send` or `world`".to_owned()),
        }
        Ok(match target {
            Target::St(motor) => {
                let message: StMessage = typed(table)?;
                let bytes = message.encode(motor, self.cast.config.profile)?;
                (Action::Bytes(bytes), message.words())
            }
            Target::Rmd(id) => {
                let message: RmdMessage = typed(table)?;
                (Action::Frame(message.encode(id)?), message.words())
            }
        })
    }

    pub(super) fn load(&self, mut table: Table) -> Result<(Target, LoadProfile), String> {
        let motor = self.target(&mut table)?;
        let file: String = take(&mut table, "file")?.ok_or("it needs a `file`")?;
        if let Some(key) = table.keys().next() {
            return Err(format!("unknown key `{key}`; the keys are st or rmd, and file"));
        }
        let path = self.folder.join(file);
        let text = std::fs::read_to_string(&path)
            .map_err(|error| format!("cannot read `{}`: {error}", path.display()))?;
        let profile = LoadProfile::parse(&text)
            .and_then(|profile| {
                profile.torques().try_for_each(|torque| load(motor, torque).check())?;
                Ok(profile)
            })
            .map_err(|why| format!("{}: {why}", path.display()))?;
        Ok((motor, profile))
    }
}

/// Refuses an announced refusal that no drive sends.
fn announced(refused: &str, action: &Action) -> Result<(), String> {
    let known: Vec<&str> = match action {
        Action::World(_) => return Err("only a message can be refused".to_owned()),
        Action::Bytes(_) => ErrorCode::ALL.iter().filter_map(|code| code.name()).collect(),
        Action::Frame(_) => vec![SILENT, ERRORS],
    };
    if known.contains(&refused) {
        return Ok(());
    }
    Err(format!("unknown refusal `{refused}`; possible are {}", known.join(", ")))
}

fn world_event(target: Target, word: String, mut table: Table) -> Result<(Action, String), String> {
    if let Some(key) = ["command", "port", "motor"].iter().find(|key| table.contains_key(**key)) {
        return Err(format!("unknown key `{key}`"));
    }
    if word == "state" {
        return Err("`state` is not an event: use signals".to_owned());
    }
    if ["pause", "resume"].contains(&word.as_str()) {
        return Err(format!("`{word}` works on drives in real time only"));
    }
    let values: Vec<String> = table.values().map(ToString::to_string).collect();
    let words = format!("{word} {}", values.join(" ").replace('"', ""));
    let motor = match target {
        // All motors of an ST drive have one supply.
        Target::St(_) if word == "power-cycle" => None,
        Target::St(motor) => Some(motor.number()),
        Target::Rmd(id) => Some(id.number()),
    };
    if let Some(motor) = motor {
        table.insert("motor".to_owned(), i64::from(motor).into());
    }
    table.insert("command".to_owned(), word.into());
    let command: Command = typed(table)?;
    command.check()?;
    Ok((Action::World(command), words.trim().to_owned()))
}

/// Takes a value out of a table.
fn take<T: DeserializeOwned>(table: &mut Table, key: &str) -> Result<Option<T>, String> {
    let Some(value) = table.remove(key) else { return Ok(None) };
    value.try_into().map(Some).map_err(|error| format!("{key}: {}", text(&error)))
}

fn typed<T: DeserializeOwned>(table: Table) -> Result<T, String> {
    table.try_into().map_err(|error| text(&error))
}

fn text(error: &toml::de::Error) -> String {
    error.message().to_owned()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use crate::scenario::Scenario;

    #[test]
    fn errors_of_events_name_their_time() {
        let why = |text: &str| {
            let motors = "[[st.motor]]\n[[rmd.motor]]\nid = 3";
            let text = format!("title = \"\"\nduration = 1\n{motors}\n[[event]]\n{text}");
            Scenario::parse(&text, Path::new("")).unwrap_err()
        };
        assert!(why("st = 1\nsend = \"start\"").contains("event 1: it needs a time"));
        assert!(why("at = 1.1\nst = 1\nsend = \"start\"").contains("lasts from 0 to 1 s"));
        assert!(why("at = nan\nst = 1\nsend = \"start\"").contains("lasts from 0 to 1 s"));
        assert!(why("at = 0.5\nsend = \"start\"").contains("event 1: at 0.5 s: name the motor"));
        assert!(why("at = 0.5\nst = 2\nsend = \"start\"").contains("the motors are: st1, rmd3"));
        assert!(why("at = 0.5\nst = 1").contains("`send` or `world`"));
        assert!(why("at = 0.5\nst = 1\nsend = \"torque\"\niq_amps = 3").contains("torque"));
        assert!(why("at = 0.5\nst = 1\nsend = \"start\"\nlabl = \"\"").contains("labl"));
        assert!(why("at = 0.5\nst = 1\nworld = \"state\"").contains("signals"));
        assert!(why("at = 0.5\nst = 1\nworld = \"pause\"").contains("real time"));
        assert!(why("at = 0.5\nst = 1\nworld = \"load\"").contains("newton_metres"));
        let load = "at = 0.5\nst = 1\nworld = \"load\"\nnewton_metres = ";
        assert!(why(&format!("{load}nan")).contains("newton_metres is"));
        assert!(why(&format!("{load}1\nport = \"x\"")).contains("port"));
        assert!(why(&format!("{load}1\nrefused = \"x\"")).contains("only a message"));
        let start = "at = 0.5\nst = 1\nsend = \"start\"\nrefused = \"RATHER_NOT\"";
        assert!(why(start).contains("WRONG_CMD"));
        assert!(why("at = 0.5\nrmd = 3\nsend = \"off\"\nrefused = \"NO\"").contains("silent"));
        let fault = "at = 0.5\nst = 1\nworld = \"fault\"\nfault = \"BAD_LUCK\"";
        assert!(why(fault).contains("BREAK_IN"));
    }
}
