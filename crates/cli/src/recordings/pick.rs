//! Which signals of a recording are wanted.

use std::fs::File;

use motorlink_recording::read::Recording;
use motorlink_recording::schema::SignalField;

use crate::failure::Failure;
use crate::text::is_like;

/// Signals by their names.
#[derive(clap::Args)]
pub struct Pick {
    /// Signals, separated by commas: `SPEED_MEAS` of all motors, or `st0/motor1/SPEED_MEAS`; `*` is
    /// any text
    #[arg(long, value_name = "SIGNAL,..", value_delimiter = ',')]
    signals: Vec<String>,
}

impl Pick {
    /// Whether signals were named.
    pub fn is_some(&self) -> bool {
        !self.signals.is_empty()
    }

    /// Whether a signal of a topic is wanted.
    pub fn has(&self, topic: &str, field: &SignalField) -> bool {
        !self.is_some() || self.signals.iter().any(|wanted| is_meant(wanted, topic, field))
    }

    /// An error if a name is that of no signal of the recording, whose file has the name `file`.
    pub fn check(&self, recording: &Recording<File>, file: &str) -> Result<(), Failure> {
        let types = recording.types();
        let all: Vec<(&str, &SignalField)> = recording
            .channels()
            .filter_map(|channel| Some((&*channel.topic, types.signals(channel.id)?)))
            .flat_map(|(topic, signals)| signals.fields().iter().map(move |field| (topic, field)))
            .collect();
        if all.is_empty() {
            return Err(Failure::usage(format!("{file} has no signals")));
        }
        for wanted in &self.signals {
            if !all.iter().any(|(topic, field)| is_meant(wanted, topic, field)) {
                let failure = format!("{file} has no signal `{wanted}`");
                return Err(
                    Failure::usage(failure).trying(format!("`motorlink info {file}` lists them"))
                );
            }
        }
        Ok(())
    }
}

/// Whether a name is that of a signal, with or without its motor.
fn is_meant(wanted: &str, topic: &str, field: &SignalField) -> bool {
    let motor = topic.trim_start_matches('/').rsplit_once('/').map_or(topic, |(motor, _)| motor);
    let full = format!("{motor}/{}", field.signal);
    let matches = |name: &str| is_like(&wanted.to_lowercase(), &name.to_lowercase());
    matches(&field.signal) || matches(&full)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_signal_is_meant_by_its_name_with_or_without_its_motor() {
        let field = SignalField {
            field: "speed_meas".to_owned(),
            signal: "SPEED_MEAS".to_owned(),
            unit: "rpm".to_owned(),
            doc: String::new(),
        };
        let is = |wanted| is_meant(wanted, "/st0/motor1/signals", &field);
        for wanted in [
            "SPEED_MEAS",
            "speed_meas",
            "st0/motor1/SPEED_MEAS",
            "*",
            "SPEED*",
            "*motor1*",
            "st0/*",
        ] {
            assert!(is(wanted), "{wanted}");
        }
        for wanted in ["SPEED", "st1/*", "motor1/SPEED_MEAS", "*REF", "", "st0/motor1"] {
            assert!(!is(wanted), "{wanted}");
        }
    }
}
