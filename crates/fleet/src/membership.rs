//! The other nodes of a network, as a node sees them come and go. It reads no clock: times come from the
//! caller, in seconds.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use crate::directory::Run;
use crate::message::Away;

/// Runs that have ended and nodes that went away are remembered up to this number.
const MOST: usize = 256;

/// Who is there, who has ended, and who went away without an end.
#[derive(Debug, Default)]
pub(crate) struct Membership {
    here: BTreeSet<Run>,
    ended: VecDeque<Run>,
    away: BTreeMap<Run, Gone>,
}

/// A run that went away.
#[derive(Debug)]
struct Gone {
    since: f64,
    /// Other runs of this name that were there at that time: none of them is the node started again.
    twins: BTreeSet<Run>,
}

impl Membership {
    /// A run of a node is there. On the same computer it is the node that went away, started again.
    pub(crate) fn came(&mut self, run: Run) {
        self.away.retain(|other, gone| {
            let is_again =
                other.0 == run.0 && run.1.is_of_computer_of(&other.1) && !gone.twins.contains(&run);
            *other != run && !is_again
        });
        self.here.insert(run);
    }

    /// A run says that it ends: its motors have been stopped.
    pub(crate) fn ended(&mut self, run: Run) {
        self.away.remove(&run);
        if self.ended.len() >= MOST {
            self.ended.pop_front();
        }
        self.ended.push_back(run);
    }

    /// A run is not there any more.
    pub(crate) fn went(&mut self, run: Run, now: f64) {
        self.here.remove(&run);
        if self.ended.contains(&run) {
            return;
        }
        let twins = self.here.iter().filter(|(node, _)| *node == run.0).cloned().collect();
        self.away.insert(run, Gone { since: now, twins });
        if self.away.len() > MOST {
            let oldest =
                self.away.iter().min_by(|(_, one), (_, other)| one.since.total_cmp(&other.since));
            let oldest = oldest.map(|(run, _)| run.clone());
            oldest.map(|run| self.away.remove(&run));
        }
    }

    /// The runs that went away without an end, and are not back.
    pub(crate) fn away(&self) -> Vec<Away> {
        let told = |((node, boot), gone): (&Run, &Gone)| Away {
            node: node.to_string(),
            boot: boot.to_string(),
            since: gone.since,
        };
        self.away.iter().map(told).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A run on a computer with this digit.
    fn run_at(node: &str, computer: u32, boot: &str) -> Run {
        (node.parse().unwrap(), format!("{computer:08x}{boot}").parse().unwrap())
    }

    fn run(node: &str, boot: &str) -> Run {
        run_at(node, 1, boot)
    }

    fn away(members: &Membership) -> Vec<(String, f64)> {
        members.away().into_iter().map(|it| (it.node, it.since)).collect()
    }

    #[test]
    fn a_node_that_vanishes_is_away_until_it_is_back() {
        let mut members = Membership::default();
        members.came(run("arm1", "a"));
        members.came(run("arm2", "b"));
        assert_eq!(away(&members), []);
        members.went(run("arm2", "b"), 7.0);
        assert_eq!(away(&members), [("arm2".to_owned(), 7.0)]);
        // The same run: the network was cut. Another run: it was started again.
        for boot in ["b", "c"] {
            members.came(run("arm2", boot));
            assert_eq!(away(&members), []);
            members.went(run("arm2", boot), 9.0);
            assert_eq!(away(&members), [("arm2".to_owned(), 9.0)]);
        }
    }

    #[test]
    fn a_node_that_ends_is_not_away_whichever_is_heard_first() {
        let mut members = Membership::default();
        members.came(run("arm1", "a"));
        members.ended(run("arm1", "a"));
        members.went(run("arm1", "a"), 1.0);
        assert_eq!(away(&members), []);
        members.came(run("arm1", "b"));
        members.went(run("arm1", "b"), 2.0);
        members.ended(run("arm1", "b"));
        assert_eq!(away(&members), []);
        // The end of an earlier run says nothing about this one.
        members.came(run("arm1", "c"));
        members.went(run("arm1", "c"), 3.0);
        members.ended(run("arm1", "b"));
        assert_eq!(away(&members), [("arm1".to_owned(), 3.0)]);
    }

    #[test]
    fn a_node_that_was_there_before_is_known_when_it_vanishes() {
        let mut members = Membership::default();
        members.went(run("arm1", "a"), 1.0);
        assert_eq!(away(&members), [("arm1".to_owned(), 1.0)]);
    }

    #[test]
    fn a_node_with_the_name_of_one_that_vanished_does_not_hide_it() {
        let mut members = Membership::default();
        // Both were there at the same time, on one computer or on two.
        for (first, other) in [("a", run("arm1", "b")), ("e", run_at("arm1", 2, "b"))] {
            members.came(run("arm1", first));
            members.came(other.clone());
            members.went(run("arm1", first), 1.0);
            // The network of the other one is cut for a moment.
            members.went(other.clone(), 2.0);
            members.came(other.clone());
            assert_eq!(away(&members), [("arm1".to_owned(), 1.0)], "{other:?}");
            members.ended(run("arm1", first));
            members.ended(other.clone());
            members.went(other, 2.0);
        }
        // A copy of the computer takes its place.
        members.came(run("arm1", "c"));
        members.went(run("arm1", "c"), 3.0);
        members.came(run_at("arm1", 2, "d"));
        assert_eq!(away(&members), [("arm1".to_owned(), 3.0)]);
        // It is back, also started again.
        members.came(run("arm1", "f"));
        assert_eq!(away(&members), []);
    }

    #[test]
    fn many_nodes_do_not_take_all_memory() {
        let mut members = Membership::default();
        for number in 0..3 * MOST {
            members.went(run(&format!("n{number}"), "a"), number as f64);
            members.ended(run(&format!("e{number}"), "a"));
        }
        assert_eq!(members.away().len(), MOST);
        assert_eq!(members.ended.len(), MOST);
        assert!(members.away().iter().all(|it| it.since >= 2.0 * MOST as f64));
    }
}
