//! `dump`, `diff` and `restore`: settings of a motor as text, for both protocols.

mod interruption;

use std::fs::File;
use std::io::{ErrorKind, Read};
use std::path::{Path, PathBuf};

use motorlink::settings::{
    Cause, Comparison, Difference, Dump, Id, Kind, NotASetting, Permissions, Problem, RestoreError,
    Setting, SettingsFile, StepError, Tunable, Tuning, Undone, Unread,
};
use motorlink_link::printable;

use crate::failure::Failure;
use crate::interrupt;
use crate::json::{Line, Row};
use crate::output::{Printer, note};
use crate::outputs::{self, Output};
use crate::pasteable::{self, quoted};
use crate::text::counted;

use interruption::{Ended, Interruptible};

/// The name of stdin.
const STDIN: &str = "-";

/// Where settings are written to.
#[derive(clap::Args, Clone)]
pub struct DumpArgs {
    /// The file to write; `-` is stdout
    #[arg(value_name = "FILE", default_value = "-", value_hint = clap::ValueHint::FilePath)]
    file: PathBuf,
    /// Replace the file if it exists
    #[arg(long)]
    overwrite: bool,
}

/// A file with settings.
#[derive(clap::Args, Clone)]
pub struct FileArg {
    /// The file, as `dump` writes it; `-` is stdin
    #[arg(value_name = "FILE", value_hint = clap::ValueHint::FilePath)]
    file: PathBuf,
}

/// What a restore does.
#[derive(clap::Args, Clone)]
pub struct RestoreArgs {
    #[command(flatten)]
    file: FileArg,
    /// Show what would be written, and write nothing
    #[arg(long)]
    dry_run: bool,
    /// Restore also if the motor is not at rest. The new settings may change how it moves
    #[arg(long)]
    running: bool,
}

