//! Reads a scenario from a file.

use std::mem::take;
use std::path::{Path, PathBuf};

use motorlink_link::{printable, printable_lines};
use motorlink_proto::time::Micros;
use serde::Deserialize;
use toml::{Table, Value};

use super::event::{Action, Event};
use super::expect::Written;
use super::play::{Panel, Scenario};
use super::reader::Reader;
use super::script::Script;
use crate::cast::{Cast, Target};
use crate::command::Command;
use crate::config::{BenchConfig, toml_error};
use crate::signals::{Kind, Signal, find_signal};

/// Drives step on multiples of this, µs.
const STEP_US: u64 = 50;
/// Samples that a run can have, over all signals.
const MOST_VALUES: u64 = 20_000_000;
/// The longest run, s.
const LONGEST: f64 = 86_400.0;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    title: String,
    about: Option<String>,
    duration: f64,
    #[serde(default = "default_sample")]
    sample_us: u64,
    profile: Option<Value>,
    st: Option<Value>,
    rmd: Option<Value>,
    #[serde(default)]
    event: Vec<Table>,
    #[serde(default)]
    load_profile: Vec<Table>,
    #[serde(default)]
    panel: Vec<WrittenPanel>,
    #[serde(default)]
    expect: Vec<Written>,
}

const fn default_sample() -> u64 {
    1000
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WrittenPanel {
    title: Option<String>,
    signals: Vec<String>,
    range: Option<[f64; 2]>,
}

/// Why a scenario is refused.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ScenarioError {
    /// A file cannot be read.
    #[error("cannot read `{}`: {error}", printable(&.path.display().to_string()))]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Why.
        error: std::io::Error,
    },
    /// The file is invalid.
    #[error("{}: {why}", printable(&.path.display().to_string()))]
    InFile {
        /// The file.
        path: PathBuf,
        /// What, and where.
        why: String,
    },
}

impl Scenario {
    /// Reads a file. Paths in it are relative to its folder.
    pub fn read(path: &Path) -> Result<Self, ScenarioError> {
        let text = std::fs::read_to_string(path)
            .map_err(|error| ScenarioError::Unreadable { path: path.to_owned(), error })?;
        let folder = path.parent().unwrap_or(Path::new(""));
        Self::parse(&text, folder)
            .map_err(|why| ScenarioError::InFile { path: path.to_owned(), why })
    }

    /// Reads the text of a file in `folder`.
    ///
    /// # Errors
    /// What is invalid, and where.
    pub fn parse(text: &str, folder: &Path) -> Result<Self, String> {
        let file: File = toml::from_str(text).map_err(|error| toml_error(&error))?;
        Self::from_file(file, folder).map_err(|why| printable(&why))
    }

    fn from_file(mut file: File, folder: &Path) -> Result<Self, String> {
        let (duration, sample) = times(file.duration, file.sample_us)?;
        let files = file.load_profile.iter().filter_map(|load| load.get("file")?.as_str());
        let files = files.map(|file| folder.join(file)).collect();
        let script = file.script(folder, duration)?;
        let signals = script.cast.signals();
        let count = duration.0 / sample.0 + 1;
        if count.saturating_mul(signals.len() as u64) > MOST_VALUES {
            return Err(format!(
                "{count} samples of {} signals are too many: choose a greater sample_us",
                signals.len()
            ));
        }
        let panels = numbered("panel", file.panel, |panel| panel.resolve(&signals))?;
        let step = sample.0 as f64 / 1e6;
        let expectations = numbered("expect", file.expect, |written| {
            written.resolve(&signals, step, count as usize)
        })?;
        let (title, about) = (printable(&file.title), file.about.as_deref().map(printable_lines));
        Ok(Scenario {
            title,
            about,
            duration,
            sample,
            files,
            panels,
            script,
            signals,
            expectations,
        })
    }
}

impl File {
    /// The drives and their events.
    fn script(&mut self, folder: &Path, duration: Micros) -> Result<Script, String> {
        let (st, rmd) = (self.st.is_some(), self.rmd.is_some());
        if !st && !rmd {
            return Err("the scenario has no motor: add [[st.motor]] or [[rmd.motor]]".to_owned());
        }
        let sections =
            [("profile", self.profile.take()), ("st", self.st.take()), ("rmd", self.rmd.take())];
        let table = sections.into_iter().filter_map(|(key, value)| Some((key.to_owned(), value?)));
        let config = BenchConfig::from_table(table.collect()).map_err(|error| error.to_string())?;
        let cast = Cast { config, st, rmd };
        let reader = Reader { cast: &cast, targets: &cast.targets(), folder, duration };
        let loads =
            numbered("load_profile", take(&mut self.load_profile), |load| reader.load(load))?;
        let mut loaded: Vec<Target> = Vec::new();
        for (target, _) in &loads {
            if loaded.contains(target) {
                return Err(format!("{target} has two load_profiles"));
            }
            loaded.push(*target);
        }
        let mut events = numbered("event", take(&mut self.event), |event| reader.event(event))?;
        let profiled = |event: &&Event| {
            matches!(event.action, Action::World(Command::Load { .. }))
                && loaded.contains(&event.target)
        };
        if let Some(event) = events.iter().find(profiled) {
            return Err(format!("the load of {} comes from its load_profile", event.target));
        }
        events.sort_by_key(|event| event.at);
        Ok(Script { cast, events, loads })
    }
}

