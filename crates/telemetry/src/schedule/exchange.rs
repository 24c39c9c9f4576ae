//! Exchanges: what they are, and how they end.

use motorlink_proto::time::Instant;

/// What has one exchange at a time: a serial line, or a motor on a CAN bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Lane(pub u8);

/// A poll: one exchange that is repeated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PollId(pub u32);

/// A command or a stop.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct CommandId(pub u64);

/// An exchange that a stop replaced.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Displaced {
    /// A poll.
    Poll(PollId),
    /// A command. The drive may have executed it.
    Command(CommandId),
    /// A command that was not sent.
    Unsent(CommandId),
    /// A recovery of the lane.
    Recovery,
    /// A stop, which is repeated later. It was sent ahead of the recovery of the lane.
    Stop,
}

/// How an exchange ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// With a reply.
    Answered,
    /// With a refusal of the drive, or with one of the client before anything was sent.
    Refused,
    /// Without a reply that could be read.
    Failed,
    /// As failed, at a port that another program holds: it has repeated a stop itself.
    GivenUp,
    /// The line was closed.
    Closed,
}

/// What an exchange was that is over.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Verdict {
    /// A poll.
    Poll(PollId),
    /// A command.
    Command(CommandId),
    /// A recovery of the lane. The command that it was for waits again, or is over.
    Recovered,
    /// A stop that the drive confirmed, for these who asked for it.
    Stopped(Vec<CommandId>),
    /// A stop that is repeated.
    StopAgain,
    /// A stop that is not repeated for these who asked for it. The motor may still be turning.
    StopFailed(Vec<CommandId>),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ExchangeKind {
    Stop,
    Command(CommandId),
    Poll(PollId),
    /// The lane is brought in sync for a command that waits.
    Recovery(CommandId),
}

/// The exchange of a lane.
#[derive(Debug, Clone, Copy)]
pub(super) struct UnderWay {
    pub(super) kind: ExchangeKind,
    pub(super) since: Instant,
    /// Whether the line was in sync when it began. Else its duration is not that of the exchange alone.
    pub(super) in_sync: bool,
    /// Whether a stop replaces it: the lane is brought in sync, and its request was not sent. A stop was
    /// sent ahead.
    pub(super) is_unsent: bool,
}

impl UnderWay {
    pub(super) fn displaced(self) -> Displaced {
        match self.kind {
            ExchangeKind::Poll(poll) => Displaced::Poll(poll),
            ExchangeKind::Command(id) if self.is_unsent => Displaced::Unsent(id),
            ExchangeKind::Command(id) => Displaced::Command(id),
            ExchangeKind::Recovery(_) => Displaced::Recovery,
            ExchangeKind::Stop => Displaced::Stop,
        }
    }
}
