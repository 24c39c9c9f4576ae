//! Writes the settings of a file to a motor. If a write fails, it writes the old values again.

use std::fmt;

use motorlink_proto::st::VERIFY_ATTEMPTS;

use super::compare::Compared;
use super::procedure::{Line, Procedure};
use super::{Comparison, StepError, Writing, list};

/// What a restore may do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Permissions {
    /// Write to the ROM of the motor, which wears it.
    pub rom: bool,
    /// Change a motor that is not at rest.
    pub running: bool,
}

/// Why the settings of a file were not restored.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RestoreError<E> {
    /// A value that cannot be written differs. Nothing was written.
    #[error(
        "{name} is {file} in the file and {now} in the motor, and cannot be written: the settings are \
         those of another kind of drive; nothing was written"
    )]
    Fixed {
        /// The name of the setting.
        name: String,
        /// Its value in the file.
        file: String,
        /// The value of the motor.
        now: String,
    },
    /// A write to the ROM is not allowed. Nothing was written.
    #[error(
        "{} is in the ROM of the motor, and each write wears the ROM; nothing was written",
        list(.settings)
    )]
    Rom {
        /// The names of the settings.
        settings: Vec<String>,
    },
    /// The motor is not at rest. Nothing was written.
    #[error("the motor {motion}, and new settings could change how it moves; nothing was written")]
    Running {
        /// What the motor does.
        motion: String,
    },
    /// An exchange before the first write failed, or a limit forbids a value. Nothing was written.
    #[error("{0}; nothing was written")]
    Before(E),
    /// A write failed, or the restore was interrupted.
    #[error(transparent)]
    Undone(Box<Undone<E>>),
}

/// A restore that ended early, and the settings after it.
#[derive(Debug, Clone, PartialEq)]
pub struct Undone<E> {
    /// Why it ended.
    pub cause: Cause<E>,
    /// Settings that were written and have their old values again.
    pub rolled_back: Vec<String>,
    /// Settings that have the values of the file.
    pub changed: Vec<String>,
    /// Settings that have an unknown value: the old or the new one, unless the motor takes neither.
    pub unknown: Vec<String>,
    /// Settings whose values in ROM are unknown.
    pub unknown_in_rom: Vec<String>,
    /// Why the roll-back failed.
    pub rollback_error: Option<E>,
}

/// Why a restore ended early.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Cause<E> {
    /// An exchange failed.
    #[error("{} could not be restored: {error}", list(.settings))]
    Exchange {
        /// The names of the settings.
        settings: Vec<String>,
        /// The error.
        error: E,
    },
    /// The motor acknowledged a write and has other values.
    #[error("the motor did not take {}", .settings.join(", "))]
    Differs {
        /// Each setting with its values.
        settings: Vec<String>,
    },
    /// The caller ended it.
    #[error("interrupted")]
    Interrupted,
}

/// Why a block does not have its values.
enum Failed<E> {
    /// It was refused.
    Refused(E),
    /// An exchange failed.
    Exchange(E),
    /// It has other digits.
    Differs(Vec<i64>),
}

impl<Id: Copy + PartialEq + Send + Sync> Comparison<Id> {
    /// Writes the settings that differ, and reads each back. It is over when the motor has all of them. With
    /// [`Permissions::rom`] gains are made permanent at the end, also if they did not differ: the values in
    /// ROM cannot be read. `is_interrupted` is asked before each write, and after the last read-back. It
    /// ends the restore, and the old values are written again.
    ///
    /// # Errors
    /// Nothing was written, or the old values were written again, as far as the line allowed.
    pub fn restoring<'a, E: StepError + Send + 'a>(
        &self,
        permissions: Permissions,
        is_interrupted: impl FnMut() -> bool + Send + 'a,
    ) -> Procedure<'a, Id, E, Result<(), RestoreError<E>>>
    where
        Id: 'a,
    {
        let comparison = self.clone();
        Procedure::new(|line| async move {
            comparison.checked(&line, permissions).await?;
            let restoring = Restoring { line: &line, written: Vec::new() };
            restoring.all(&comparison, permissions, is_interrupted).await
        })
    }

