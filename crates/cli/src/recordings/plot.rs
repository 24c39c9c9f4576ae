//! `motorlink plot`: signals of a recording as a picture.

use std::ops::RangeInclusive;
use std::path::PathBuf;

use motorlink_link::printable;
use motorlink_recording::read::{Table, Tables};
use motorlink_recording::schema::Time;
use motorlink_testbench::scenario::Mark;

use super::input::Input;
use super::look::{meaning, quantity, states};
use super::pick::Pick;
use crate::failure::Failure;
use crate::output::{Printer, note};
use crate::palette::Meaning;
use crate::plot::{self, Figure, Panel, Samples, Signal, Times};
use crate::text::counted;

/// Events that are named in a picture. More would fill it.
const MOST_NAMED: usize = 24;
/// Characters of an event's name.
const LONGEST_NAME: usize = 40;
/// Lines of one colour in a panel. They differ in their dashes.
const MOST_DASHES: usize = 4;
/// Lines of a panel.
const MOST_LINES: usize = 8;
/// Signals of a picture.
const MOST_SIGNALS: usize = 60;
/// Samples are missing where two are further apart than this many intervals.
const GAP: f64 = 3.0;

#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    input: Input,
    #[command(flatten)]
    pick: Pick,
    /// The picture: .svg or .png; `-` is stdout, in SVG
    #[arg(short, long, value_name = "FILE", value_hint = clap::ValueHint::FilePath)]
    output: PathBuf,
    /// Begin at this time, s since the first sample
    #[arg(long, value_name = "SECONDS", default_value_t = 0.0)]
    from: f64,
    /// End at this time, s since the first sample [default: the end]
    #[arg(long, value_name = "SECONDS")]
    to: Option<f64>,
    /// The title [default: name and beginning of the recording]
    #[arg(long)]
    title: Option<String>,
    /// Replace the picture if it exists
    #[arg(long)]
    force: bool,
    /// Print one line of JSON instead of text
    #[arg(long)]
    json: bool,
}

pub fn run(args: &Args) -> Result<(), Failure> {
    plot::check_format("plot", &args.output)?;
    let output = args.input.output("--output", &args.output, args.force, args.json)?;
    let read = args.input.tables(&args.pick)?;
    let view = View::new(&read, args)?;
    let figure = view.figure(&read, args);
    let picture = plot::draw(&figure, &args.output).map_err(Failure::link)?;
    output.write(|file| file.write_all(&picture))?;
    let signals = figure.signals.len() as u64;
    let (printer, to) = (Printer { json: args.json }, (&output, args.output.as_path()));
    args.input.written(printer, to, &counted(signals, "signal"), ("signals", signals))
}

/// The part of a recording that is drawn. Time 0 is the first sample of the recording.
struct View {
    /// ns since 1970.
    zero: u64,
    /// s.
    shown: RangeInclusive<f64>,
    has_motors: bool,
    /// Times of the rows of each table within the view, s since its beginning, and their places.
    rows: Vec<(Vec<f64>, std::ops::Range<usize>)>,
}

impl View {
    fn new(read: &Tables, args: &Args) -> Result<Self, Failure> {
        let lasts = read.tables.iter().filter_map(|table| table.times.last());
        let (Some(zero), Some(&last)) = (read.first, lasts.max()) else {
            return Err(Failure::usage(format!("{} has no samples", args.input.name())));
        };
        let count: usize = read.tables.iter().map(|table| table.fields.len()).sum();
        if count > MOST_SIGNALS {
            let failure =
                format!("{count} signals are too many for a picture: at most {MOST_SIGNALS}");
            return Err(Failure::usage(failure).trying("choose some with --signals"));
        }
        let end = args.to.unwrap_or(f64::INFINITY).min((last - zero) as f64 / 1e9);
        if args.from.is_nan() || args.from > end {
            return Err(Failure::usage(match args.to {
                Some(to) if to < args.from => format!("--to {to} is before --from {}", args.from),
                _ => format!("no sample is after {} s: the last one is at {end} s", args.from),
            }));
        }
        let shown = args.from..=end;
        let mut motors: Vec<&str> = read.tables.iter().map(Table::motor).collect();
        motors.dedup();
        let since = |time: u64| (time - zero) as f64 / 1e9;
        let rows = read.tables.iter().map(|table| {
            let from = table.times.partition_point(|time| since(*time) < *shown.start());
            let to = table.times.partition_point(|time| since(*time) <= *shown.end());
            let times = table.times[from..to].iter().map(|time| since(*time) - shown.start());
            (times.collect(), from..to)
        });
        let rows = rows.collect();
        Ok(View { zero, shown, has_motors: motors.len() > 1, rows })
    }

