//! Requests of the program to several nodes, whose answers become one.

use super::*;

impl Aggregate {
    /// Asks all nodes.
    pub(super) fn all(&mut self, id: u32, kind: RoundKind) {
        let nodes: BTreeSet<_> = self.members.keys().cloned().collect();
        self.round(id, kind, nodes);
    }

    pub(super) fn round(&mut self, id: u32, kind: RoundKind, nodes: BTreeSet<Name>) {
        self.last_round += 1;
        let number = self.last_round;
        let round = Round { id, kind, waits: nodes.clone(), done: BTreeMap::new() };
        self.rounds.insert(number, round);
        for node in &nodes {
            match self.members.get(node).map(|it| &it.state) {
                Some(State::Here) => {
                    if let Some(ask) = self.ask_of(kind, node) {
                        self.ask(node, ask, RequestPurpose::Round(number));
                    }
                }
                Some(State::Away(why)) => {
                    let why = away(node, why);
                    self.ended(node, RequestPurpose::Round(number), Err(why));
                }
                Some(State::Coming) | None => {}
            }
        }
        self.finish(number);
    }

    /// What a node is asked in a round.
    pub(super) fn ask_of(&self, kind: RoundKind, node: &Name) -> Option<Ask> {
        Some(match kind {
            RoundKind::Lines => Ask::Lines,
            RoundKind::Rates => Ask::Rates { line: None },
            RoundKind::Stop => Ask::Stop { motor: None },
            RoundKind::Latch => Ask::Latch,
            RoundKind::Release => Ask::Release,
            RoundKind::Subscribe(number) => {
                self.subscriptions.get(&number)?.parts.get(node)?.clone()
            }
        })
    }

    /// Answers the program if all nodes have answered.
    pub(super) fn finish(&mut self, number: u64) {
        if self.rounds.get(&number).is_none_or(|round| !round.waits.is_empty()) {
            return;
        }
        let Some(round) = self.rounds.remove(&number) else { return };
        let answer = round.answer(&self.members);
        if let (RoundKind::Subscribe(subscription), Err(_)) = (round.kind, &answer) {
            self.unsubscribe(subscription);
        }
        self.end(round.id, answer);
    }

    /// No round waits for a node that did not come.
    pub(super) fn fail_rounds(&mut self, node: &Name, why: &str) {
        let waiting = self.rounds.iter().filter(|(_, round)| round.waits.contains(node));
        for number in waiting.map(|(number, _)| *number).collect::<Vec<_>>() {
            self.ended(node, RequestPurpose::Round(number), Err(away(node, why)));
        }
    }
}
