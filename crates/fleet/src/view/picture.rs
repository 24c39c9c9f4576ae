//! The last values of all motors of all nodes. It reads no clock: times come from the caller, in seconds.

use std::collections::BTreeMap;

use motorlink_telemetry::share::data::{Data, TIMES};
use motorlink_telemetry::share::message::Group;
use motorlink_telemetry::share::words::Speaks;
use motorlink_telemetry::signal::Motor;

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
pub(super) struct Picture {
    nodes: BTreeMap<Name, Node>,
    columns: BTreeMap<(Name, u32), Vec<String>>,
    values: BTreeMap<(Name, String, u8), Values>,
}

impl Picture {
    /// What a node says of itself.
    pub(super) fn state(&mut self, node: Name, info: Info, now: f64) {
        let is_new = self.nodes.get(&node).is_none_or(|known| known.info.boot != info.boot);
        if is_new {
            // Groups are counted anew.
            self.columns.retain(|(of, _), _| *of != node);
            self.values.retain(|(of, ..), _| *of != node);
        }
        self.nodes.insert(node, Node { info, at: now });
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

    pub(super) fn nodes(&self) -> BTreeMap<Name, Node> {
        self.nodes.clone()
    }

    /// The motors that have answered, in the order of nodes and lines.
    pub(super) fn drives(&self) -> Vec<Drive> {
        let mut drives = Vec::new();
        for (node, Node { info, .. }) in &self.nodes {
            for line in &info.lines {
                let Some(speaks) = Speaks::of(line) else { continue };
                for motor in line.heard.iter().filter_map(|number| speaks.motor(*number)) {
                    let key = (node.clone(), line.line.clone(), motor.number());
                    let (values, at) = match self.values.get(&key) {
                        Some((values, at)) => (values.clone(), Some(*at)),
                        None => (BTreeMap::new(), None),
                    };
                    drives.push(Drive {
                        node: node.clone(),
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
            port: "sim:".to_owned(),
            profile: None,
            timeout: 1.0,
            t: 0.0,
            wall: 0.0,
            counts: None,
            heard: heard.to_vec(),
            unstopped: Vec::new(),
        };
        Info {
            node: "arm1".to_owned(),
            protocol: crate::VERSION,
            program: "test".to_owned(),
            boot: boot.to_owned(),
            t: 0.0,
            wall: 0.0,
            lines: vec![line],
            searching: Vec::new(),
            latched_by: None,
            away: Vec::new(),
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
        let mut picture = Picture::default();
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
    fn a_node_that_was_started_again_has_no_old_values() {
        let mut picture = Picture::default();
        picture.state(node(), info("a", &[1]), 1.0);
        picture.columns(node(), group(7));
        picture.samples(node(), "rmd0", 1, &data(7, &[1.0], &[24.0]), 1.0);
        picture.state(node(), info("b", &[1]), 2.0);
        assert_eq!(picture.drives()[0].at, None);
        assert!(!picture.samples(node(), "rmd0", 1, &data(7, &[1.0], &[24.0]), 2.0));
    }
}
