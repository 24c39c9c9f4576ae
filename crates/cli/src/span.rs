//! Time spans on the command line: a number with its unit, such as `100ms` or `0.5s`.

use std::time::Duration;

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
    move |text| match Duration::try_from_secs_f64(seconds(text)?) {
        Ok(span) if (SHORTEST..=longest).contains(&span) => Ok(span),
        _ => Err(format!("it must be 1ms to {}s", longest.as_secs())),
    }
}

/// Reads a distance: a number that is not negative.
pub fn parse_distance(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(distance) if distance.is_finite() && distance >= 0.0 => Ok(distance),
        _ => Err("give a number, 0 or more".to_owned()),
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
    fn a_number_without_a_unit_is_refused_with_both_spellings() {
        for number in ["100", "0", "-1", "0.5"] {
            let refused = parse_span(number).unwrap_err();
            assert_eq!(refused, format!("the unit is missing: write {number}ms or {number}s"));
        }
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
