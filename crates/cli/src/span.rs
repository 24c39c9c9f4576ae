//! Time spans on the command line: a number with its unit, such as `100ms` or `0.5s`; times of day.

use std::time::{Duration, SystemTime};

const SHORTEST: Duration = Duration::from_millis(1);
const LONGEST: Duration = Duration::from_secs(86_400);

/// Reads a time span of 1ms to 86400s.
pub fn parse_span(text: &str) -> Result<Duration, String> {
    span_up_to(LONGEST)(text)
}

/// Reads time spans of 1ms to `longest`.
pub fn span_up_to(
    longest: Duration,
) -> impl Fn(&str) -> Result<Duration, String> + Clone + Send + Sync + 'static {
    move |text| {
        // A number without a unit is refused for its unit only if a unit would help.
        let is_positive = text.trim().parse::<f64>().map_or(true, |number| number > 0.0);
        let span = match is_positive {
            true => Duration::try_from_secs_f64(seconds(text)?).ok(),
            false => None,
        };
        span.filter(|span| (SHORTEST..=longest).contains(span))
            .ok_or_else(|| format!("it must be 1ms to {}s", longest.as_secs()))
    }
}

/// Reads a duration that may be 0, s.
pub fn parse_duration(text: &str) -> Result<f32, String> {
    match seconds(text)? as f32 {
        seconds if seconds.is_finite() && seconds >= 0.0 => Ok(seconds),
        _ => Err("it must be 0s or more".to_owned()),
    }
}

/// Reads the duration of a ramp in ms: a number of ms, or a number with its unit.
pub fn parse_milliseconds(text: &str) -> Result<u16, String> {
    let ms = text.parse::<f64>().or_else(|_| seconds(text).map(|seconds| seconds * 1e3))?;
    let whole = ms.round();
    match (ms - whole).abs() < 1e-6 && (0.0..=f64::from(u16::MAX)).contains(&whole) {
        true => Ok(whole as u16),
        false => Err(format!("give a whole number of ms, 0 to {} ms", u16::MAX)),
    }
}

/// Reads a distance: a number that is not negative.
pub fn parse_distance(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(distance) if distance.is_finite() && distance >= 0.0 => Ok(distance),
        _ => Err("give a number without a unit, 0 or more".to_owned()),
    }
}

/// Reads a rate in Hz as its period.
pub fn parse_rate(text: &str) -> Result<Duration, String> {
    let hertz: f64 = text.parse().map_err(|_| "give a number of Hz, such as 10".to_owned())?;
    match (0.1..=1000.0).contains(&hertz) {
        true => Ok(Duration::from_secs_f64(1.0 / hertz)),
        false => Err("it must be 0.1 to 1000 Hz".to_owned()),
    }
}

fn seconds(text: &str) -> Result<f64, String> {
    let text = text.trim();
    let (number, scale) = match (text.strip_suffix("ms"), text.strip_suffix('s')) {
        (Some(number), _) => (number, 1e-3),
        (None, Some(number)) => (number, 1.0),
        (None, None) if text.parse::<f64>().is_ok() => {
            return Err(format!("the unit is missing: write {text}ms or {text}s"));
        }
        (None, None) => (text, f64::NAN),
    };
    let number = number.trim().parse::<f64>();
    number
        .map(|number| number * scale)
        .map_err(|_| "write a number and its unit, such as 100ms or 0.5s".to_owned())
}

/// The time of day, UTC.
pub fn utc(time: SystemTime) -> String {
    let seconds = time.duration_since(SystemTime::UNIX_EPOCH).map_or(0, |since| since.as_secs());
    let (hours, minutes) = (seconds / 3600 % 24, seconds / 60 % 60);
    format!("{hours:02}:{minutes:02}:{:02}", seconds % 60)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_span_is_a_number_with_its_unit() {
        assert_eq!(parse_span("100ms"), Ok(Duration::from_millis(100)));
        assert_eq!(parse_span("0.5s"), Ok(Duration::from_millis(500)));
        assert_eq!(parse_span(" 2 s "), Ok(Duration::from_secs(2)));
        for odd in ["soon", "ms", "s", "1e-3 m", "", "100us"] {
            assert!(parse_span(odd).unwrap_err().contains("such as 100ms"), "{odd}");
        }
    }

    #[test]
    fn a_number_without_a_unit_that_cannot_be_a_span_is_refused_for_its_value() {
        for number in ["0", "-1", " 0 ", "NaN"] {
            assert_eq!(parse_span(number).unwrap_err(), "it must be 1ms to 86400s", "{number}");
        }
    }

    #[test]
    fn a_duration_may_be_zero() {
        assert_eq!(parse_duration("0s"), Ok(0.0));
        assert_eq!(parse_duration("1500ms"), Ok(1.5));
        for odd in ["-1s", "1e60s", "NaNs"] {
            assert_eq!(parse_duration(odd).unwrap_err(), "it must be 0s or more", "{odd}");
        }
        assert!(parse_duration("1").unwrap_err().contains("the unit is missing"));
    }

    #[test]
    fn the_duration_of_a_ramp_may_have_a_unit() {
        for (text, ms) in [("1000", 1000), ("0", 0), ("1s", 1000), ("1.5s", 1500), ("20ms", 20)] {
            assert_eq!(parse_milliseconds(text), Ok(ms), "{text}");
        }
        for odd in ["65536", "66s", "-1", "0.5", "0.5ms"] {
            assert!(parse_milliseconds(odd).unwrap_err().contains("whole number"), "{odd}");
        }
        assert!(parse_milliseconds("soon").unwrap_err().contains("such as 100ms"));
    }

    #[test]
    fn a_span_is_within_its_limits() {
        let up_to_a_minute = span_up_to(Duration::from_secs(60));
        assert_eq!(up_to_a_minute("60s"), Ok(Duration::from_secs(60)));
        for odd in ["60.001s", "0ms", "-1s", "1e-9s", "1e19s", "NaNs", "infs"] {
            assert_eq!(up_to_a_minute(odd).unwrap_err(), "it must be 1ms to 60s", "{odd}");
        }
    }
}
