//! What pages ask of drives: registers, commands, motion, limits and settings.
//!
//! - `description` says what the drives of a line have. `commands` is its part that is also used to carry
//!   out requests.
//! - `limits` has what all pages may ask of a motor at most.

mod command_execution;
mod commands;
mod description;
mod limits;
mod motion_control;
mod motor_scan;
mod register_write;
mod setpoint_ramp;
mod settings;

use std::collections::BTreeMap;
use std::sync::Arc;

use motorlink_telemetry::share::client::{Program, Refusal};
use motorlink_telemetry::share::drive_protocol::DriveProtocol;
use motorlink_telemetry::share::message::{Line, MotorName};
use motorlink_telemetry::share::motor_exchange::{Exchanges, Target};
use motorlink_telemetry::share::{drive_settings, drive_values};

use crate::message::{Answer, Ask, Limit, Mode};
use motion_control::Control;

pub use motion_control::MotionPermit;

/// Carries out the requests of pages about drives. Copies are the same drives.
#[derive(Clone)]
pub struct Drives {
    lines: Arc<BTreeMap<String, DriveProtocol>>,
    control: Arc<Control>,
}

impl Drives {
    /// The names of the lines, and what their drives speak.
    pub fn lines(&self) -> Vec<(String, DriveProtocol)> {
        self.lines.iter().map(|(name, speaks)| (name.clone(), *speaks)).collect()
    }

    /// Whether there is a line of this name.
    pub fn has(&self, line: &str) -> bool {
        self.lines.contains_key(line)
    }

    /// The drives of these lines.
    pub fn new(lines: Vec<Line>) -> Self {
        let lines =
            lines.iter().filter_map(|line| Some((line.line.clone(), DriveProtocol::of(line)?)));
        Drives { lines: Arc::new(lines.collect()), control: Arc::default() }
    }

    /// The same drives with other lines. The limits of lines that stay are kept.
    pub fn with_lines(&self, lines: Vec<Line>) -> Self {
        Drives { control: Arc::clone(&self.control), ..Self::new(lines) }
    }

    /// Carries out a request. `view` is used for what moves nothing. `drive` is asked for a session when a
    /// command may move a motor.
    ///
    /// # Errors
    /// The request is not possible, or the share or a drive refuses it.
    pub async fn answer(
        &self,
        ask: Ask,
        view: &Program,
        drive: &impl MotionPermit,
    ) -> Result<Answer, Refusal> {
        match ask {
            Ask::StopAll
            | Ask::LetGo
            | Ask::Record { .. }
            | Ask::EndRecording
            | Ask::Recordings
            | Ask::Recording { .. } => {
                Err(Refusal::usage("the server carries this out without drives"))
            }
            Ask::Motors { line } => {
                let speaks = self.speaks(&line)?;
                Ok(Answer::Motors { motors: motor_scan::motors(view, &line, speaks).await? })
            }
            Ask::Describe { line } => {
                let description = description::describe(&line, self.speaks(&line)?);
                Ok(Answer::Describe(Box::new(description)))
            }
            Ask::Read { motor, names } => {
                let target = self.target(motor)?;
                let values = drive_values::read(&Exchanges::new(view, &target), &names).await?;
                Ok(Answer::Read { values })
            }
            Ask::Act { motor, command, values, hold, to_rom } => {
                let target = self.target(motor)?;
                let command = commands::Command::named(&target, &command)?;
                let request = command_execution::Act { target, command, values, hold, to_rom };
                Ok(Answer::Act { values: request.carry_out(&self.control, view, drive).await? })
            }
            Ask::Limit { motor, mode, most } => {
                let target = self.target(motor)?;
                self.control.limited(&target, |limited| limited.set(target.motor, mode, most))?;
                Ok(Answer::Limit)
            }
            Ask::Limits => Ok(Answer::Limits { limits: self.limits()? }),
            Ask::Write { motor, name, value, to_rom } => {
                let target = self.target(motor)?;
                let write = register_write::Write { target, name, value, to_rom };
                Ok(Answer::Write { values: write.carry_out(&self.control, view, drive).await? })
            }
            Ask::Dump { motor } => {
                let target = self.target(motor)?;
                let dump = drive_settings::dump(&Exchanges::new(view, &target)).await?;
                Ok(settings::as_file(&target.name, &dump))
            }
            Ask::Diff { motor, text } => {
                let target = self.target(motor)?;
                settings::diff(&self.control, &Exchanges::new(view, &target), &text).await
            }
            Ask::Restore { motor, text, to_rom } => {
                settings::restore(&self.control, view, self.target(motor)?, text, to_rom).await
            }
            Ask::Run { motor, mode, target: to, rate, hold } => {
                let run = setpoint_ramp::Run { target: self.target(motor)?, mode, to, rate, hold };
                run.carry_out(&self.control, drive).await
            }
        }
    }

    fn limits(&self) -> Result<Vec<Limit>, Refusal> {
        let mut limits = Vec::new();
        for motor in self.control.motors() {
            let target = self.target(motor)?;
            for mode in [Mode::Speed, Mode::Torque, Mode::Position] {
                let most = self.control.limited(&target, |it| it.most(target.motor, mode));
                limits.extend(most.map(|most| Limit { motor: target.name.clone(), mode, most }));
            }
        }
        Ok(limits)
    }

    /// The share was lost and is there again. The limits stay. A start under a limit needs a new ramp: the
    /// drives may have been switched off.
    pub fn reconnected(&self) {
        self.control.forget();
    }

    fn speaks(&self, line: &str) -> Result<DriveProtocol, Refusal> {
        self.lines.get(line).copied().ok_or_else(|| {
            let names: Vec<&str> = self.lines.keys().map(String::as_str).collect();
            Refusal::usage(format!("no line `{line}`; the lines are {}", names.join(", ")))
        })
    }

    fn target(&self, name: MotorName) -> Result<Target, Refusal> {
        let speaks = self.speaks(&name.line)?;
        Target::new(&name.line, name.motor, speaks)
    }
}
