//! How a master behaves.

use super::question;
use crate::st::Profile;
use crate::time::Micros;

/// How long a master waits for a reply (4.1).
pub const TIMEOUT: Micros = Micros::from_millis(1_000);

/// How a lost line comes back (SPEC-NOTES S16).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Recovery {
    /// Not by itself: the line counts as in step until it is lost, and
    /// [`Master::trust_line`](super::Master::trust_line) says that it is so again.
    None,
    /// Before the next request: wait until the line is silent, ask a question whose reply cannot be
    /// taken for that of the lost request, and go on when it was answered and the line is silent
    /// again. Replies that come late, in their order and by up to twice the timeout, are dropped.
    #[default]
    Drain,
    /// As `Drain`, behind bytes that complete a frame which a 5.x drive may still be waiting for.
    /// Where the lost request was more than a question, the padding may have completed it, so the
    /// question follows a STOP_MOTOR.
    Pad,
}

impl Recovery {
    /// Every way.
    pub const ALL: [Recovery; 3] = [Recovery::None, Recovery::Drain, Recovery::Pad];
}

/// How a [`Master`](super::Master) behaves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MasterConfig {
    /// How long to wait for a reply.
    pub timeout: Micros,
    /// How a lost line comes back.
    pub recovery: Recovery,
    /// The silence after which nothing more is expected to come.
    pub quiet: Micros,
    /// What the drive is expected to speak.
    pub profile: Profile,
}

impl MasterConfig {
    /// For a port that takes bytes faster than a line of `baud` carries them, with 10 bits a byte:
    /// silence begins when the longest thing that recovery sends is out of it.
    pub const fn at_baud(self, baud: u32) -> Self {
        let bits = question::PADDING.len() as u64 * 10;
        let sent = bits * 1_000_000 / if baud == 0 { 1 } else { baud as u64 };
        MasterConfig { quiet: Micros(self.quiet.0.saturating_add(sent)), ..self }
    }

    /// The longest that an exchange can take, however the line behaves, beside the time in which the
    /// port takes what is sent: the reply's timeout on a line that is up. On a lost line there come
    /// before it silence, as long as may be waited for it, before and behind the questions, and the
    /// questions' timeouts, of which all but the last are answered at once; with
    /// `Pad` one silence more.
    pub const fn longest_exchange(&self) -> Micros {
        let (timeout, quiet) = (self.timeout.0, self.quiet.0);
        let silence = quiet.saturating_add(timeout);
        // Where the answer may be that to something else, nothing is sent for twice the timeout.
        let (prompt, answered) = match quiet > timeout {
            true => (timeout, silence),
            false => (quiet, timeout.saturating_mul(2)),
        };
        let asked = prompt.saturating_mul(2).saturating_add(timeout);
        let drained = silence.saturating_add(asked).saturating_add(answered);
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
