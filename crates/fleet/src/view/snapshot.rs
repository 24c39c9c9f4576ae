//! The last values of all motors of all nodes. It reads no clock: times come from the caller, in seconds.

use std::collections::{BTreeMap, BTreeSet};

use motorlink_telemetry::share::data::{Data, TIMES};
use motorlink_telemetry::share::drive_protocol::DriveProtocol;
use motorlink_telemetry::share::message::Group;
use motorlink_telemetry::signal::Motor;

use crate::directory::Run;
use crate::key::Name;
use crate::message::Info;

/// What a motor said last.
#[derive(Debug, Clone, PartialEq)]
pub struct Drive {
    /// Its node.
    pub node: Name,
    /// Its line there.
    pub line: String,
    /// The motor.
    pub motor: Motor,
    /// Its last values, by the name of the signal.
    pub values: BTreeMap<String, f64>,
    /// When they came. `None`: none has come.
    pub at: Option<f64>,
}

/// What a node said last.
#[derive(Debug, Clone, PartialEq)]
pub struct Node {
    /// What it said.
    pub info: Info,
    /// When that came.
    pub at: f64,
}

/// The last values of a motor by signal, and when they came.
type Values = (BTreeMap<String, f64>, f64);

#[derive(Debug, Default)]
pub(super) struct Snapshot {
    /// The runs that are there, as the network says.
    here: BTreeSet<Run>,
    nodes: BTreeMap<Run, Node>,
    columns: BTreeMap<(Name, u32), Vec<String>>,
    values: BTreeMap<(Name, String, u8), Values>,
}

impl Snapshot {
    /// A run of a node is there.
    pub(super) fn came(&mut self, run: Run) {
        self.here.insert(run);
    }

    /// A run of a node is not there any more.
    pub(super) fn went(&mut self, run: &Run) {
        self.here.remove(run);
    }

    /// Whether several nodes have this name. Their samples have the same keys.
    fn has_twins(&self, node: &Name) -> bool {
        self.here.iter().filter(|(name, _)| name == node).count() > 1
    }

    /// The name under which a run is shown.
    fn shown(&self, (node, boot): &Run) -> Name {
        match self.has_twins(node) {
            true => node.of_run(boot),
            false => node.clone(),
        }
    }

    /// What a node says of itself.
    pub(super) fn state(&mut self, node: Name, info: Info, now: f64) {
        let Ok(boot) = info.boot.parse() else { return };
        let run = (node.clone(), boot);
        if !self.nodes.contains_key(&run) || self.has_twins(&node) {
            // Groups are counted anew.
            self.columns.retain(|(of, _), _| *of != node);
            self.values.retain(|(of, ..), _| *of != node);
        }
        let here = &self.here;
        self.nodes.retain(|other, _| other.0 != node || here.contains(other));
        self.nodes.insert(run, Node { info, at: now });
    }

    pub(super) fn columns(&mut self, node: Name, group: Group) {
        let names = group.columns.into_iter().map(|column| column.name).collect();
        self.columns.insert((node, group.group), names);
    }

    /// Takes samples of a motor. `false`: their columns are not known.
    pub(super) fn samples(
        &mut self,
        node: Name,
        line: &str,
        motor: u8,
        data: &Data,
        now: f64,
    ) -> bool {
        if self.has_twins(&node) {
            return true;
        }
        let Some(names) = self.columns.get(&(node.clone(), data.group)) else { return false };
        let (values, at) = self.values.entry((node, line.to_owned(), motor)).or_default();
        *at = now;
        for (name, column) in names.iter().zip(data.columns.iter().skip(TIMES)) {
            // A slow signal has no value in most rows.
            if let Some(value) = column.iter().rfind(|value| !value.is_nan()) {
                values.insert(name.clone(), *value);
            }
        }
        true
    }

    /// The nodes, by the names under which they are shown.
    pub(super) fn nodes(&self) -> BTreeMap<Name, Node> {
        self.nodes.iter().map(|(run, node)| (self.shown(run), node.clone())).collect()
    }

    /// A name that several nodes have.
    pub(super) fn twins(&self) -> Option<Name> {
        self.here.iter().map(|(node, _)| node).find(|node| self.has_twins(node)).cloned()
    }

    /// The runs of the nodes.
    pub(super) fn runs(&self) -> impl Iterator<Item = &Run> {
        self.nodes.keys()
    }

