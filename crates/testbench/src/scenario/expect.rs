//! Expectations of a run, and their check.

use motorlink_link::printable;
use serde::Deserialize;

use crate::signals::{Kind, Signal, find_signal, short};

/// An expectation as the file has it.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Written {
    why: String,
    signal: String,
    at: Option<f64>,
    between: Option<[f64; 2]>,
    #[serde(default)]
    of: Of,
    min: Option<f64>,
    max: Option<f64>,
    value: Option<f64>,
    within: Option<f64>,
    is: Option<String>,
}

/// What is compared.
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Of {
    /// Every sample.
    #[default]
    Every,
    /// One sample at least.
    Some,
    /// The mean of the samples.
    Mean,
    /// The greatest less the least sample.
    Swing,
    /// The change from sample to sample, a second.
    Slope,
}

/// The expected values.
#[derive(Debug, Clone, PartialEq)]
enum Bounds {
    Range { min: f64, max: f64 },
    Is(String),
}

/// An expectation that can be checked.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Expectation {
    why: String,
    /// Place in the list of signals.
    signal: usize,
    /// The first and last sample.
    samples: [usize; 2],
    of: Of,
    bounds: Bounds,
}

/// Result of an expectation.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Verdict {
    /// Text of the expectation.
    pub why: String,
    /// The signal.
    pub signal: String,
    /// Whether it holds.
    pub holds: bool,
    /// What was measured, when, and what was expected.
    pub found: String,
}

impl Written {
    /// Finds the signal and the samples, of which there are `count`, `step` s apart.
    pub(super) fn resolve(
        self,
        signals: &[Signal],
        step: f64,
        count: usize,
    ) -> Result<Expectation, String> {
        let signal = find_signal(&self.signal, signals)?;
        let named = matches!(signals[signal].kind, Kind::Named(_));
        let bounds = match (self.min, self.max, self.value, self.within, self.is) {
            (None, None, None, None, Some(name)) if named => Bounds::Is(printable(&name)),
            (None, None, None, None, Some(_)) => {
                return Err(format!("{} has numbers: use min and max", self.signal));
            }
            (None, None, Some(value), Some(within), None) => {
                Bounds::Range { min: value - within, max: value + within }
            }
            (min, max, None, None, None) if min.or(max).is_some() => Bounds::Range {
                min: min.unwrap_or(f64::NEG_INFINITY),
                max: max.unwrap_or(f64::INFINITY),
            },
            _ => return Err("say `min` or `max`, or `value` and `within`, or `is`".to_owned()),
        };
        match bounds {
            Bounds::Range { .. } if named => {
                return Err(format!("{} has names: use `is`", self.signal));
            }
            Bounds::Range { min, max } if (min..=max).is_empty() => {
                return Err(format!("the range {min} to {max} is empty"));
            }
            Bounds::Is(_) if !matches!(self.of, Of::Every | Of::Some) => {
                return Err("`is` goes with `of` every or some".to_owned());
            }
            _ => {}
        }
        let last = count - 1;
        let end = last as f64 * step;
        let inside = |moment: f64| {
            if (0.0..=end + step / 2.0).contains(&moment) {
                return Ok(moment / step);
            }
            Err(format!("{moment} s is not within the run, which lasts from 0 to {end} s"))
        };
        // Tolerance for rounded decimals, in samples.
        const SLACK: f64 = 1e-6;
        let samples = match (self.at, self.between) {
            (None, None) => [0, last],
            (Some(at), None) => [inside(at)?.round() as usize; 2],
            (None, Some([from, to])) => {
                let from = (inside(from)? - SLACK).ceil() as usize;
                [from, (inside(to)? + SLACK).floor() as usize]
            }
            (Some(_), Some(_)) => return Err("say `at` or `between`, not both".to_owned()),
        };
        let [first, last] = samples.map(|n| n.min(last));
        let fewest = if self.of == Of::Slope { 2 } else { 1 };
        if (last + 1).saturating_sub(first) < fewest {
            return Err("the span has too few samples".to_owned());
        }
        let why = printable(&self.why);
        Ok(Expectation { why, signal, samples: [first, last], of: self.of, bounds })
    }
}

impl Expectation {
    /// Looks at the columns of a run with samples `step` s apart.
    pub(super) fn check(&self, signals: &[Signal], columns: &[Vec<f64>], step: f64) -> Verdict {
        let signal = &signals[self.signal];
        let [first, last] = self.samples;
        let samples = &columns[self.signal][first..=last];
        let at = |n: usize| (first + n) as f64 * step;
        let (holds, found) = match &self.bounds {
            Bounds::Is(name) => self.named(name, signal, samples, at),
            &Bounds::Range { min, max } => self.numbers([min, max], signal, samples, at, step),
        };
        Verdict { why: self.why.clone(), signal: signal.name.clone(), holds, found }
    }