/// What is done with a file.
#[derive(Clone, Copy)]
pub enum Task<'a> {
    Dump(&'a DumpArgs),
    Diff(&'a FileArg),
    Restore(&'a RestoreArgs),
}

/// A motor with its settings, and where results go.
pub struct Tuned<'a, M: Tunable> {
    pub motor: M,
    pub output: Printer,
    /// The first members of a JSON result.
    pub line: Line,
    /// The failure if settings of a file cannot be read.
    pub unread: &'a dyn Fn(Unread<M::Error>) -> Failure,
    /// Whether the ROM of the motor may be written.
    pub write_rom: bool,
}

impl<M: Tunable<Error: Into<Failure> + Clone + std::fmt::Display>> Tuned<'_, M> {
    pub fn carry_out(self, task: Task<'_>) -> Result<(), Failure> {
        match task {
            Task::Dump(args) => self.dump(args),
            Task::Diff(args) => self.diff(args),
            Task::Restore(args) => self.restore(args),
        }
    }

    /// `dump`: writes the settings as text.
    fn dump(self, args: &DumpArgs) -> Result<(), Failure> {
        let file = outputs::one("FILE", &args.file, &[], ("--overwrite", args.overwrite))?;
        let dump = Dump::reading(self.motor.tuning()).run(&self.motor).map_err(Into::into)?;
        let rows: Vec<Row> = dump.values().map(|(setting, digits)| row(setting, digits)).collect();
        if file == Output::Stdout {
            return self.output.result(dump.text().trim_end(), self.line.values(&rows));
        }
        file.write(|out| out.write_all(dump.text().as_bytes()))?;
        let name = shown(&args.file);
        let text = format!("{} settings of {} are in {name}", rows.len(), self.name());
        self.output.result(text, self.line.ok(true).with("file", name).values(&rows))
    }

    /// `diff`: shows the settings that differ. It is a failure if some do, as of `diff`.
    fn diff(self, args: &FileArg) -> Result<(), Failure> {
        let comparison = self.compare(args)?;
        self.show(&comparison, args)?;
        match comparison.differences().count() {
            0 => Ok(()),
            count => {
                let (motor, file) = (self.name(), shown(&args.file));
                Err(Failure::differs(format!(
                    "{motor} differs from {file} in {}",
                    counted(count as u64, "setting")
                )))
            }
        }
    }

    /// `restore`: shows the settings that differ, writes them and reads them back.
    fn restore(self, args: &RestoreArgs) -> Result<(), Failure> {
        let permissions = Permissions { rom: self.write_rom, running: args.running };
        interruption::begin();
        let comparison = self.compare(&args.file)?;
        self.show(&comparison, &args.file)?;
        let motor = Interruptible::new(&self.motor);
        let failed = |error| self.not_restored(error, &args.file);
        if args.dry_run {
            comparison.checking(permissions).run(&motor).map_err(failed)?;
            if !self.output.json {
                note("nothing was written");
            }
            return Ok(());
        }
        let mixed = format!("interrupted; the roll-back did not end; {}", self.advice(&args.file));
        motor.take_over(pasteable::complete(&mixed, None));
        let restoring = comparison.restoring(permissions, interrupt::interrupted);
        restoring.run(&motor).map_err(failed)?;
        if interrupt::interrupted() {
            note("interrupted too late: all settings are written");
        }
        let differences: Vec<Difference> = comparison.differences().collect();
        let before = differences.iter().map(|one| row(one.setting, one.now)).collect::<Vec<_>>();
        let after = differences.iter().map(|one| row(one.setting, one.file)).collect::<Vec<_>>();
        let mut line = self.line.clone().ok(true);
        if !differences.is_empty() {
            line = line.with_values("before", &before).values(&after);
        }
        let mut done = Vec::new();
        if !differences.is_empty() {
            done.push(format!(
                "{} written and read back",
                counted(differences.len() as u64, "setting")
            ));
        }
        let permanent = comparison.permanent(permissions);
        if !permanent.is_empty() {
            done.push(format!("written to the ROM: {}", permanent.join(", ")));
        }
        if done.is_empty() && !self.output.json {
            return Ok(());
        }
        self.output.result(format!("{}: {}", self.name(), done.join("; ")), line)
    }

    fn compare(&self, args: &FileArg) -> Result<Comparison<Id<M>>, Failure> {
        let name = shown(&args.file);
        let text = read(&args.file).map_err(|error| {
            let failure =
                Failure::usage(format!("cannot read `{name}`: {error}; nothing was sent"));
            match error.kind() {
                ErrorKind::NotFound => {
                    let Kind { protocol, .. } = self.motor.tuning().kind();
                    let file = quoted(&args.file.display().to_string());
                    failure.trying(format!("`motorlink {protocol} dump {file}` writes such a file"))
                }
                _ => failure,
            }
        })?;
        let file = SettingsFile::parse(&text, &self.motor.tuning()).map_err(|error| {
            let failure = Failure::usage(format!("{name}: {error}; nothing was sent"));
            match error.problem {
                Problem::OtherProfile { file, .. } => {
                    failure.trying(format!("add --profile {file} if the drive speaks it"))
                }
                Problem::NotASetting {
                    name,
                    why: NotASetting::Acts | NotASetting::OneMeasurement,
                } => failure.trying(format!("remove the line, and use `motorlink st set {name}`")),
                Problem::NotASetting { .. } => failure.trying("remove the line"),
                _ => failure,
            }
        })?;
        Comparison::reading(self.motor.tuning(), &file).run(&self.motor).map_err(|unread| {
            let names = unread.settings.join(", ");
            let is_refusal = unread.error.is_refusal();
            let count = unread.settings.len();
            let failure = (self.unread)(unread);
            let failure = match names.is_empty() {
                true => failure,
                false => failure.with_fact(format!("{names} of {name} cannot be read")),
            };
            match (is_refusal, count) {
                (false, _) => failure,
                (true, 1) => {
                    failure.trying_also("remove the line if the drive does not have this setting")
                }
                (true, _) => failure
                    .trying_also("remove these lines if the drive does not have these settings"),
            }
        })
    }

    /// Shows the settings that differ: those of the motor, those of the file.
    fn show(&self, comparison: &Comparison<Id<M>>, args: &FileArg) -> Result<(), Failure> {
        let name = shown(&args.file);
        let differences: Vec<Difference> = comparison.differences().collect();
        if self.output.json {
            let line = self.line.clone().with("file", name).with("same", differences.is_empty());
            if differences.is_empty() {
                return self.output.result("", line);
            }
            let now = differences.iter().map(|one| row(one.setting, one.now)).collect::<Vec<_>>();
            let file = differences.iter().map(|one| row(one.setting, one.file)).collect::<Vec<_>>();
            return self.output.result("", line.values(&now).with_values("wanted", &file));
        }
        if differences.is_empty() {
            return self
                .output
                .result(format!("{} has the settings of {name}", self.name()), self.line.clone());
        }
        let rows = differences.iter().map(|one| {
            let Difference { setting, now, file, .. } = one;
            [
                setting.name.clone(),
                setting.number(*now),
                setting.number(*file),
                setting.scale.symbol.to_owned(),
            ]
        });
        let head = ["setting".to_owned(), self.name(), "file".to_owned(), String::new()];
        let rows: Vec<[String; 4]> = std::iter::once(head).chain(rows).collect();
        let width = |column: usize| {
            rows.iter().map(|row| row[column].chars().count()).max().unwrap_or_default()
        };
        let [first, second, third] = [0, 1, 2].map(width);
        for [setting, now, file, unit] in &rows {
            let line = format!("{setting:<first$}  {now:>second$}  {file:>third$}  {unit}");
            self.output.result(line.trim_end(), self.line.clone())?;
        }
        Ok(())
    }

    fn not_restored(&self, error: RestoreError<Ended<M::Error>>, args: &FileArg) -> Failure {
        let text = error.to_string();
        match error {
            RestoreError::Rom { .. } => Failure::usage(text)
                .trying("add --write-rom to allow it, or remove the lines from the file"),
            RestoreError::Running { .. } => {
                let stop = format!("`motorlink {} stop`", self.motor.tuning().kind().protocol);
                Failure::refused(text).trying(format!("stop it first: {stop}; or add --running"))
            }
            RestoreError::Before(Ended::Interrupted) => {
                note(text);
                Failure::Interrupted
            }
            RestoreError::Before(Ended::Exchange(error)) => {
                error.into().then("nothing was written")
            }
            RestoreError::Undone(undone) => self.undone(text, *undone, args),
            _ => Failure::usage(text),
        }
    }

    /// How the settings of a motor are shown that was not restored.
    fn advice(&self, args: &FileArg) -> String {
        let Kind { protocol, .. } = self.motor.tuning().kind();
        let file = quoted(&args.file.display().to_string());
        format!("`motorlink {protocol} diff {file}` shows what differs")
    }

    /// The failure of a restore that ended early, with the state of the motor.
    fn undone(&self, text: String, undone: Undone<Ended<M::Error>>, args: &FileArg) -> Failure {
        let show = self.advice(args);
        let is_complete = undone.is_complete();
        let states = [
            ("rolled_back", &undone.rolled_back),
            ("changed", &undone.changed),
            ("unknown", &undone.unknown),
            ("unknown_in_rom", &undone.unknown_in_rom),
        ];
        let mut line = self.line.clone();
        for (name, settings) in states.into_iter().filter(|(_, settings)| !settings.is_empty()) {
            line = line.with(name, settings.clone());
        }
        let failure = match undone.cause {
            Cause::Interrupted | Cause::Exchange { error: Ended::Interrupted, .. } => {
                note(match is_complete {
                    true => text,
                    false => format!("{text}; {}", pasteable::complete(&show, None)),
                });
                return Failure::Interrupted;
            }
            Cause::Exchange { error: Ended::Exchange(error), .. } => error.into().saying(text),
            Cause::Differs { .. } => Failure::refused(text),
        };
        let failure = if is_complete { failure } else { failure.trying_also(&show) };
        if self.output.json
            && let Err(output) = self.output.result("", line.failed(&failure))
        {
            return failure.and(output);
        }
        failure
    }

    fn name(&self) -> String {
        format!("motor {}", self.motor.tuning().kind().motor)
    }
}

