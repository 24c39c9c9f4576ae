//! Writes the settings of a motor as text.

use std::fmt::Write as _;

use super::file::{BEGIN, END, MOTOR, PROFILE, SETTINGS};
use super::procedure::{Line, Procedure};
use super::{Block, Kind, Setting, StepError, Tuning};

/// The column of comments behind values.
const COMMENTS: usize = 30;
/// As many names as fit a line.
const ABSENT_IN_A_LINE: usize = 6;

/// The settings of a motor.
#[derive(Debug, Clone, PartialEq)]
pub struct Dump {
    kind: Kind,
    identity: Vec<String>,
    /// The values of each block below its heading.
    blocks: Vec<(&'static str, Vec<(Setting, i64)>)>,
    /// Names of settings that the motor refused to read.
    absent: Vec<String>,
}

/// Reads what is known of the drive, in steps: the lines of [`Dump::identity`]. The motor itself must answer,
/// too.
pub fn identify<'a, T, E>(tuning: T) -> Procedure<'a, T::Id, E, Result<Vec<String>, E>>
where
    T: Tuning + Send + Sync + 'a,
    E: StepError + Send + 'a,
{
    Procedure::new(|line| async move {
        line.motion().await?;
        let identity = identity(&tuning, &line).await?;
        line.confirm().await?;
        Ok(identity)
    })
}

/// The name and the value in a line of an identity: `firmware: NAME 1.0` has `firmware`.
pub fn fact(line: &str) -> (&str, &str) {
    line.split_once(": ").unwrap_or((line, ""))
}

async fn identity<T: Tuning, E: StepError>(
    tuning: &T,
    line: &Line<T::Id, E>,
) -> Result<Vec<String>, E> {
    let mut identity = Vec::new();
    for number in 0..tuning.identity() {
        match line.identity(number).await {
            Ok(text) => identity.extend(text),
            // Firmware 5.0 does not know the request for its version.
            Err(error) if error.is_refusal() => {}
            Err(error) => return Err(error),
        }
    }
    Ok(identity)
}

impl Dump {
    /// Reads all settings that a motor has. A setting that the motor refuses to read is left out.
    ///
    /// # Errors
    /// Those of an exchange.
    pub fn reading<'a, T, E>(tuning: T) -> Procedure<'a, T::Id, E, Result<Self, E>>
    where
        T: Tuning + Send + Sync + 'a,
        E: StepError + Send + 'a,
    {
        Procedure::new(|line| async move { Dump::read(&tuning, &line).await })
    }

    async fn read<T: Tuning, E: StepError>(tuning: &T, line: &Line<T::Id, E>) -> Result<Self, E> {
        let identity = identity(tuning, line).await?;
        let mut dump = Dump { kind: tuning.kind(), identity, blocks: vec![], absent: vec![] };
        for Block { id, settings, heading, .. } in tuning.blocks() {
            match line.read(id).await {
                Ok(digits) => {
                    let values = settings.into_iter().zip(digits).collect();
                    dump.blocks.push((heading, values));
                }
                Err(error) if error.is_refusal() => {
                    dump.absent.extend(settings.into_iter().map(|setting| setting.name));
                }
                Err(error) => return Err(error),
            }
        }
        line.confirm().await?;
        Ok(dump)
    }

    /// The settings with their digits.
    pub fn values(&self) -> impl Iterator<Item = (&Setting, i64)> {
        let values = self.blocks.iter().flat_map(|(_, values)| values);
        values.map(|(setting, digits)| (setting, *digits))
    }

    /// What is known of the drive, in lines such as `firmware: ...`.
    pub fn identity(&self) -> &[String] {
        &self.identity
    }

    /// The names of the settings that the motor refused to read.
    pub fn absent(&self) -> &[String] {
        &self.absent
    }

    /// The text of a file. The same settings of the same motor have the same text.
    pub fn text(&self) -> String {
        let mut text = String::new();
        self.write(&mut text).expect("a text takes everything");
        text
    }

    fn write(&self, out: &mut String) -> std::fmt::Result {
        let Kind { protocol, profile, motor } = self.kind;
        writeln!(out, "{BEGIN} `motorlink {protocol} diff` compares a motor with them,")?;
        writeln!(
            out,
            "# `motorlink {protocol} restore` writes them. Settings without a line stay as they are."
        )?;
        for line in &self.identity {
            writeln!(out, "# {line}")?;
        }
        writeln!(out, "\n[{protocol}]")?;
        if let Some(profile) = profile {
            writeln!(out, "{PROFILE} = \"{profile}\"")?;
        }
        commented(
            out,
            &format!("{MOTOR} = {motor}"),
            "remove this line to use the file for any motor",
        )?;
        writeln!(out, "\n[{protocol}.{SETTINGS}]")?;
        let mut last = "";
        for (heading, values) in &self.blocks {
            if last != *heading {
                writeln!(out, "{}# {heading}", if last.is_empty() { "" } else { "\n" })?;
            }
            last = heading;
            for (setting, digits) in values {
                let parts = [setting.scale.symbol, setting.doc];
                let parts: Vec<&str> = parts.into_iter().filter(|part| !part.is_empty()).collect();
                let value = format!("{} = {}", setting.name, setting.number(*digits));
                commented(out, &value, &parts.join("; "))?;
            }
        }
        if !self.absent.is_empty() {
            writeln!(out, "\n# The drive refuses to read:")?;
        }
        for names in self.absent.chunks(ABSENT_IN_A_LINE) {
            writeln!(out, "# {}", names.join(" "))?;
        }
        writeln!(
            out,
            "\n{END}{} settings; correct the number if you remove some",
            self.values().count()
        )
    }
}

/// A line with a comment, unless that is empty.
fn commented(out: &mut String, line: &str, comment: &str) -> std::fmt::Result {
    match comment {
        "" => writeln!(out, "{line}"),
        comment => writeln!(out, "{line:COMMENTS$}  # {comment}"),
    }
}
