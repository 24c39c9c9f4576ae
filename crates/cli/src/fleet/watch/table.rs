//! The table of drives: what it shows, in which order, and its sums by node.

use std::collections::BTreeMap;

use clap::ValueEnum;
use motorlink_fleet::key::Name;
use motorlink_fleet::view::{Drive, Node, View};
use motorlink_telemetry::overview::{self, Overview};
use motorlink_telemetry::sample::Sample;
use motorlink_telemetry::signal::Source;
use serde_json::{Value, json};

use crate::text::{counted, fit, right};

/// Values that are older than this, in seconds, are old.
const OLD: f64 = 2.0;
/// A node that was silent for longer than this, in seconds, is away.
const AWAY: f64 = 3.0;
/// The state of a motor that turns.
const TURNING: [&str; 2] = ["RUN", "turning"];

/// What the rows are sorted by.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum Sort {
    /// Node, line, motor
    #[default]
    Name,
    /// The fastest first
    Speed,
    /// The greatest current first
    Current,
    /// The hottest first
    Temperature,
    /// The oldest value first
    Age,
    /// Those with faults first
    Faults,
}

/// The word of a choice on the command line.
pub fn word(choice: &impl ValueEnum) -> String {
    choice.to_possible_value().map_or_else(String::new, |it| it.get_name().to_owned())
}

/// The choice behind this one; behind the last one, the first.
pub fn next<T: ValueEnum + Copy + PartialEq>(choice: T) -> T {
    let mut all = T::value_variants().iter().copied().cycle().skip_while(|it| *it != choice);
    all.nth(1).unwrap_or(choice)
}

/// Which drives are shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum Only {
    /// All of them
    #[default]
    All,
    /// Those that turn
    Turning,
    /// Those with faults
    Faulty,
    /// Those without new values
    Old,
}

impl Only {
    fn has(self, row: &Row) -> bool {
        match self {
            Only::All => true,
            Only::Turning => row.is_turning(),
            Only::Faulty => row.faults.is_some(),
            Only::Old => row.is_old(),
        }
    }
}

/// A value with the symbol of its unit.
type Quantity = (f64, &'static str);

/// A drive.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    node: Name,
    line: String,
    motor: u8,
    state: Option<String>,
    speed: Option<Quantity>,
    current: Option<Quantity>,
    temperature: Option<Quantity>,
    voltage: Option<Quantity>,
    /// Of the last values, in seconds. `None`: there are none.
    age: Option<f64>,
    faults: Option<String>,
}

impl Row {
    pub fn of(drive: &Drive, now: f64) -> Self {
        let main = Overview::of(drive.motor);
        let value = |source: Source| drive.values.get(&source.to_string()).copied();
        let sample = |source: Source| value(source).map(Sample::told);
        let quantity = |source: Source| Some((value(source)?, source.unit()));
        Row {
            node: drive.node.clone(),
            line: drive.line.clone(),
            motor: drive.motor.number(),
            state: overview::state(&main, sample),
            speed: quantity(main.speed),
            current: quantity(main.current),
            temperature: quantity(main.temperature),
            voltage: quantity(main.voltage),
            age: drive.at.map(|at| now - at),
            faults: sample(main.faults).and_then(|it| overview::faults(drive.motor, it)),
        }
    }

    pub fn name(&self) -> String {
        format!("{}/{}/{}", self.node, self.line, self.motor)
    }

    fn is_turning(&self) -> bool {
        self.state.as_deref().is_some_and(|state| TURNING.contains(&state))
    }

    pub fn is_old(&self) -> bool {
        self.age.is_none_or(|age| age > OLD)
    }

    pub fn is_bad(&self) -> bool {
        self.faults.is_some() || self.is_old()
    }

