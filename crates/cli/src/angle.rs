//! Angles on the command line: a number with its unit, such as `90deg` or `1.57rad`.

/// Reads an angle, rad.
pub fn parse_angle(text: &str) -> Result<f64, String> {
    let text = text.trim();
    let (number, scale) = match text.strip_suffix("rad") {
        Some(number) => (number, 1.0),
        None => match text.strip_suffix("deg").or_else(|| text.strip_suffix('°')) {
            Some(number) => (number, 1f64.to_radians()),
            None if text.parse::<f64>().is_ok() => {
                return Err(format!("the unit is missing: write {text}deg or {text}rad"));
            }
            None => (text, f64::NAN),
        },
    };
    match number.trim().parse::<f64>().map(|number| number * scale) {
        Ok(angle) if angle.is_finite() => Ok(angle),
        _ => Err("write a number and its unit, such as 90deg or 1.57rad".to_owned()),
    }
}

/// Reads an angle that is not negative, rad.
pub fn parse_tolerance(text: &str) -> Result<f64, String> {
    match parse_angle(text)? {
        angle if angle >= 0.0 => Ok(angle),
        _ => Err("it must be 0 or more".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_angle_is_a_number_with_its_unit() {
        assert_eq!(parse_angle("1.5rad"), Ok(1.5));
        assert_eq!(parse_angle("-0.5 rad"), Ok(-0.5));
        for degrees in ["180deg", "180°", " 180 deg "] {
            assert_eq!(parse_angle(degrees), Ok(std::f64::consts::PI), "{degrees}");
        }
        for odd in ["far", "rad", "deg", "", "90grad", "infrad", "NaNdeg", "1e999rad"] {
            assert!(parse_angle(odd).unwrap_err().contains("such as 90deg"), "{odd}");
        }
    }

    #[test]
    fn a_tolerance_is_not_negative() {
        assert_eq!(parse_tolerance("0rad"), Ok(0.0));
        assert!(parse_tolerance("-1rad").is_err());
    }
}
