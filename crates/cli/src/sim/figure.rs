//! A scenario as a picture.

use motorlink_testbench::scenario::{Kind, Panel, Run, Scenario, Signal};

use crate::palette::Meaning;
use crate::plot::{self, Figure, Samples, Times, state};

/// The panels of a scenario.
pub fn figure<'a>(scenario: &Scenario, run: &'a Run) -> Figure<'a> {
    let end = scenario.duration.0 as f64 / 1e6;
    let signals = run.signals.iter().zip(&run.columns).map(|(signal, column)| plot::Signal {
        name: signal.name.clone(),
        meaning: quantity(signal),
        samples: Samples { values: column, times: Times::Even, end },
        states: matches!(signal.kind, Kind::Named(_)).then(|| {
            let states = move |value| {
                let name = signal.kind.show(value);
                let meaning = state(signal.kind, &name);
                (name, meaning)
            };
            Box::new(states) as plot::States<'a>
        }),
    });
    let panels = scenario.panels.iter().map(|panel| plot::Panel {
        title: title(panel, run),
        signals: panel.signals.clone(),
        range: panel.range,
    });
    Figure {
        title: scenario.title.clone(),
        end,
        marks: run.marks.clone(),
        unnamed: Vec::new(),
        signals: signals.collect(),
        panels: panels.collect(),
    }
}

fn title(panel: &Panel, run: &Run) -> String {
    match (run.signals[panel.signals[0]].kind, &panel.title) {
        (Kind::Number { unit, .. }, Some(title)) => format!("{title} ({unit})"),
        (Kind::Number { quantity, unit }, None) => format!("{quantity} ({unit})"),
        (Kind::Named(_), title) => title.clone().unwrap_or_default(),
    }
}

/// The first part of a signal's quantity that is found says its meaning.
const QUANTITIES: &[(&str, Meaning)] = &[
    ("reference", Meaning::Reference),
    ("command", Meaning::Reference),
    ("phase_a", Meaning::PhaseA),
    ("phase_b", Meaning::PhaseB),
    ("phase_c", Meaning::PhaseC),
    ("celsius", Meaning::Temperature),
    ("loss", Meaning::Loss),
    ("speed", Meaning::Speed),
    ("degrees", Meaning::Position),
    ("iq_", Meaning::QAxis),
    ("vq_", Meaning::QAxis),
    ("id_", Meaning::DAxis),
    ("vd_", Meaning::DAxis),
    ("load", Meaning::Load),
    ("torque", Meaning::Torque),
    ("bus", Meaning::Supply),
    ("supply", Meaning::Supply),
];

/// What the line of a signal means.
fn quantity(signal: &Signal) -> Meaning {
    let name = signal.name.split_once('.').map_or(&*signal.name, |(_, name)| name);
    let known = QUANTITIES.iter().find(|(part, _)| name.contains(part));
    known.map_or(Meaning::Text, |(_, meaning)| *meaning)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use motorlink_testbench::scenario::Scenario;

    use super::*;

    #[test]
    fn every_signal_has_a_meaning_and_references_are_one() {
        let text = "title = \"\"\nduration = 0.001\n[[st.motor]]\n[[rmd.motor]]";
        let run = Scenario::parse(text, Path::new("")).unwrap().run().unwrap();
        for signal in &run.signals {
            let meaning = quantity(signal);
            if matches!(signal.kind, Kind::Number { .. }) {
                assert_ne!(meaning, Meaning::Text, "{}", signal.name);
            }
            assert_eq!(
                signal.name.contains("reference") || signal.name.contains("command"),
                meaning == Meaning::Reference,
                "{}",
                signal.name
            );
        }
    }
}