    pub fn text(&self, name_width: usize) -> String {
        let quantity = |it: Option<Quantity>, decimals: usize, width: usize| match it {
            Some((value, unit)) => right(&format!("{value:.decimals$} {unit}"), width),
            None => right("-", width),
        };
        // What the motor does now is not known.
        let state = match self.state.as_deref() {
            _ if self.is_old() => "old",
            Some(state) => state,
            None => "-",
        };
        let age = self.age.map_or("-".to_owned(), |age| format!("{age:.1} s"));
        let current = self.current.map_or(0, |(_, unit)| if unit == "A" { 2 } else { 0 });
        let cells = [
            fit(&self.name(), name_width),
            fit(state, 8),
            quantity(self.speed, 0, 9),
            quantity(self.current, current, 10),
            quantity(self.temperature, 0, 6),
            quantity(self.voltage, 0, 6),
            right(&age, 7),
            self.faults.clone().unwrap_or_default(),
        ];
        cells.join(" ").trim_end().to_owned()
    }

    pub fn header(name_width: usize) -> String {
        let cells = [
            fit("drive", name_width),
            fit("state", 8),
            right("speed", 9),
            right("current", 10),
            right("temp", 6),
            right("supply", 6),
            right("age", 7),
            "faults".to_owned(),
        ];
        cells.join(" ")
    }

    pub fn object(&self) -> Value {
        let value = |it: Option<Quantity>| it.map(|(value, _)| value);
        let unit = |it: Option<Quantity>| it.map(|(_, unit)| unit);
        json!({
            "node": self.node.as_str(), "line": self.line, "motor": self.motor, "state": self.state,
            "speed": value(self.speed), "speed_unit": unit(self.speed),
            "current": value(self.current), "current_unit": unit(self.current),
            "temperature_celsius": value(self.temperature), "voltage_volts": value(self.voltage),
            "age_seconds": self.age, "faults": self.faults,
        })
    }
}

/// Rows as they are shown.
pub fn rows(drives: &[Drive], now: f64, sort: Sort, only: Only, name: &str) -> Vec<Row> {
    let all = drives.iter().map(|drive| Row::of(drive, now));
    let mut rows: Vec<Row> = all.filter(|row| only.has(row) && row.name().contains(name)).collect();
    let by = |of: fn(&Row) -> Option<f64>| {
        // No value is less than any.
        move |row: &Row| of(row).map_or(f64::INFINITY, |value| -value.abs())
    };
    let sorted = |rows: &mut Vec<Row>, key: &dyn Fn(&Row) -> f64| {
        rows.sort_by(|one, other| key(one).total_cmp(&key(other)));
    };
    match sort {
        Sort::Name => {}
        Sort::Speed => sorted(&mut rows, &by(|row| row.speed.map(|it| it.0))),
        Sort::Current => sorted(&mut rows, &by(|row| row.current.map(|it| it.0))),
        Sort::Temperature => sorted(&mut rows, &by(|row| row.temperature.map(|it| it.0))),
        Sort::Age => sorted(&mut rows, &by(|row| row.age.or(Some(f64::MAX)))),
        Sort::Faults => rows.sort_by_key(|row| row.faults.is_none()),
    }
    rows
}

/// The drives of a node in numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct Sum {
    node: Name,
    drives: usize,
    turning: usize,
    faulty: usize,
    old: usize,
    hottest: Option<f64>,
    latched_by: Option<String>,
    /// How long the node has been silent, in seconds.
    age: f64,
    /// Whether this program has seen it.
    is_seen: bool,
}

impl Sum {
    /// A node that went away before this program came.
    fn away(node: Name, age: f64) -> Self {
        let (drives, turning, faulty, old) = (0, 0, 0, 0);
        let (hottest, latched_by, is_seen) = (None, None, false);
        Sum { node, drives, turning, faulty, old, hottest, latched_by, age, is_seen }
    }

    pub fn name(&self) -> &str {
        self.node.as_str()
    }

    fn is_away(&self) -> bool {
        !self.is_seen || self.age > AWAY
    }

