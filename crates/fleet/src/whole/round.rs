//! A request to several nodes, and its one answer.

use std::collections::{BTreeMap, BTreeSet};

use motorlink_telemetry::share::client_codec::Refusal;
use motorlink_telemetry::share::message::{Answer, Reason};

use super::member::Member;
use super::names;
use crate::key::Name;

/// What all nodes are asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum RoundKind {
    Lines,
    Rates,
    Stop,
    Latch,
    Release,
    /// A part of this subscription of the program.
    Subscribe(u32),
}

#[derive(Debug)]
pub(super) struct Round {
    /// That of the program's request.
    pub(super) id: u32,
    pub(super) kind: RoundKind,
    /// The nodes that have not answered.
    pub(super) waits: BTreeSet<Name>,
    pub(super) done: BTreeMap<Name, Result<Answer, Refusal>>,
}

impl Round {
    /// The answer to the program.
    pub(super) fn answer(&self, members: &BTreeMap<Name, Member>) -> Result<Answer, Refusal> {
        let good =
            self.done.iter().filter_map(|(node, result)| Some((node, result.as_ref().ok()?)));
        let all = good.map(|(node, answer)| names::answer(node, answer.clone()));
        Ok(match self.kind {
            RoundKind::Lines => lines(members),
            RoundKind::Rates => {
                let rates = all.filter_map(|answer| match answer {
                    Answer::Rates { rates } => Some(rates),
                    _ => None,
                });
                Answer::Rates { rates: rates.flatten().collect() }
            }
            RoundKind::Stop => {
                let stopped = all.filter_map(|answer| match answer {
                    Answer::Stop { motors } => Some(motors),
                    _ => None,
                });
                let mut motors: Vec<_> = stopped.flatten().collect();
                for (node, why) in self.refused() {
                    let member = members.get(node);
                    motors
                        .extend(member.into_iter().flat_map(|it| it.unstopped(node, &why.message)));
                }
                Answer::Stop { motors }
            }
            RoundKind::Latch => self.by_all(Answer::Latch)?,
            RoundKind::Release => self.by_all(Answer::Release)?,
            RoundKind::Subscribe(subscription) => {
                // A node that is away has its part when it is back.
                let refused = self.refused().find(|(_, refusal)| refusal.reason != Reason::Line);
                match refused {
                    Some((node, why)) => return Err(names::refusal(node, None, why.clone())),
                    None => Answer::Subscribe { subscription },
                }
            }
        })
    }

    fn refused(&self) -> impl Iterator<Item = (&Name, &Refusal)> {
        self.done.iter().filter_map(|(node, result)| Some((node, result.as_ref().err()?)))
    }

    /// This answer, if no node refused.
    fn by_all(&self, answer: Answer) -> Result<Answer, Refusal> {
        let missing: Vec<_> = self.refused().map(|(_, why)| why.message.clone()).collect();
        match missing.is_empty() {
            true => Ok(answer),
            false => {
                let message = format!("not at all nodes: {}", missing.join("; "));
                Err(Refusal::new(Reason::Line, message))
            }
        }
    }
}

/// The lines of all nodes, also of those that are away.
fn lines(members: &BTreeMap<Name, Member>) -> Answer {
    let (mut all, mut latched) = (Vec::new(), Vec::new());
    for (node, member) in members {
        for line in &member.lines {
            let mut line = line.clone();
            line.line = names::in_fleet(node, &line.line);
            all.push(line);
        }
        latched.extend(member.latched_by.as_ref().map(|by| format!("{by} at {node}")));
    }
    let latched_by = Some(latched.join(", ")).filter(|text| !text.is_empty());
    Answer::Lines { lines: all, latched_by }
}