    fn figure<'a>(&'a self, read: &'a Tables, args: &Args) -> Figure<'a> {
        // A single sample has a place, too.
        let end = (self.shown.end() - self.shown.start()).max(1e-3);
        let mut signals = Vec::new();
        let mut units = Vec::new();
        for (table, (times, rows)) in read.tables.iter().zip(&self.rows) {
            let gap = GAP * interval(times);
            for (field, column) in table.fields.iter().zip(&table.columns) {
                let name = match self.has_motors {
                    true => printable(&format!("{}/{}", table.motor(), field.signal)),
                    false => printable(&field.signal),
                };
                let samples =
                    Samples { values: &column[rows.clone()], times: Times::At { times, gap }, end };
                let (meaning, states) = (meaning(&field.signal), states(&field.signal));
                signals.push(Signal { name, meaning, samples, states });
                units.push(printable(&field.unit));
            }
        }
        let panels = panels(&signals, &units);
        let (marks, unnamed) = self.marks(read);
        let title = args.title.clone().unwrap_or_else(|| {
            let began = self.zero + (self.shown.start() * 1e9) as u64;
            let name = args.input.file.file_name().unwrap_or_default();
            format!("{}, {}", name.to_string_lossy(), Time(began).text())
        });
        Figure { title: printable(&title), end, marks, unnamed, signals, panels }
    }

    /// Events of the motors that are drawn: those that are named, and moments of the others.
    fn marks(&self, read: &Tables) -> (Vec<Mark>, Vec<f64>) {
        let is_drawn = |name: &str| {
            read.tables.iter().any(|table| {
                let motor = table.motor();
                motor == name || motor.strip_prefix(name).is_some_and(|rest| rest.starts_with('/'))
            })
        };
        let events = read.events.iter().filter(|event| is_drawn(&event.name));
        let marks = events.filter_map(|event| {
            let at = (event.stamp.0 as f64 - self.zero as f64) / 1e9;
            let name = if self.has_motors { &*format!(" {}", event.name) } else { "" };
            let label = printable(&format!("{}{name}", event.kind));
            let label = label.chars().take(LONGEST_NAME).collect();
            self.shown.contains(&at).then(|| Mark { at: at - self.shown.start(), label })
        });
        let mut marks: Vec<Mark> = marks.collect();
        let rest = marks.split_off(marks.len().min(MOST_NAMED));
        if !rest.is_empty() {
            note(format!(
                "the picture names the first {MOST_NAMED} events of {}",
                marks.len() + rest.len()
            ));
        }
        (marks, rest.into_iter().map(|mark| mark.at).collect())
    }
}

/// The usual time between two samples.
fn interval(times: &[f64]) -> f64 {
    let mut intervals: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    if intervals.is_empty() {
        return f64::INFINITY;
    }
    let middle = intervals.len() / 2;
    *intervals.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// A panel for each unit, more if it has many signals; at the end one for states.
fn panels(signals: &[Signal<'_>], units: &[String]) -> Vec<Panel> {
    let mut panels: Vec<(&str, Panel)> = Vec::new();
    let mut states = Vec::new();
    for (n, signal) in signals.iter().enumerate() {
        if signal.states.is_some() {
            states.push(n);
            continue;
        }
        let is_same = |meaning: Meaning| move |&&n: &&usize| signals[n].meaning == meaning;
        let has_room = |panel: &Panel| {
            let same = panel.signals.iter().filter(is_same(signal.meaning)).count();
            same < MOST_DASHES && panel.signals.len() < MOST_LINES
        };
        let unit = &*units[n];
        match panels.iter_mut().find(|(of, panel)| *of == unit && has_room(panel)) {
            Some((_, panel)) => panel.signals.push(n),
            None => {
                let title = match (quantity(unit), unit) {
                    (_, "") => "Without a unit".to_owned(),
                    (Some(quantity), unit) => format!("{quantity} ({unit})"),
                    (None, unit) => unit.to_owned(),
                };
                panels.push((unit, Panel { title, signals: vec![n], range: None }));
            }
        }
    }
    let mut panels: Vec<Panel> = panels.into_iter().map(|(_, panel)| panel).collect();
    if !states.is_empty() {
        panels.push(Panel { title: "States".to_owned(), signals: states, range: None });
    }
    panels
}

#[cfg(test)]
mod tests {
    use super::*;

    fn signal(name: &str) -> Signal<'static> {
        let samples = Samples { values: &[], times: Times::Even, end: 1.0 };
        Signal { name: name.to_owned(), meaning: meaning(name), samples, states: states(name) }
    }

    #[test]
    fn signals_of_one_unit_share_an_axis_as_long_as_they_can_be_told_apart() {
        let names = ["SPEED_MEAS", "BUS_VOLTAGE", "SPEED_REF", "STATUS", "I_Q"];
        let signals: Vec<_> = names.into_iter().map(signal).collect();
        let units = ["rpm", "V", "rpm", "", "s16A"].map(str::to_owned);
        let panels = panels(&signals, &units);
        let shown: Vec<(&str, &[usize])> =
            panels.iter().map(|panel| (&*panel.title, &*panel.signals)).collect();
        let expected: [(&str, &[usize]); 4] = [
            ("Speed (rpm)", &[0, 2]),
            ("Voltage (V)", &[1]),
            ("Current (s16A)", &[4]),
            ("States", &[3]),
        ];
        assert_eq!(shown, expected);
        let many: Vec<_> = (0..9).map(|_| signal("speed")).collect();
        let counts: Vec<usize> = self::panels(&many, &vec!["°/s".to_owned(); 9])
            .iter()
            .map(|panel| panel.signals.len())
            .collect();
        assert_eq!(counts, [4, 4, 1]);
    }

    #[test]
    fn the_usual_interval_ignores_outages() {
        assert_eq!(interval(&[0.0, 1.0, 2.0, 50.0, 51.0]), 1.0);
        assert_eq!(interval(&[3.0]), f64::INFINITY);
    }
}
