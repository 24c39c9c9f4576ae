//! The other nodes of a network, as a node sees them come and go. It reads no clock: times come from the
//! caller, in seconds.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use crate::key::Name;
use crate::message::Away;

/// Runs that have ended and nodes that went away are remembered up to this number.
const MOST: usize = 256;

/// A run of a node.
type Run = (Name, Name);

/// Who is there, who has ended, and who went away without an end.
#[derive(Debug, Default)]
pub(crate) struct Roll {
    here: BTreeSet<Run>,
    ended: VecDeque<Run>,
    away: BTreeMap<Name, Gone>,
}

/// A node that went away.
#[derive(Debug)]
struct Gone {
    boot: Name,
    since: f64,
}

impl Roll {
    /// A run of a node is there.
    pub(crate) fn came(&mut self, run: Run) {
        self.away.remove(&run.0);
        self.here.insert(run);
    }

    /// A run says that it ends: its motors have been stopped.
    pub(crate) fn ended(&mut self, run: Run) {
        if self.away.get(&run.0).is_some_and(|gone| gone.boot == run.1) {
            self.away.remove(&run.0);
        }
        if self.ended.len() >= MOST {
            self.ended.pop_front();
        }
        self.ended.push_back(run);
    }

    /// A run is not there any more.
    pub(crate) fn went(&mut self, run: Run, now: f64) {
        self.here.remove(&run);
        let is_here = self.here.iter().any(|(node, _)| *node == run.0);
        if is_here || self.ended.contains(&run) {
            return;
        }
        let (node, boot) = run;
        self.away.insert(node, Gone { boot, since: now });
        if self.away.len() > MOST {
            let oldest =
                self.away.iter().min_by(|(_, one), (_, other)| one.since.total_cmp(&other.since));
            let oldest = oldest.map(|(node, _)| node.clone());
            oldest.map(|node| self.away.remove(&node));
        }
    }

    /// The nodes that went away without an end, and are not back.
    pub(crate) fn away(&self) -> Vec<Away> {
        let told =
            |(node, gone): (&Name, &Gone)| Away { node: node.to_string(), since: gone.since };
        self.away.iter().map(told).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(node: &str, boot: &str) -> Run {
        (node.parse().unwrap(), boot.parse().unwrap())
    }

    fn away(roll: &Roll) -> Vec<(String, f64)> {
        roll.away().into_iter().map(|it| (it.node, it.since)).collect()
    }

    #[test]
    fn a_node_that_vanishes_is_away_until_it_is_back() {
        let mut roll = Roll::default();
        roll.came(run("arm1", "a"));
        roll.came(run("arm2", "b"));
        assert_eq!(away(&roll), []);
        roll.went(run("arm2", "b"), 7.0);
        assert_eq!(away(&roll), [("arm2".to_owned(), 7.0)]);
        // The same run: the network was cut. Another run: it was started again.
        for boot in ["b", "c"] {
            roll.came(run("arm2", boot));
            assert_eq!(away(&roll), []);
            roll.went(run("arm2", boot), 9.0);
            assert_eq!(away(&roll), [("arm2".to_owned(), 9.0)]);
        }
    }

    #[test]
    fn a_node_that_ends_is_not_away_whichever_is_heard_first() {
        let mut roll = Roll::default();
        roll.came(run("arm1", "a"));
        roll.ended(run("arm1", "a"));
        roll.went(run("arm1", "a"), 1.0);
        assert_eq!(away(&roll), []);
        roll.came(run("arm1", "b"));
        roll.went(run("arm1", "b"), 2.0);
        roll.ended(run("arm1", "b"));
        assert_eq!(away(&roll), []);
        // The end of an earlier run says nothing about this one.
        roll.came(run("arm1", "c"));
        roll.went(run("arm1", "c"), 3.0);
        roll.ended(run("arm1", "b"));
        assert_eq!(away(&roll), [("arm1".to_owned(), 3.0)]);
    }

    #[test]
    fn a_node_that_was_there_before_is_known_when_it_vanishes() {
        let mut roll = Roll::default();
        roll.went(run("arm1", "a"), 1.0);
        assert_eq!(away(&roll), [("arm1".to_owned(), 1.0)]);
    }

    #[test]
    fn the_late_end_of_an_old_run_does_not_hide_a_new_one() {
        let mut roll = Roll::default();
        roll.came(run("arm1", "a"));
        roll.came(run("arm1", "b"));
        roll.went(run("arm1", "a"), 1.0);
        assert_eq!(away(&roll), []);
        roll.went(run("arm1", "b"), 2.0);
        assert_eq!(away(&roll), [("arm1".to_owned(), 2.0)]);
    }

    #[test]
    fn many_nodes_do_not_take_all_memory() {
        let mut roll = Roll::default();
        for number in 0..3 * MOST {
            roll.went(run(&format!("n{number}"), "a"), number as f64);
            roll.ended(run(&format!("e{number}"), "a"));
        }
        assert_eq!(roll.away().len(), MOST);
        assert_eq!(roll.ended.len(), MOST);
        assert!(roll.away().iter().all(|it| it.since >= 2.0 * MOST as f64));
    }
}
