//! Compares the settings of a motor with those of a file.

use super::procedure::{Line, Procedure};
use super::{Setting, SettingsFile, StepError, Tuning, Writing, list};

/// The settings of a motor that a file has, too.
#[derive(Debug, Clone, PartialEq)]
pub struct Comparison<Id> {
    pub(super) blocks: Vec<Compared<Id>>,
}

/// A block with values of the file.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Compared<Id> {
    pub(super) id: Id,
    pub(super) settings: Vec<Setting>,
    pub(super) writing: Writing,
    /// The digits of the motor.
    pub(super) now: Vec<i64>,
    /// The digits of the file; those of the motor where the file has none.
    pub(super) file: Vec<i64>,
    /// The digits that the motor reads back after those of the file were written.
    pub(super) expected: Vec<i64>,
}

/// A setting that differs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Difference<'a> {
    /// The setting.
    pub setting: &'a Setting,
    /// The digits of the motor.
    pub now: i64,
    /// The digits of the file.
    pub file: i64,
    /// How it is written.
    pub writing: Writing,
}

/// A motor whose settings could not be read.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{} cannot be read: {error}", named(.settings))]
pub struct Unread<E> {
    /// The names of the settings; empty if it is about all of them.
    pub settings: Vec<String>,
    /// The error of the first exchange that failed.
    pub error: E,
}

fn named(settings: &[String]) -> String {
    match settings {
        [] => "the settings of the motor".to_owned(),
        some => format!("{} of the file", list(some)),
    }
}

impl<Id: Copy + PartialEq + Send + Sync> Comparison<Id> {
    /// Reads the settings that the file has.
    ///
    /// # Errors
    /// Those of an exchange. The motor does not have settings of the file: the error has all of them.
    pub fn reading<'a, T, E>(
        tuning: T,
        file: &SettingsFile,
    ) -> Procedure<'a, Id, E, Result<Self, Unread<E>>>
    where
        T: Tuning<Id = Id> + Send + Sync + 'a,
        Id: 'a,
        E: StepError + Send + 'a,
    {
        let file = file.clone();
        Procedure::new(|line| async move { Self::ask(&tuning, &line, &file).await })
    }

    async fn ask<T: Tuning<Id = Id>, E: StepError>(
        tuning: &T,
        line: &Line<Id, E>,
        file: &SettingsFile,
    ) -> Result<Self, Unread<E>> {
        let mut blocks = Vec::new();
        let mut refused: Option<Unread<E>> = None;
        for block in tuning.blocks() {
            let wanted = block.settings.iter().map(|setting| file.digits(setting));
            let wanted: Vec<Option<i64>> = wanted.collect();
            if wanted.iter().all(Option::is_none) {
                continue;
            }
            let named = block.settings.iter().zip(&wanted).filter(|(_, file)| file.is_some());
            let names = named.map(|(setting, _)| setting.name.clone());
            let now = match line.read(block.id).await {
                Ok(now) => now,
                // The other settings are read as well, so that one error has all names.
                Err(error) if error.is_refusal() => {
                    let refused = refused.get_or_insert(Unread { settings: Vec::new(), error });
                    refused.settings.extend(names);
                    continue;
                }
                Err(error) => return Err(Unread { settings: names.collect(), error }),
            };
            let file: Vec<i64> =
                wanted.iter().zip(&now).map(|(file, now)| file.unwrap_or(*now)).collect();
            let expected = tuning.expected(block.id, file.clone());
            let (id, settings, writing) = (block.id, block.settings, block.writing);
            blocks.push(Compared { id, settings, writing, now, file, expected });
        }
        let confirmed = line.confirm().await;
        confirmed.map_err(|error| Unread { settings: Vec::new(), error })?;
        match refused {
            Some(unread) => Err(unread),
            None => Ok(Comparison { blocks }),
        }
    }

    /// The settings that differ, in the order of the file.
    pub fn differences(&self) -> impl Iterator<Item = Difference<'_>> {
        self.blocks.iter().flat_map(Compared::differences)
    }
}

impl<Id> Compared<Id> {
    pub(super) fn differences(&self) -> impl Iterator<Item = Difference<'_>> {
        let values = self.settings.iter().zip(self.now.iter().zip(&self.expected));
        let writing = self.writing;
        let all =
            values.map(move |(setting, (&now, &file))| Difference { setting, now, file, writing });
        all.filter(|difference| difference.now != difference.file)
    }

    pub(super) fn differs(&self) -> bool {
        self.now != self.expected
    }

    /// The names of its settings that differ.
    pub(super) fn names(&self) -> Vec<String> {
        self.differences().map(|difference| difference.setting.name.clone()).collect()
    }
}
