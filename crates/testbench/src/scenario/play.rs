//! A scenario, and playing it.

use std::path::PathBuf;

use motorlink_proto::time::Micros;

use super::expect::Expectation;
use super::run::{Played, Run};
use super::script::Script;
use crate::config::ConfigError;
use crate::signals::Signal;

/// A scenario that can be played.
#[derive(Debug, Clone, PartialEq)]
pub struct Scenario {
    /// Title, for the report and the plot.
    pub title: String,
    /// Description, for readers.
    pub about: Option<String>,
    /// Length of the run, a whole number of samples.
    pub duration: Micros,
    /// The interval between samples.
    pub sample: Micros,
    /// The load profiles that were read.
    pub files: Vec<PathBuf>,
    /// Panels of the plot, from top to bottom.
    pub panels: Vec<Panel>,
    pub(super) script: Script,
    pub(super) signals: Vec<Signal>,
    pub(super) expectations: Vec<Expectation>,
}

/// A part of the plot.
#[derive(Debug, Clone, PartialEq)]
pub struct Panel {
    /// Its title.
    pub title: Option<String>,
    /// Places of its signals in [`Run::signals`]; all have the same unit, or all have names.
    pub signals: Vec<usize>,
    /// Range of the axis; by default that of the samples.
    pub range: Option<[f64; 2]>,
}