    /// The names of the settings that [`restoring`](Self::restoring) makes permanent by a request of its own,
    /// also if they do not differ.
    pub fn permanent(&self, permissions: Permissions) -> Vec<&str> {
        let settings = self.to_keep(permissions).flat_map(|block| &block.settings);
        settings.map(|setting| setting.name.as_str()).collect()
    }

    /// The blocks that are made permanent by a request of their own.
    fn to_keep(&self, permissions: Permissions) -> impl Iterator<Item = &Compared<Id>> {
        let is_kept =
            move |block: &&Compared<Id>| block.writing == Writing::Kept && permissions.rom;
        self.blocks.iter().filter(is_kept)
    }

    /// Checks whether [`restoring`](Self::restoring) would be refused before its first write. Writes nothing.
    ///
    /// # Errors
    /// Those of `restoring`, except [`RestoreError::Undone`].
    pub fn checking<'a, E: Send + 'a>(
        &self,
        permissions: Permissions,
    ) -> Procedure<'a, Id, E, Result<(), RestoreError<E>>>
    where
        Id: 'a,
    {
        let comparison = self.clone();
        Procedure::new(|line| async move { comparison.checked(&line, permissions).await })
    }

    async fn checked<E>(
        &self,
        line: &Line<Id, E>,
        permissions: Permissions,
    ) -> Result<(), RestoreError<E>> {
        let differing = || self.blocks.iter().filter(|block| block.differs());
        let fixed = self.differences().find(|difference| difference.writing == Writing::Fixed);
        if let Some(difference) = fixed {
            let [file, now] =
                [difference.file, difference.now].map(|digits| difference.setting.shown(digits));
            let name = difference.setting.name.clone();
            return Err(RestoreError::Fixed { name, file, now });
        }
        let permanent = differing().filter(|block| block.writing == Writing::Permanent);
        let settings: Vec<String> = permanent.flat_map(Compared::names).collect();
        if !permissions.rom && !settings.is_empty() {
            return Err(RestoreError::Rom { settings });
        }
        for block in differing() {
            let checked = line.check(block.id, block.file.clone()).await;
            checked.map_err(RestoreError::Before)?;
        }
        let is_idle = differing().next().is_none() && self.to_keep(permissions).next().is_none();
        if permissions.running || is_idle {
            return Ok(());
        }
        let motion = line.motion().await.map_err(RestoreError::Before)?;
        line.confirm().await.map_err(RestoreError::Before)?;
        match motion {
            Some(motion) => Err(RestoreError::Running { motion }),
            None => Ok(()),
        }
    }
}

/// A restore in progress.
struct Restoring<'a, Id, E> {
    line: &'a Line<Id, E>,
    /// Blocks that do not have their old values, in the order of the writes.
    written: Vec<&'a Compared<Id>>,
}

impl<'a, Id: Copy + PartialEq + Send + Sync, E: StepError> Restoring<'a, Id, E> {
    async fn all(
        mut self,
        comparison: &'a Comparison<Id>,
        permissions: Permissions,
        mut is_interrupted: impl FnMut() -> bool,
    ) -> Result<(), RestoreError<E>> {
        for block in comparison.blocks.iter().filter(|block| block.differs()) {
            if is_interrupted() {
                return Err(self.undo(Cause::Interrupted).await.into());
            }
            if let Err(cause) = self.write(block).await {
                return Err(self.undo(cause).await.into());
            }
        }
        // Another program may write at the same time. A single block was read back just now.
        if self.written.len() > 1
            && let Err(cause) = self.check_all().await
        {
            return Err(self.undo(cause).await.into());
        }
        if !self.written.is_empty() && is_interrupted() {
            return Err(self.undo(Cause::Interrupted).await.into());
        }
        for block in comparison.to_keep(permissions) {
            if is_interrupted() {
                return Err(self.undo(Cause::Interrupted).await.into());
            }
            if let Err(cause) = self.keep(block).await {
                let mut undone = self.undo(cause).await;
                let names = block.settings.iter().map(|setting| setting.name.clone());
                undone.unknown_in_rom = names.collect();
                return Err(undone.into());
            }
        }
        Ok(())
    }

