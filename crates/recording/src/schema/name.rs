//! Names in a recording: labels of ports, topics, fields and types.

use motorlink_telemetry::label::{distinct, last_part};
use motorlink_telemetry::signal::Motor;

/// The topic of [`JointState`](super::JointState).
pub const JOINT_STATES: &str = "/joint_states";
/// The topic of [`DiagnosticArray`](super::DiagnosticArray).
pub const DIAGNOSTICS: &str = "/diagnostics";
/// The topic of [`Log`](super::Log).
pub const EVENTS: &str = "/events";

/// The last part of the topics of signals.
pub const SIGNALS: &str = "signals";

/// A short name for each port, for topics: the last part of its name, in lower case. If two are equal, a
/// number is added.
pub fn labels(ports: &[String]) -> Vec<String> {
    let stem = |port: &String| match snake_case(last_part(port)) {
        stem if stem.starts_with(|c: char| c.is_ascii_lowercase()) => stem,
        stem => format!("port_{stem}").trim_end_matches('_').to_owned(),
    };
    distinct(ports.iter().map(stem), |stem, number| format!("{stem}_{number}"))
}

/// `motor1`.
pub fn motor(motor: Motor) -> String {
    format!("motor{}", motor.number())
}

/// The topic of a motor's signals. Those that are read at a lower rate have a topic of their own.
pub fn signals_topic(label: &str, of: Motor, slower_hz: Option<f64>) -> String {
    let rate = slower_hz.map(|hz| format!("_{}_hz", snake_case(&hz.to_string())));
    format!("/{}/{SIGNALS}{}", path(label, of), rate.unwrap_or_default())
}

/// The topic of the frames of a port.
pub fn frames_topic(label: &str) -> String {
    format!("/{label}/frames")
}

/// The name of a motor among the joints.
pub fn joint(label: &str, of: Motor) -> String {
    format!("{label}_{}", motor(of))
}

/// The name of a motor in diagnostics and events.
pub fn path(label: &str, of: Motor) -> String {
    format!("{label}/{}", motor(of))
}

/// As [`path`], with the number of the motor as text.
pub(crate) fn numbered(label: &str, number: &str) -> String {
    format!("{label}/motor{number}")
}

/// The name of the attachment with a motor's settings.
pub fn settings_attachment(label: &str, of: Motor) -> String {
    format!("{}.toml", joint(label, of))
}

/// Lower case letters and digits, with single `_` between.
pub fn snake_case(text: &str) -> String {
    let lower = text.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { ' ' });
    let lower = lower.collect::<String>().to_ascii_lowercase();
    lower.split_whitespace().collect::<Vec<_>>().join("_")
}

/// Words with capitals, without anything between. Different texts in snake case have different results.
pub(super) fn camel_case(text: &str) -> String {
    let capital = |word: &str| match word.split_at_checked(1) {
        Some((first, rest)) if first.starts_with(|c: char| c.is_ascii_digit()) => {
            format!("X{first}{rest}")
        }
        Some((first, rest)) => first.to_ascii_uppercase() + rest,
        None => String::new(),
    };
    snake_case(text).split('_').map(capital).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_are_parts_of_topics() {
        let ports = [
            "/dev/ttyACM0",
            "slcan:/tmp/can0",
            "tcp:10.0.0.7:5000",
            "unix:/a/CAN0?x=1",
            "sim:",
            "pty:/tmp/st-0__",
            "unix:/ü",
        ];
        let labels = labels(&ports.map(str::to_owned));
        assert_eq!(labels, ["ttyacm0", "can0", "port_5000", "can0_2", "sim", "st_0", "port"]);
    }

    #[test]
    fn slow_signals_have_a_topic_of_their_own() {
        let motor = Motor::Rmd(motorlink_proto::rmd::MotorId::new(12).unwrap());
        assert_eq!(signals_topic("can0", motor, None), "/can0/motor12/signals");
        assert_eq!(signals_topic("can0", motor, Some(2.0)), "/can0/motor12/signals_2_hz");
        assert_eq!(signals_topic("can0", motor, Some(0.5)), "/can0/motor12/signals_0_5_hz");
        assert_eq!((joint("can0", motor), path("can0", motor)).0, "can0_motor12");
    }

    #[test]
    fn names_of_types_differ_where_topics_do() {
        assert_eq!(camel_case("/st0/motor1/signals"), "St0Motor1Signals");
        assert_eq!(camel_case("can0_2"), "Can0X2");
        assert_eq!(camel_case("can0x2"), "Can0x2");
    }
}
