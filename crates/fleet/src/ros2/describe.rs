//! What a ROS 2 message type is, and its hash: two programs exchange messages only if their hashes are
//! the same (REP-2016, `RIHS01`).

use std::collections::BTreeMap;
use std::fmt::Write;

use ring::digest::{SHA256, digest};

/// A type with fields.
#[derive(Debug)]
pub struct Message {
    /// Its name: `sensor_msgs/msg/JointState`.
    pub name: &'static str,
    /// Its fields, in their order.
    pub fields: &'static [Field],
}

/// A field of a message.
#[derive(Debug)]
pub struct Field {
    /// Its name.
    pub name: &'static str,
    /// Its type.
    pub kind: Type,
}

/// The type of a field.
#[derive(Debug, Clone, Copy)]
pub struct Type {
    /// The number in `type_description_interfaces/msg/FieldType`.
    id: u8,
    /// Values of an array, or of a sequence that is limited; 0 otherwise.
    capacity: u8,
    message: Option<&'static Message>,
}

/// What is added to the number of a type.
const ARRAY: u8 = 48;
const LIMITED: u8 = 96;
const SEQUENCE: u8 = 144;
/// The number of a type with fields.
const NESTED: u8 = 1;

impl Type {
    /// A type without fields.
    pub const fn plain(id: u8) -> Self {
        Type { id, capacity: 0, message: None }
    }

    /// A type with fields.
    pub const fn nested(message: &'static Message) -> Self {
        Type { id: NESTED, capacity: 0, message: Some(message) }
    }

    /// A sequence of these.
    pub const fn sequence(self) -> Self {
        Type { id: self.id + SEQUENCE, ..self }
    }

    /// A sequence of at most this many.
    pub const fn at_most(self, capacity: u8) -> Self {
        Type { id: self.id + LIMITED, capacity, ..self }
    }

    /// Exactly this many.
    pub const fn array(self, capacity: u8) -> Self {
        Type { id: self.id + ARRAY, capacity, ..self }
    }
}

impl Message {
    /// The hash of the type and of all types in it.
    pub fn hash(&'static self) -> String {
        let mut nested = BTreeMap::new();
        self.collect(&mut nested);
        let nested: Vec<_> = nested.values().map(|it| it.description()).collect();
        let text = format!(
            r#"{{"type_description": {}, "referenced_type_descriptions": [{}]}}"#,
            self.description(),
            nested.join(", ")
        );
        let mut hash = "RIHS01_".to_owned();
        for byte in digest(&SHA256, text.as_bytes()).as_ref() {
            let _ = write!(hash, "{byte:02x}");
        }
        hash
    }

    /// The name in keys: `sensor_msgs::msg::dds_::JointState_`.
    pub fn dds_name(&self) -> String {
        let (package, name) = self.name.rsplit_once('/').unwrap_or_default();
        format!("{}::dds_::{name}_", package.replace('/', "::"))
    }

    fn collect(&self, into: &mut BTreeMap<&'static str, &'static Message>) {
        for message in self.fields.iter().filter_map(|field| field.kind.message) {
            into.insert(message.name, message);
            message.collect(into);
        }
    }

    fn description(&self) -> String {
        let field = |Field { name, kind }: &Field| {
            let Type { id, capacity, message } = kind;
            let nested = message.map_or("", |it| it.name);
            format!(
                r#"{{"name": "{name}", "type": {{"type_id": {id}, "capacity": {capacity}, "string_capacity": 0, "nested_type_name": "{nested}"}}}}"#
            )
        };
        let fields: Vec<_> = self.fields.iter().map(field).collect();
        format!(r#"{{"type_name": "{}", "fields": [{}]}}"#, self.name, fields.join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::super::cdr::Value;
    use super::super::types::{DiagnosticArray, Header, JointState, TRIGGER};
    use super::*;

    const TEXT: Message = Message {
        name: "std_msgs/msg/String",
        fields: &[Field { name: "data", kind: String::TYPE }],
    };

    #[test]
    fn hashes_are_those_that_ros_publishes() {
        // They are in the package of each type, and on the network of every robot with ROS 2.
        for (message, hash) in [
            (&TEXT, "df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"),
            (Header::MESSAGE, "f49fb3ae2cf070f793645ff749683ac6b06203e41c891e17701b1cb597ce6a01"),
            (
                JointState::MESSAGE,
                "a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e",
            ),
            (&TRIGGER, "eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f"),
        ] {
            assert_eq!(message.hash(), format!("RIHS01_{hash}"), "{}", message.name);
        }
        let diagnostics = DiagnosticArray::MESSAGE.hash();
        assert!(diagnostics.starts_with("RIHS01_5a8a36ef"), "{diagnostics}");
        assert!(diagnostics.ends_with("5a333e"), "{diagnostics}");
    }

    #[test]
    fn names_in_keys_have_the_package_first() {
        assert_eq!(JointState::MESSAGE.dds_name(), "sensor_msgs::msg::dds_::JointState_");
        assert_eq!(TRIGGER.dds_name(), "std_srvs::srv::dds_::Trigger_");
    }
}