    fn named(
        &self,
        name: &str,
        signal: &Signal,
        samples: &[f64],
        at: impl Fn(usize) -> f64,
    ) -> (bool, String) {
        let is = |value: &f64| signal.kind.show(*value).eq_ignore_ascii_case(name);
        let shown = |n: usize| format!("{} at {} s", signal.kind.show(samples[n]), short(at(n)));
        let hit = samples.iter().position(is);
        match (self.of, hit, samples.iter().position(|value| !is(value))) {
            (Of::Some, Some(n), _) => (true, shown(n)),
            (Of::Some, None, _) => (false, format!("never {name}; {}", shown(samples.len() - 1))),
            (_, _, None) => (true, format!("{name} throughout")),
            (_, _, Some(n)) => (false, format!("{}, not {name}", shown(n))),
        }
    }

    fn numbers(
        &self,
        [min, max]: [f64; 2],
        signal: &Signal,
        samples: &[f64],
        at: impl Fn(usize) -> f64,
        step: f64,
    ) -> (bool, String) {
        let unit = signal.kind.unit();
        // How far a value is outside; infinite for NaN.
        let outside = |value: f64| match value {
            value if value < min => min - value,
            value if value <= max => 0.0,
            value if value.is_nan() => f64::INFINITY,
            value => value - max,
        };
        let worst = |values: &mut dyn Iterator<Item = f64>| {
            let all = values.enumerate().map(|(n, value)| (n, value, outside(value)));
            all.reduce(|worst, next| if next.2 > worst.2 { next } else { worst })
        };
        let slopes = || samples.windows(2).map(|pair| (pair[1] - pair[0]) / step);
        let (values, moment, unit) = match self.of {
            Of::Every => (worst(&mut samples.iter().copied()), true, unit.to_owned()),
            Of::Slope => (worst(&mut slopes()), true, per_second(unit)),
            Of::Some => {
                let all = samples.iter().map(|value| (*value, outside(*value))).enumerate();
                let best = all.reduce(|best, next| if next.1.1 < best.1.1 { next } else { best });
                (best.map(|(n, (value, miss))| (n, value, miss)), true, unit.to_owned())
            }
            Of::Mean => {
                let mean = samples.iter().sum::<f64>() / samples.len() as f64;
                (worst(&mut std::iter::once(mean)), false, unit.to_owned())
            }
            Of::Swing => {
                // Unlike min and max, these keep NaN.
                let least = samples.iter().copied().reduce(|a, b| if a < b { a } else { b });
                let most = samples.iter().copied().reduce(|a, b| if a > b { a } else { b });
                let swing = most.zip(least).map(|(most, least)| most - least);
                (worst(&mut swing.into_iter()), false, unit.to_owned())
            }
        };
        let Some((n, value, miss)) = values else { return (false, "no sample".to_owned()) };
        let bounds = match (min.is_finite(), max.is_finite()) {
            (true, true) => format!("{} to {} {unit}", short(min), short(max)),
            (true, false) => format!("at least {} {unit}", short(min)),
            _ => format!("at most {} {unit}", short(max)),
        };
        if miss == 0.0 {
            let found = match (self.of, moment) {
                (Of::Some, _) => format!("{} {unit} at {} s", short(value), short(at(n))),
                (_, false) => format!("{} {unit}", short(value)),
                (Of::Slope, _) => extremes(&mut slopes(), &unit),
                _ => extremes(&mut samples.iter().copied(), &unit),
            };
            return (true, found);
        }
        let moment = if moment { format!(" at {} s", short(at(n))) } else { String::new() };
        let miss = short(miss);
        (false, format!("{} {unit}{moment}, expected {bounds}: off by {miss} {unit}", short(value)))
    }
}

/// The least and the greatest of some values.
fn extremes(values: &mut dyn Iterator<Item = f64>, unit: &str) -> String {
    let none = (f64::INFINITY, f64::NEG_INFINITY);
    let (least, most) = values.fold(none, |(least, most), v| (v.min(least), v.max(most)));
    match (short(least), short(most)) {
        (least, most) if least == most => format!("{least} {unit} throughout"),
        (least, most) => format!("{least} to {most} {unit}"),
    }
}