    /// The motors that have answered, in the order of nodes and lines.
    pub(super) fn drives(&self) -> Vec<Drive> {
        let mut drives = Vec::new();
        for (run, Node { info, .. }) in &self.nodes {
            let node = &run.0;
            for line in &info.lines {
                let Some(speaks) = DriveProtocol::of(line) else { continue };
                for motor in line.heard.iter().filter_map(|number| speaks.motor(*number)) {
                    let key = (node.clone(), line.line.clone(), motor.number());
                    let values = self.values.get(&key).filter(|_| !self.has_twins(node));
                    let (values, at) = match values {
                        Some((values, at)) => (values.clone(), Some(*at)),
                        None => (BTreeMap::new(), None),
                    };
                    drives.push(Drive {
                        node: self.shown(run),
                        line: line.line.clone(),
                        motor,
                        values,
                        at,
                    });
                }
            }
        }
        drives
    }
}

#[cfg(test)]
mod tests {
    use motorlink_telemetry::share::message::{Column, Line, Protocol};

    use super::*;

    fn info(boot: &str, heard: &[u8]) -> Info {
        let line = Line {
            line: "rmd0".to_owned(),
            protocol: Protocol::Rmd,
            heard: heard.to_vec(),
            ..Line::default()
        };
        Info {
            node: "arm1".to_owned(),
            boot: boot.to_owned(),
            lines: vec![line],
            ..Info::default()
        }
    }

    fn group(number: u32) -> Group {
        let column = |name: &str| Column { name: name.to_owned(), unit: String::new() };
        let columns = vec![column("speed_dps"), column("voltage_volts")];
        Group { group: number, subscription: 1, line: "rmd0".to_owned(), motor: 1, columns }
    }

    fn data(group: u32, speeds: &[f64], volts: &[f64]) -> Data {
        let times = vec![0.0; speeds.len()];
        let columns = vec![times.clone(), times, speeds.to_vec(), volts.to_vec()];
        Data { group, sequence: 0, lost: 0, t0: 0.0, columns }
    }

    fn node() -> Name {
        "arm1".parse().unwrap()
    }

    #[test]
    fn the_last_value_of_each_signal_is_kept() {
        let mut picture = Snapshot::default();
        picture.state(node(), info("a", &[1, 2]), 1.0);
        assert!(!picture.samples(node(), "rmd0", 1, &data(7, &[1.0], &[24.0]), 1.0));
        picture.columns(node(), group(7));
        assert!(picture.samples(node(), "rmd0", 1, &data(7, &[1.0, 2.0], &[24.0, f64::NAN]), 2.0));
        assert!(picture.samples(node(), "rmd0", 1, &data(7, &[3.0], &[f64::NAN]), 3.0));
        let drives = picture.drives();
        assert_eq!((drives.len(), drives[0].at, drives[1].at), (2, Some(3.0), None));
        assert_eq!(drives[0].values["speed_dps"], 3.0);
        assert_eq!(drives[0].values["voltage_volts"], 24.0);
    }

    #[test]
    fn nodes_with_one_name_are_shown_both_and_no_value_is_that_of_another() {
        let mut picture = Snapshot::default();
        let run = |boot: &str| (node(), boot.parse().unwrap());
        for boot in ["a-1111", "b-2222"] {
            picture.came(run(boot));
            picture.state(node(), info(boot, &[1]), 1.0);
        }
        picture.columns(node(), group(7));
        assert!(picture.samples(node(), "rmd0", 1, &data(7, &[1.0], &[24.0]), 1.0));
        let shown: Vec<_> = picture.drives().into_iter().map(|it| (it.node, it.at)).collect();
        let both = ["arm1.run-1111", "arm1.run-2222"].map(|name| (name.parse().unwrap(), None));
        assert_eq!(shown, both);
        picture.went(&run("a-1111"));
        picture.state(node(), info("b-2222", &[1]), 2.0);
        picture.columns(node(), group(7));
        assert!(picture.samples(node(), "rmd0", 1, &data(7, &[1.0], &[24.0]), 2.0));
        let shown: Vec<_> = picture.drives().into_iter().map(|it| (it.node, it.at)).collect();
        assert_eq!(shown, [(node(), Some(2.0))]);
    }

    #[test]
    fn a_node_that_was_started_again_has_no_old_values() {
        let mut picture = Snapshot::default();
        picture.state(node(), info("a", &[1]), 1.0);
        picture.columns(node(), group(7));
        picture.samples(node(), "rmd0", 1, &data(7, &[1.0], &[24.0]), 1.0);
        picture.state(node(), info("b", &[1]), 2.0);
        assert_eq!(picture.drives()[0].at, None);
        assert!(!picture.samples(node(), "rmd0", 1, &data(7, &[1.0], &[24.0]), 2.0));
    }
}