    async fn write(&mut self, block: &'a Compared<Id>) -> Result<(), Cause<E>> {
        self.written.push(block);
        let set = self.set(block, &block.file, &block.expected).await;
        if matches!(set, Err(Failed::Refused(_))) && self.is_as_before(block).await {
            self.written.pop();
        }
        set.map_err(|failed| match failed {
            Failed::Refused(error) | Failed::Exchange(error) => {
                Cause::Exchange { settings: block.names(), error }
            }
            Failed::Differs(read) => not_taken(block, &read),
        })
    }

    /// Checks that all written blocks have their new values.
    async fn check_all(&self) -> Result<(), Cause<E>> {
        let mut attempt = 1;
        loop {
            match self.read_all().await {
                Ok(read) => {
                    let all = self.written.iter().zip(&read);
                    let mut others = all.filter(|(block, read)| block.expected != **read);
                    let other = others.next();
                    return other.map_or(Ok(()), |(block, read)| Err(not_taken(block, read)));
                }
                Err(error) if error.is_line_failure() && attempt < VERIFY_ATTEMPTS => attempt += 1,
                Err(error) => {
                    let settings = self.written.iter().flat_map(|block| block.names()).collect();
                    return Err(Cause::Exchange { settings, error });
                }
            }
        }
    }

    /// The digits of the written blocks.
    async fn read_all(&self) -> Result<Vec<Vec<i64>>, E> {
        let mut all = Vec::new();
        for block in &self.written {
            all.push(self.line.read(block.id).await?);
        }
        self.line.confirm().await?;
        Ok(all)
    }

    /// Makes a block permanent.
    async fn keep(&self, block: &Compared<Id>) -> Result<(), Cause<E>> {
        let mut kept = self.line.keep(block.id, block.file.clone()).await;
        for _ in 1..VERIFY_ATTEMPTS {
            if kept.as_ref().is_err_and(E::is_line_failure) {
                kept = self.line.keep(block.id, block.file.clone()).await;
            }
        }
        let names = block.settings.iter().map(|setting| setting.name.clone()).collect();
        kept.map_err(|error| Cause::Exchange { settings: names, error })
    }

    /// Writes a block until it reads back as `expected`. A ROM is not written again if the motor has
    /// acknowledged the write and has another value.
    async fn set(
        &self,
        block: &Compared<Id>,
        digits: &[i64],
        expected: &[i64],
    ) -> Result<(), Failed<E>> {
        let id = block.id;
        let mut is_acknowledged = false;
        // Whether the block was read back, and the reply may be one to an older request.
        let mut is_doubtful = false;
        for attempt in 1.. {
            if !is_doubtful {
                let written = self.line.write(id, digits.to_vec()).await;
                is_acknowledged = written.is_ok();
                match written {
                    Err(error) if error.is_refusal() && attempt == 1 => {
                        return Err(Failed::Refused(error));
                    }
                    Err(error) if !error.is_line_failure() => return Err(Failed::Exchange(error)),
                    // A write without an acknowledge may have been carried out.
                    _ => {}
                }
            }
            is_doubtful = false;
            let (failed, is_final) = match self.line.read(id).await {
                Ok(read) if read == expected => match self.line.confirm().await {
                    Ok(()) => return Ok(()),
                    Err(error) => {
                        is_doubtful = true;
                        let is_final = !error.is_line_failure();
                        (Failed::Exchange(error), is_final)
                    }
                },
                Ok(read) => {
                    let is_final = is_acknowledged && block.writing == Writing::Permanent;
                    (Failed::Differs(read), is_final)
                }
                Err(error) => {
                    let is_final = !error.is_line_failure();
                    (Failed::Exchange(error), is_final)
                }
            };
            if is_final || attempt >= VERIFY_ATTEMPTS {
                return Err(failed);
            }
        }
        Ok(())
    }