/// Refuses an option that converts values. It is empty if none was given.
pub fn refuse_conversion(option: &str, units: &str) -> Result<(), Failure> {
    if option.is_empty() {
        return Ok(());
    }
    let why = format!("a file has {units}, and {option} converts them; nothing was sent");
    Err(Failure::usage(why).trying(format!("leave out {option}")))
}

/// A value as people and programs read it.
fn row(setting: &Setting, digits: i64) -> Row {
    match setting.scale.symbol {
        "" => Row::plain(&setting.name, digits),
        unit => {
            let scale = setting.scale;
            Row::quantity(&setting.name, scale.value(digits), scale.decimals, unit)
        }
    }
}

fn shown(path: &Path) -> String {
    match path == Path::new(STDIN) {
        true => "the file".to_owned(),
        false => printable(&path.display().to_string()),
    }
}

/// The text of a file; not much more than a file of settings may have, because a device has no end.
fn read(path: &Path) -> std::io::Result<String> {
    let mut text = String::new();
    let most = SettingsFile::MAX_SIZE as u64 + 1;
    let source: Box<dyn Read> = match path == Path::new(STDIN) {
        true => Box::new(std::io::stdin()),
        false => Box::new(File::open(path)?),
    };
    source.take(most).read_to_string(&mut text)?;
    Ok(text)
}