    pub fn is_bad(&self) -> bool {
        self.faulty > 0 || self.old > 0 || self.is_away()
    }

    pub fn text(&self, name_width: usize) -> String {
        let number = |it: usize, width| match self.is_seen {
            true => right(&it.to_string(), width),
            false => right("-", width),
        };
        let state = match &self.latched_by {
            _ if self.is_away() => format!("away for {:.0} s", self.age),
            Some(by) => format!("latched by {by}"),
            None => "here".to_owned(),
        };
        let cells = [
            fit(self.node.as_str(), name_width),
            number(self.drives, 6),
            number(self.turning, 7),
            number(self.faulty, 6),
            number(self.old, 4),
            right(&self.hottest.map_or("-".to_owned(), |it| format!("{it:.0} °C")), 7),
            state,
        ];
        cells.join(" ")
    }

    pub fn header(name_width: usize) -> String {
        let cells = [
            fit("node", name_width),
            right("drives", 6),
            right("turning", 7),
            right("faulty", 6),
            right("old", 4),
            right("hottest", 7),
            "state".to_owned(),
        ];
        cells.join(" ")
    }

    pub fn object(&self) -> Value {
        let count = |it: usize| self.is_seen.then_some(it);
        json!({
            "node": self.node.as_str(), "away": self.is_away(), "drives": count(self.drives),
            "turning": count(self.turning), "faulty": count(self.faulty), "old": count(self.old),
            "hottest_celsius": self.hottest, "latched_by": self.latched_by, "age_seconds": self.age,
        })
    }
}

/// The sums of all nodes.
pub fn sums(nodes: &BTreeMap<Name, Node>, drives: &[Drive], now: f64) -> Vec<Sum> {
    let of_node = |(name, node): (&Name, &Node)| {
        let rows: Vec<Row> =
            drives.iter().filter(|it| it.node == *name).map(|it| Row::of(it, now)).collect();
        let count = |is: fn(&Row) -> bool| rows.iter().filter(|row| is(row)).count();
        Sum {
            node: name.clone(),
            drives: rows.len(),
            turning: count(Row::is_turning),
            faulty: count(|row| row.faults.is_some()),
            old: count(Row::is_old),
            hottest: rows.iter().filter_map(|row| Some(row.temperature?.0)).reduce(f64::max),
            latched_by: node.info.latched_by.clone(),
            age: now - node.at,
            is_seen: true,
        }
    };
    nodes.iter().map(of_node).collect()
}

/// What is shown now.
pub struct Shown {
    pub rows: Vec<Row>,
    pub sums: Vec<Sum>,
}

impl Shown {
    pub fn of(view: &View, sort: Sort, only: Only, name: &str) -> Self {
        let (drives, now) = (view.drives(), View::now());
        let rows = rows(&drives, now, sort, only, name);
        let mut sums = sums(&view.nodes(), &drives, now);
        sums.extend(view.away().into_iter().map(|((node, _), age)| Sum::away(node, age)));
        Shown { rows, sums }
    }

    /// How wide the first column is.
    pub fn name_width(&self, by_node: bool) -> usize {
        let names = match by_node {
            true => self.sums.iter().map(|it| it.name().len()).max(),
            false => self.rows.iter().map(|it| it.name().len()).max(),
        };
        names.unwrap_or(0).max("drive".len())
    }
}

/// All nodes in a sentence.
pub fn summary(sums: &[Sum]) -> String {
    let total = |of: fn(&Sum) -> usize| sums.iter().map(of).sum::<usize>();
    let mut parts = vec![format!(
        "{}, {}: {} turning, {} faulty, {} old",
        counted(sums.len() as u64, "node"),
        counted(total(|it| it.drives) as u64, "drive"),
        total(|it| it.turning),
        total(|it| it.faulty),
        total(|it| it.old),
    )];
    let named = |what: &str, is: &dyn Fn(&&Sum) -> bool| {
        let names: Vec<_> = sums.iter().filter(is).map(|it| it.node.as_str()).collect();
        (!names.is_empty()).then(|| format!("{what}: {}", names.join(", ")))
    };
    parts.extend(named("away", &|it| it.is_away()));
    parts.extend(named("latched", &|it| it.latched_by.is_some() && !it.is_away()));
    parts.join("; ")
}