    /// Whether a block has its old values. A motor may refuse a write and have carried it out.
    async fn is_as_before(&self, block: &Compared<Id>) -> bool {
        matches!(self.line.read(block.id).await, Ok(read) if read == block.now)
            && self.line.confirm().await.is_ok()
    }

    /// Writes the old values again, in the reverse order.
    async fn undo(self, cause: Cause<E>) -> Undone<E> {
        let mut undone = Undone {
            cause,
            rolled_back: Vec::new(),
            changed: Vec::new(),
            unknown: Vec::new(),
            unknown_in_rom: Vec::new(),
            rollback_error: None,
        };
        let mut is_lost = false;
        for block in self.written.iter().rev() {
            if is_lost {
                // It was read back and confirmed.
                undone.changed.splice(0..0, block.names());
                continue;
            }
            let error = match self.set(block, &block.now, &block.now).await {
                Ok(()) => {
                    undone.rolled_back.splice(0..0, block.names());
                    continue;
                }
                Err(Failed::Differs(_)) => None,
                Err(Failed::Refused(error) | Failed::Exchange(error)) => Some(error),
            };
            let ends = |error: &E| error.is_line_failure() || error.is_interruption();
            is_lost = error.as_ref().is_some_and(ends);
            undone.unknown.splice(0..0, block.names());
            undone.rollback_error = undone.rollback_error.or(error);
        }
        undone
    }
}

/// Why a restore ends whose block has other digits than those of the file.
fn not_taken<Id, E>(block: &Compared<Id>, read: &[i64]) -> Cause<E> {
    let values = block.settings.iter().zip(block.expected.iter().zip(read));
    let values = values.filter(|(_, (expected, read))| expected != read);
    let settings = values.map(|(setting, (expected, read))| {
        let (name, read) = (&setting.name, setting.shown(*read));
        format!("{name} {} (it has {read})", setting.shown(*expected))
    });
    Cause::Differs { settings: settings.collect() }
}

impl<E> From<Undone<E>> for RestoreError<E> {
    fn from(undone: Undone<E>) -> Self {
        RestoreError::Undone(Box::new(undone))
    }
}

impl<E> Undone<E> {
    /// Whether every setting has its old value.
    pub fn is_complete(&self) -> bool {
        self.changed.is_empty() && self.unknown.is_empty() && self.unknown_in_rom.is_empty()
    }
}

impl<E: fmt::Display> fmt::Display for Undone<E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}; ", self.cause)?;
        if self.is_complete() && self.rolled_back.is_empty() {
            return f.write_str("nothing was changed");
        }
        if !self.rolled_back.is_empty() {
            write!(f, "rolled back to the old values: {}", list(&self.rolled_back))?;
        }
        if self.is_complete() {
            return Ok(());
        }
        let parts = [
            (&self.unknown, "unknown, old or new"),
            (&self.changed, "as in the file"),
            (&self.unknown_in_rom, "unknown in ROM"),
        ];
        let mut separator = if self.rolled_back.is_empty() { "" } else { "; " };
        for (names, state) in parts.into_iter().filter(|(names, _)| !names.is_empty()) {
            write!(f, "{separator}{state}: {}", list(names))?;
            separator = "; ";
        }
        f.write_str("; all others are as before")?;
        match &self.rollback_error {
            Some(error) => write!(f, " (the roll-back failed: {error})"),
            None => Ok(()),
        }
    }
}

impl<E: fmt::Debug + fmt::Display> std::error::Error for Undone<E> {}
