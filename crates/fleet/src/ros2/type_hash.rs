//! The hash of a ROS 2 type: two programs exchange messages only if their hashes are the same (REP-2016,
//! `RIHS01`).

use std::collections::BTreeMap;
use std::fmt::Write;

use ring::digest::{SHA256, digest};

/// The numbers of types in `type_description_interfaces/msg/FieldType`.
const PLAIN: [(&str, u8); 8] = [
    ("uint8", 3),
    ("int32", 6),
    ("uint32", 7),
    ("int64", 8),
    ("float64", 11),
    ("bool", 15),
    ("byte", 16),
    ("string", 17),
];
/// The number of a type with fields.
const NESTED: u8 = 1;
/// What is added to the number of a type.
const ARRAY: u8 = 48;
const LIMITED: u8 = 96;
const SEQUENCE: u8 = 144;

/// The hash of the type with this name and this definition, which has the types in it, too.
pub fn hash(name: &str, definition: &str) -> String {
    let rule = format!("{}\nMSG: ", "=".repeat(80));
    let mut parts = definition.split(&rule);
    let own = description(name, parts.next().unwrap_or_default());
    let nested = parts.filter_map(|part| part.split_once('\n'));
    let nested: BTreeMap<_, _> =
        nested.map(|(name, fields)| (full(name), description(&full(name), fields))).collect();
    let nested = nested.into_values().collect::<Vec<_>>().join(", ");
    let text =
        format!(r#"{{"type_description": {own}, "referenced_type_descriptions": [{nested}]}}"#);
    let mut hash = "RIHS01_".to_owned();
    for byte in digest(&SHA256, text.as_bytes()).as_ref() {
        let _ = write!(hash, "{byte:02x}");
    }
    hash
}

/// The name of a type in keys: `sensor_msgs::msg::dds_::JointState_`.
pub fn dds_name(name: &str) -> String {
    let (package, name) = name.rsplit_once('/').unwrap_or_default();
    format!("{}::dds_::{name}_", package.replace('/', "::"))
}

/// `std_msgs/Header` is `std_msgs/msg/Header`.
fn full(name: &str) -> String {
    match name.split_once('/') {
        Some((package, short)) if !short.contains('/') => format!("{package}/msg/{short}"),
        _ => name.to_owned(),
    }
}

fn description(name: &str, fields: &str) -> String {
    let lines = fields.lines().filter(|line| !line.contains('=') || line.contains("<="));
    let fields: Vec<_> = lines.filter_map(|line| line.split_once(' ')).map(field).collect();
    format!(r#"{{"type_name": "{name}", "fields": [{}]}}"#, fields.join(", "))
}

fn field((kind, name): (&str, &str)) -> String {
    let (element, bounds) = kind.split_once('[').map_or((kind, None), |(it, of)| (it, Some(of)));
    let bounds = bounds.map(|it| it.trim_end_matches(']'));
    let (added, capacity) = match bounds.map(|it| (it, it.strip_prefix("<="))) {
        None => (0, "0"),
        Some(("", _)) => (SEQUENCE, "0"),
        Some((_, Some(most))) => (LIMITED, most),
        Some((count, None)) => (ARRAY, count),
    };
    let plain = PLAIN.into_iter().find(|(name, _)| *name == element);
    let (id, nested) = plain.map_or_else(|| (NESTED, full(element)), |(_, id)| (id, String::new()));
    let id = id + added;
    format!(
        r#"{{"name": "{name}", "type": {{"type_id": {id}, "capacity": {capacity}, "string_capacity": 0, "nested_type_name": "{nested}"}}}}"#
    )
}

#[cfg(test)]
mod tests {
    use super::super::trigger_type::{TRIGGER, trigger};
    use super::*;
    use motorlink_recording::schema::{DiagnosticArray, JointState, Message as _};

    #[test]
    fn hashes_are_those_that_ros_publishes() {
        // They are in the package of each type, and on the network of every robot with ROS 2.
        for (name, definition, known) in [
            (
                "std_msgs/msg/String",
                "string data\n".to_owned(),
                "df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18",
            ),
            (
                JointState::TYPE,
                JointState::definition(),
                "a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e",
            ),
            (
                TRIGGER,
                trigger(),
                "eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f",
            ),
        ] {
            assert_eq!(hash(name, &definition), format!("RIHS01_{known}"), "{name}");
        }
        let diagnostics = hash(DiagnosticArray::TYPE, &DiagnosticArray::definition());
        assert!(diagnostics.starts_with("RIHS01_5a8a36ef"), "{diagnostics}");
        assert!(diagnostics.ends_with("5a333e"), "{diagnostics}");
    }

    #[test]
    fn names_in_keys_have_the_package_first() {
        assert_eq!(dds_name(JointState::TYPE), "sensor_msgs::msg::dds_::JointState_");
        assert_eq!(dds_name(TRIGGER), "std_srvs::srv::dds_::Trigger_");
    }
}