fn per_second(unit: &str) -> String {
    match unit.strip_suffix("/s") {
        Some(unit) => format!("{unit}/s²"),
        None => format!("{unit}/s"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::Names;

    const STEP: f64 = 0.1;

    /// Checks an expectation of a ramp from 0 to 10 rpm in a second, or of a status that goes from
    /// IDLE to RUN in the middle.
    fn check(text: &str) -> Result<Verdict, String> {
        let signals = [
            Signal {
                name: "st1.speed_rpm".to_owned(),
                kind: Kind::Number { quantity: "Speed", unit: "rpm" },
            },
            Signal { name: "st1.status".to_owned(), kind: Kind::Named(Names::Status) },
        ];
        let ramp: Vec<f64> = (0..=10).map(f64::from).collect();
        let status = (0..=10).map(|n| if n >= 5 { 6.0 } else { 0.0 }).collect();
        let written: Written =
            toml::from_str(&format!("why = \"\"\n{text}")).map_err(|error| error.to_string())?;
        let expectation = written.resolve(&signals, STEP, ramp.len())?;
        Ok(expectation.check(&signals, &[ramp, status], STEP))
    }

    #[track_caller]
    fn holds(text: &str, holds: bool, found: &str) {
        let verdict = check(&text.replace("speed", "signal = \"st1.speed_rpm\"\n")).unwrap();
        assert_eq!((verdict.holds, verdict.found.as_str()), (holds, found));
    }

    #[test]
    fn numbers_are_compared_and_the_worst_is_reported() {
        holds("speed between = [0.3, 0.5]\nmin = 3\nmax = 6", true, "3 to 5 rpm");
        let found = "6 rpm at 0.6 s, expected 3 to 5 rpm: off by 1 rpm";
        holds("speed between = [0.3, 0.6]\nmin = 3\nmax = 5", false, found);
        holds("speed at = 0.72\nvalue = 7.5\nwithin = 0.5", true, "7 rpm throughout");
        holds("speed max = 9", false, "10 rpm at 1 s, expected at most 9 rpm: off by 1 rpm");
        holds("speed of = \"some\"\nmin = 4\nmax = 5", true, "4 rpm at 0.4 s");
        let found = "10 rpm at 1 s, expected at least 20 rpm: off by 10 rpm";
        holds("speed of = \"some\"\nmin = 20", false, found);
        holds("speed of = \"mean\"\nvalue = 5\nwithin = 0", true, "5 rpm");
        holds(
            "speed of = \"mean\"\nmin = 6",
            false,
            "5 rpm, expected at least 6 rpm: off by 1 rpm",
        );
        holds("speed of = \"swing\"\nmin = 10", true, "10 rpm");
        holds("speed of = \"slope\"\nmin = 9.99", true, "10 rpm/s throughout");
        let found = "10 rpm/s at 0 s, expected at most 5 rpm/s: off by 5 rpm/s";
        holds("speed of = \"slope\"\nmax = 5", false, found);
    }

    #[test]
    fn a_slope_has_its_own_unit() {
        assert_eq!([per_second("rpm"), per_second("°/s")], ["rpm/s", "°/s²"]);
    }

    #[test]
    fn names_are_compared() {
        let status = |text: &str| check(&format!("signal = \"st1.status\"\n{text}")).unwrap();
        assert!(status("between = [0.5, 1]\nis = \"RUN\"").holds);
        let verdict = status("is = \"IDLE\"");
        assert_eq!((verdict.holds, verdict.found.as_str()), (false, "RUN at 0.5 s, not IDLE"));
        assert!(status("of = \"some\"\nis = \"run\"").holds);
        let verdict = status("of = \"some\"\nbetween = [0, 0.4]\nis = \"RUN\"");
        assert_eq!((verdict.holds, verdict.found.as_str()), (false, "never RUN; IDLE at 0.4 s"));
    }

    #[test]
    fn nan_never_meets_an_expectation() {
        let signals = [Signal {
            name: "st1.speed_rpm".to_owned(),
            kind: Kind::Number { quantity: "Speed", unit: "rpm" },
        }];
        for of in ["every", "some", "mean", "swing", "slope"] {
            let text = format!("why = \"\"\nsignal = \"st1.speed_rpm\"\nof = \"{of}\"\nmax = 1e9");
            let written: Written = toml::from_str(&text).unwrap();
            let expectation = written.resolve(&signals, STEP, 3).unwrap();
            let verdict = expectation.check(&signals, &[vec![f64::NAN; 3]], STEP);
            assert!(!verdict.holds, "{of}: {}", verdict.found);
        }
    }

    #[test]
    fn invalid_expectations_are_refused() {
        let why = |text: &str| {
            let text = text.replace("speed", "signal = \"st1.speed_rpm\"\n");
            check(&text.replace("status", "signal = \"st1.status\"\n")).unwrap_err()
        };
        assert!(why("signal = \"st1.sped_rpm\"\nmin = 3").contains("st1.speed_rpm"));
        assert!(why("speed at = 1.2\nmin = 3").contains("within the run"));
        assert!(why("speed at = nan\nmin = 3").contains("within the run"));
        assert!(why("speed between = [0.5, 0.4]\nmin = 3").contains("samples"));
        assert!(why("speed at = 0.5\nof = \"slope\"\nmin = 3").contains("samples"));
        assert!(why("speed between = [0.1, 0.4]\nat = 0.2\nmin = 3").contains("not both"));
        assert!(why("speed min = 3\nvalue = 4\nwithin = 1").contains("`within`"));
        assert!(why("speed value = 4").contains("`within`"));
        assert!(why("speed min = 3\nmax = 2").contains("is empty"));
        assert!(why("speed max = nan").contains("is empty"));
        assert!(why("speed value = 4\nwithin = -1").contains("is empty"));
        assert!(why("speed is = \"RUN\"").contains("numbers"));
        assert!(why("status min = 1").contains("names"));
        assert!(why("status of = \"mean\"\nis = \"RUN\"").contains("every or some"));
        assert!(why("speed min = 3\nmost = 2").contains("most"));
    }
}