/// Length of the run and of a sample.
fn times(duration: f64, sample_us: u64) -> Result<(Micros, Micros), String> {
    if sample_us == 0 || !sample_us.is_multiple_of(STEP_US) {
        return Err(format!("sample_us is a multiple of {STEP_US}, not {sample_us}"));
    }
    if !(0.0..=LONGEST).contains(&duration) {
        return Err(format!("duration is 0 to {LONGEST} s, not {duration}"));
    }
    let micros = (duration * 1e6).round() as u64;
    if micros == 0 {
        return Err(format!("duration is {duration} s: it must be greater than 0"));
    }
    if !micros.is_multiple_of(sample_us) {
        return Err(format!(
            "duration {duration} s is not a multiple of the sample time, {sample_us} µs"
        ));
    }
    Ok((Micros(micros), Micros(sample_us)))
}

/// Reads each table of a list. An error has the number of its table.
fn numbered<T, U>(
    name: &str,
    list: Vec<T>,
    read: impl Fn(T) -> Result<U, String>,
) -> Result<Vec<U>, String> {
    let numbered = list.into_iter().zip(1..);
    numbered.map(|(item, n)| read(item).map_err(|why| format!("{name} {n}: {why}"))).collect()
}

impl WrittenPanel {
    fn resolve(self, signals: &[Signal]) -> Result<Panel, String> {
        let found: Result<Vec<usize>, String> =
            self.signals.iter().map(|name| find_signal(name, signals)).collect();
        let found = found?;
        let kinds: Vec<Kind> = found.iter().map(|&n| signals[n].kind).collect();
        let Some(first) = kinds.first() else { return Err("it has no signals".to_owned()) };
        let named = |kind: &Kind| matches!(kind, Kind::Named(_));
        if kinds.iter().any(|kind| kind.unit() != first.unit() || named(kind) != named(first)) {
            return Err("its signals have different units: use several panels".to_owned());
        }
        match self.range {
            Some(_) if named(first) => Err("names have no range".to_owned()),
            Some([low, high]) if (low..high).is_empty() || !(high - low).is_finite() => {
                Err(format!("the range {low} to {high} is empty"))
            }
            range => {
                Ok(Panel { title: self.title.as_deref().map(printable), signals: found, range })
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::signals::ST;

    const HEAD: &str = "title = \"t\"\nduration = 1.0\n";
    const SERVO: &str = "[[st.motor]]\npreset = \"servo\"\n[[rmd.motor]]\nid = 3\n";

    fn parse(text: &str) -> Result<Scenario, String> {
        Scenario::parse(&format!("{HEAD}{SERVO}{text}"), Path::new("/nowhere"))
    }

    #[test]
    fn events_are_sorted_by_time_and_then_by_their_order_in_the_file() {
        let text = "
            [[event]]
            at = 0.5
            st = 1
            send = \"start\"
            [[event]]
            at = 0.25
            rmd = 3
            send = \"speed\"
            speed_dps = 90
            [[event]]
            at = 0.5
            rmd = 3
            world = \"load\"
            newton_metres = 0.25
            label = \"\"
        ";
        let scenario = parse(text).unwrap();
        let labels: Vec<&str> = scenario.script.events.iter().map(|event| &*event.label).collect();
        assert_eq!(labels, ["rmd3 90 °/s", "st1 start", ""]);
        let names: Vec<&str> = scenario.signals.iter().map(|signal| &*signal.name).collect();
        assert_eq!((names[0], names[ST.len()]), ("st1.speed_rpm", "rmd3.speed_dps"));
    }

    #[test]
    fn invalid_times_are_refused() {
        let why = |duration: &str, sample: &str| {
            let text =
                format!("title = \"\"\nduration = {duration}\nsample_us = {sample}\n{SERVO}");
            Scenario::parse(&text, Path::new("")).unwrap_err()
        };
        assert!(why("1", "0").contains("multiple of 50"));
        assert!(why("1", "75").contains("multiple of 50"));
        assert!(why("1.0005", "1000").contains("not a multiple of the sample time"));
        assert!(why("0", "1000").contains("greater than 0"));
        assert!(why("-1", "1000").contains("duration"));
        assert!(why("nan", "1000").contains("duration"));
        assert!(why("inf", "1000").contains("duration"));
        assert!(why("80000", "50").contains("greater sample_us"));
    }

    #[test]
    fn errors_name_their_place() {
        let why = |text: &str| parse(text).unwrap_err();
        assert!(why("[[panels]]").contains("panels"));
        let nothing = Scenario::parse(HEAD, Path::new("")).unwrap_err();
        assert!(nothing.contains("no motor"), "{nothing}");
        assert!(why("[[panel]]\nsignals = []").contains("panel 1"));
        assert!(why("[[panel]]\nsignals = [\"st1.sped_rpm\"]").contains("st1.speed_rpm"));
        let units = "[[panel]]\nsignals = [\"st1.speed_rpm\", \"st1.iq_amps\"]";
        assert!(why(units).contains("different units"));
        let kinds = "[[panel]]\nsignals = [\"st1.speed_rpm\", \"st1.status\"]";
        assert!(why(kinds).contains("different units"));
        let range = "[[panel]]\nsignals = [\"st1.speed_rpm\"]\nrange = [1, nan]";
        assert!(why(range).contains("panel 1: the range"));
        let expect = "[[expect]]\nwhy = \"\"\nsignal = \"st1.speed_rpm\"\nat = 2\nmin = 0";
        assert!(why(expect).contains("expect 1: 2 s is not within the run"));
        assert!(why("[[load_profile]]\nst = 1\nfile = \"a.csv\"").contains("/nowhere/a.csv"));
        assert!(why("[[load_profile]]\nst = 1").contains("load_profile 1: it needs a `file`"));
    }
}