#[cfg(test)]
mod tests {
    use motorlink::rmd::MotorId;
    use motorlink_telemetry::signal::Motor;

    use super::*;

    fn drive(node: &str, id: u8, values: &[(&str, f64)], at: Option<f64>) -> Drive {
        Drive {
            node: node.parse().unwrap(),
            line: "rmd0".to_owned(),
            motor: Motor::Rmd(MotorId::new(id).unwrap()),
            values: values.iter().map(|(name, value)| ((*name).to_owned(), *value)).collect(),
            at,
        }
    }

    fn drives() -> Vec<Drive> {
        vec![
            drive(
                "arm1",
                1,
                &[
                    ("speed_dps", -90.0),
                    ("iq_amps", 0.5),
                    ("temperature_celsius", 40.0),
                    ("voltage_volts", 24.0),
                    ("errors", 0.0),
                ],
                Some(9.9),
            ),
            drive("arm1", 2, &[("speed_dps", 0.0), ("errors", 8.0)], Some(9.9)),
            drive("arm2", 1, &[("speed_dps", 30.0), ("errors", 0.0)], Some(5.0)),
            drive("arm2", 3, &[], None),
        ]
    }

    fn names(rows: &[Row]) -> Vec<String> {
        rows.iter().map(Row::name).collect()
    }

    fn shown(sort: Sort, only: Only, name: &str) -> Vec<String> {
        names(&rows(&drives(), 10.0, sort, only, name))
    }

    #[test]
    fn rows_are_sorted_and_chosen() {
        assert_eq!(shown(Sort::Name, Only::All, "").len(), 4);
        assert_eq!(shown(Sort::Speed, Only::All, "")[..2], ["arm1/rmd0/1", "arm2/rmd0/1"]);
        assert_eq!(shown(Sort::Age, Only::All, "")[0], "arm2/rmd0/3");
        assert_eq!(shown(Sort::Faults, Only::All, "")[0], "arm1/rmd0/2");
        assert_eq!(shown(Sort::Name, Only::Faulty, ""), ["arm1/rmd0/2"]);
        assert_eq!(shown(Sort::Name, Only::Old, ""), ["arm2/rmd0/1", "arm2/rmd0/3"]);
        assert_eq!(shown(Sort::Name, Only::Turning, "arm1"), ["arm1/rmd0/1"]);
    }

    #[test]
    fn a_row_is_as_wide_as_its_header_and_fits_80_columns() {
        let row = &rows(&drives(), 10.0, Sort::Name, Only::All, "")[0];
        assert_eq!(
            [Row::header(12), row.text(12)],
            [
                "drive        state        speed    current   temp supply     age faults",
                "arm1/rmd0/1  turning    -90 °/s     0.50 A  40 °C   24 V   0.1 s",
            ]
        );
    }

    #[test]
    fn an_old_value_is_not_shown_as_the_state() {
        let all = rows(&drives(), 10.0, Sort::Name, Only::All, "");
        assert!(all[2].text(12).starts_with("arm2/rmd0/1  old"), "{}", all[2].text(12));
        assert!(all[3].text(12).starts_with("arm2/rmd0/3  old"), "{}", all[3].text(12));
    }

    #[test]
    fn drives_with_a_fault_or_old_values_stand_out() {
        let all = rows(&drives(), 10.0, Sort::Name, Only::All, "");
        assert_eq!(all.iter().map(Row::is_bad).collect::<Vec<_>>(), [false, true, true, true]);
    }
}
