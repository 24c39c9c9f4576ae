//! Subscriptions of the program, as one of each node.

use super::*;

impl Aggregate {
    pub(super) fn subscribe(&mut self, id: u32, ask: Ask) {
        let Ask::Subscribe { signals, period, queue, drop, rows } = ask else { return };
        let mut of_nodes: BTreeMap<Name, Vec<SignalName>> = BTreeMap::new();
        for mut signal in signals {
            match self.known(&signal.line) {
                Ok((node, line)) => {
                    signal.line = line;
                    of_nodes.entry(node).or_default().push(signal);
                }
                Err(why) => return self.end(id, Err(why)),
            }
        }
        self.last_subscription += 1;
        let number = self.last_subscription;
        let nodes = of_nodes.keys().cloned().collect();
        let part = |signals| Ask::Subscribe { signals, period, queue, drop, rows };
        let parts = of_nodes.into_iter().map(|(node, signals)| (node, part(signals)));
        self.subscriptions.insert(number, Subscription { parts: parts.collect() });
        self.round(id, RoundKind::Subscribe(number), nodes);
    }

    /// Whether there was such a subscription.
    pub(super) fn unsubscribe(&mut self, number: u32) -> bool {
        if self.subscriptions.remove(&number).is_none() {
            return false;
        }
        let mut theirs = Vec::new();
        for (node, member) in &mut self.members {
            let ended = member.subscriptions.iter().filter(|(_, ours)| **ours == number);
            theirs.extend(ended.map(|(subscription, _)| (node.clone(), *subscription)));
            member.subscriptions.retain(|_, ours| *ours != number);
        }
        for (node, subscription) in theirs {
            self.ask(&node, Ask::Unsubscribe { subscription }, RequestPurpose::Nothing);
        }
        true
    }
}