impl Scenario {
    /// Plays it from power-on to its end.
    ///
    /// # Errors
    /// Impossible drives; never those of a scenario that was read.
    pub fn run(&self) -> Result<Run, ConfigError> {
        let Played { columns, marks, refusals, state_hash } =
            self.script.play(self.duration, self.sample)?;
        let step = self.sample.0 as f64 / 1e6;
        let check = |expectation: &Expectation| expectation.check(&self.signals, &columns, step);
        Ok(Run {
            verdicts: self.expectations.iter().map(check).collect(),
            signals: self.signals.clone(),
            columns,
            sample: self.sample,
            marks,
            refusals,
            state_hash,
        })
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::scenario::Mark;

    fn run(text: &str) -> Run {
        let text = format!("title = \"\"\nduration = 1.0\n{text}");
        Scenario::parse(&text, Path::new("")).unwrap().run().unwrap()
    }

    fn column<'r>(run: &'r Run, name: &str) -> &'r [f64] {
        let place = run.signals.iter().position(|signal| signal.name == name).unwrap();
        &run.columns[place]
    }

    const SPEED: &str = "
        [[rmd.motor]]
        [[event]]
        at = 0.2
        rmd = 1
        send = \"speed\"
        speed_dps = 90
    ";

    #[test]
    fn a_sample_is_the_state_before_the_events_of_its_moment() {
        let text = format!("{SPEED}\n[[event]]\nat = 1\nrmd = 1\nsend = \"off\"");
        let run = run(&text);
        let mode = column(&run, "rmd1.mode");
        assert_eq!((mode.len(), mode[200], mode[201], mode[1000]), (1001, 0.0, 3.0, 3.0));
        assert!(column(&run, "rmd1.speed_dps")[1000] > 45.0);
        assert_eq!(run.marks[1], Mark { at: 1.0, label: "off".to_owned() });
        assert!(run.as_expected());
    }

    #[test]
    fn runs_are_repeatable_and_do_not_depend_on_the_sample_time() {
        let one = run(SPEED);
        assert_eq!(one, run(SPEED));
        let fine = run(&format!("sample_us = 50\n{SPEED}"));
        assert_eq!(fine.state_hash, one.state_hash);
        let every: Vec<f64> = column(&fine, "rmd1.speed_dps").iter().copied().step_by(20).collect();
        assert_eq!(every, column(&one, "rmd1.speed_dps"));
        assert_ne!(
            run(&SPEED.replace("speed_dps = 90", "speed_dps = 91")).state_hash,
            one.state_hash
        );
    }

    #[test]
    fn unannounced_refusals_and_missing_refusals_fail_the_run() {
        let set =
            "[[st.motor]]\n[[event]]\nat = 0.5\nst = 1\nsend = \"set\"\nvalue = 3\nregister = ";
        let refused = run(&format!("{set}\"SPEED_MEAS\""));
        assert_eq!(refused.refusals.len(), 1);
        let told = "at 0.5 s st1 refused `SPEED_MEAS 3` with SET_READ_ONLY";
        assert_eq!(refused.refusals[0].to_string(), told);
        assert!(!refused.as_expected());
        assert!(run(&format!("{set}\"SPEED_MEAS\"\nrefused = \"SET_READ_ONLY\"")).as_expected());
        assert!(!run(&format!("{set}\"SPEED_MEAS\"\nrefused = \"WRONG_SET\"")).as_expected());
        let taken = run(&format!("{set}\"SPEED_KP\"\nrefused = \"SET_READ_ONLY\""));
        assert!(taken.refusals[0].to_string().starts_with("at 0.5 s st1 accepted `SPEED_KP 3`"));
    }

    #[test]
    fn a_remaining_error_is_a_refusal_of_clear_errors() {
        let text = "
            [[rmd.motor]]
            [[event]]
            at = 0.1
            rmd = 1
            world = \"temperature\"
            celsius = 150
            [[event]]
            at = 0.5
            rmd = 1
            send = \"clear-errors\"
        ";
        assert_eq!(run(text).refusals[0].reply.as_deref(), Some("errors"));
        assert!(run(&format!("{text}\nrefused = \"errors\"")).as_expected());
    }

    #[test]
    fn a_load_profile_sets_the_load() {
        let folder = std::env::temp_dir().join(format!("motorlink-load-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        std::fs::write(folder.join("load.csv"), "t_s,newton_metres\n0,0\n1,0.1\n").unwrap();
        let text = "
            title = \"\"
            duration = 1
            [[rmd.motor]]
            [[load_profile]]
            rmd = 1
            file = \"load.csv\"
            [[event]]
            at = 0
            rmd = 1
            send = \"speed\"
            speed_dps = 720
        ";
        let run = Scenario::parse(text, &folder).unwrap().run().unwrap();
        let load = column(&run, "rmd1.load_newton_metres");
        for (row, torque) in [(0, 0.0), (500, 0.05), (1000, 0.1)] {
            assert!((load[row].abs() - torque).abs() < 1e-6, "{} Nm in row {row}", load[row]);
        }

        let event = "\n[[event]]\nat = 0\nrmd = 1\nworld = \"load\"\nnewton_metres = 1";
        let why = Scenario::parse(&format!("{text}{event}"), &folder).unwrap_err();
        assert!(why.contains("load_profile"), "{why}");
        let twice = "\n[[load_profile]]\nrmd = 1\nfile = \"load.csv\"";
        let why = Scenario::parse(&format!("{text}{twice}"), &folder).unwrap_err();
        assert!(why.contains("two load_profiles"), "{why}");
        std::fs::write(folder.join("load.csv"), "t_s,newton_metres\n0,1e9\n").unwrap();
        let why = Scenario::parse(text, &folder).unwrap_err();
        assert!(why.contains("load.csv") && why.contains("newton_metres is"), "{why}");
        std::fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn a_positive_load_opposes_forward_motion() {
        let turned = |text: &str| {
            let run = run(text);
            let load = column(&run, "rmd1.load_newton_metres");
            (load[1], column(&run, "rmd1.angle_degrees")[1000])
        };
        let push = "[[event]]\nat = 0\nrmd = 1\nworld = \"push\"\nnewton_metres = 0.125";
        let (pushed, angle) = turned(&format!("[[rmd.motor]]\n{push}"));
        assert!(pushed == -0.125 && angle > 0.0, "{pushed} Nm, {angle}°");
        let (load, angle) = turned("[[rmd.motor]]\nplant.load.torque = 0.125");
        assert!(load == 0.125 && angle < 0.0, "{load} Nm, {angle}°");
    }

    #[test]
    fn csv_values_have_enough_digits_to_be_read_back_exactly() {
        let run = run(SPEED);
        let mut csv = Vec::new();
        run.write_csv(&mut csv).unwrap();
        let text = String::from_utf8(csv).unwrap();
        let mut lines = text.lines();
        assert!(lines.next().unwrap().starts_with("time_s,rmd1.speed_dps,"));
        for (row, (line, time)) in lines.zip(run.times()).enumerate() {
            let values: Vec<f64> = line
                .split(',')
                .map(|digits| digits.parse::<f32>().map_or(f64::NAN, f64::from))
                .collect();
            assert!((values[0] - time).abs() < 1e-6);
            assert_eq!(values[1], column(&run, "rmd1.speed_dps")[row]);
        }
        assert_eq!(text.lines().count(), 1002);
    }
}
