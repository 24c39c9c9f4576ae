//! Configuration of a master.

use super::question;
use crate::st::Profile;
use crate::time::Micros;

/// Default timeout of a reply (4.1).
pub const TIMEOUT: Micros = Micros::from_millis(1_000);

/// How the master recovers a lost line (SPEC-NOTES S16).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Recovery {
    /// Before the next request: wait for silence, then send a question whose reply cannot be
    /// confused with the reply to the lost request. Continue after the answer and another silence.
    /// Late replies are dropped if they come in order and at most twice the timeout late.
    #[default]
    Drain,
    /// Like `Drain`, but first send padding that completes a frame which a 5.x drive may still be
    /// waiting for. If the lost request was not a read, the padding may have completed it, so a
    /// STOP_MOTOR is sent before the question.
    Pad,
    /// No recovery: the line counts as in sync until it is lost.
    /// [`Master::trust_line`](super::Master::trust_line) declares it in sync again.
    None,
}

impl Recovery {
    /// All modes.
    pub const ALL: [Recovery; 3] = [Recovery::Drain, Recovery::Pad, Recovery::None];
}

/// Configuration of a [`Master`](super::Master).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MasterConfig {
    /// Timeout of a reply.
    pub timeout: Micros,
    /// How the master recovers a lost line.
    pub recovery: Recovery,
    /// Silence of this length means that no more bytes are expected.
    pub quiet: Micros,
    /// The profile that the drive is expected to follow.
    pub profile: Profile,
}

impl MasterConfig {
    /// For a port that accepts bytes faster than a line of `baud` transmits them, with 10 bits per
    /// byte: the silence starts after the longest message of the recovery has been transmitted.
    pub const fn at_baud(self, baud: u32) -> Self {
        let bits = question::PADDING.len() as u64 * 10;
        let sent = bits * 1_000_000 / if baud == 0 { 1 } else { baud as u64 };
        MasterConfig { quiet: Micros(self.quiet.0.saturating_add(sent)), ..self }
    }

    /// Worst-case duration of an exchange, excluding the time in which the port accepts the sent
    /// bytes. On a line in sync this is the timeout of the reply. On a lost line the recovery comes
    /// before it: the wait for silence before and after the questions, at its maximum, and the
    /// timeouts of the questions, of which all but the last are answered at once. `Pad` adds one
    /// more silence.
    pub const fn longest_exchange(&self) -> Micros {
        let (timeout, quiet) = (self.timeout.0, self.quiet.0);
        let silence = quiet.saturating_add(timeout);
        // If the answer may belong to another request, nothing is sent for twice the timeout.
        let (prompt, answered) = match quiet > timeout {
            true => (timeout, silence),
            false => (quiet, timeout.saturating_mul(2)),
        };
        let questions = prompt.saturating_mul(2).saturating_add(timeout);
        let drained = silence.saturating_add(questions).saturating_add(answered);
        let recovered = match self.recovery {
            Recovery::None => 0,
            Recovery::Drain => drained,
            Recovery::Pad => drained.saturating_add(silence),
        };
        Micros(recovered.saturating_add(timeout))
    }
}

impl Default for MasterConfig {
    /// The document's 1 s, `Drain`, 50 ms of silence, profile `spec`.
    fn default() -> Self {
        MasterConfig {
            timeout: TIMEOUT,
            recovery: Recovery::default(),
            quiet: Micros::from_millis(50),
            profile: Profile::default(),
        }
    }
}
