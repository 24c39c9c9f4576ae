//! Names, keys and attachments of `rmw_zenoh`, from version 0.2.4 on.

use motorlink_recording::schema::{DiagnosticArray, JointState, Message as _};
use ring::digest::{SHA256, digest};

/// Who sent a sample.
pub type Gid = [u8; 16];

/// What a sample, a request and a response have besides their bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Attachment {
    /// The number of the sample of its publisher.
    pub sequence: i64,
    /// When it was sent, by the clock of the sender: nanoseconds since 1970.
    pub sent_ns: i64,
    /// The sender.
    pub gid: Gid,
}

impl Attachment {
    /// Its bytes.
    pub fn encode(&self) -> Vec<u8> {
        let mut bytes = self.sequence.to_le_bytes().to_vec();
        bytes.extend(self.sent_ns.to_le_bytes());
        bytes.push(self.gid.len() as u8);
        bytes.extend(self.gid);
        bytes
    }

    /// The one with these bytes.
    pub fn decode(bytes: &[u8]) -> Option<Self> {
        let (sequence, rest) = bytes.split_first_chunk()?;
        let (sent, rest) = rest.split_first_chunk()?;
        let (&length, gid) = rest.split_first()?;
        let gid = Gid::try_from(gid).ok().filter(|gid| gid.len() == usize::from(length))?;
        let (sequence, sent_ns) = (i64::from_le_bytes(*sequence), i64::from_le_bytes(*sent));
        Some(Attachment { sequence, sent_ns, gid })
    }
}

/// The nearest text that is a part of a ROS name: letters, digits and `_`, and no digit first.
pub fn legal(text: &str) -> String {
    let mut name = String::new();
    for character in text.chars() {
        match character {
            'a'..='z' | 'A'..='Z' | '0'..='9' => name.push(character),
            _ if name.ends_with('_') => {}
            _ => name.push('_'),
        }
    }
    if name.starts_with(|first: char| first.is_ascii_digit()) {
        name.insert(0, '_');
    }
    name
}

/// Whether a text is a ROS name: parts that are [`legal`], with `/` between them.
pub fn is_name(text: &str) -> bool {
    text.split('/').all(|part| !part.is_empty() && legal(part) == part)
}

/// A type as keys name it, with the hash that ROS publishes for it (REP-2016, `RIHS01`): two programs exchange
/// messages only if their hashes are the same.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RosType {
    name: &'static str,
    hash: &'static str,
}

/// `sensor_msgs/msg/JointState`
pub const JOINT_STATE: RosType = RosType {
    name: JointState::TYPE,
    hash: "RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e",
};
/// `diagnostic_msgs/msg/DiagnosticArray`
pub const DIAGNOSTIC_ARRAY: RosType = RosType {
    name: DiagnosticArray::TYPE,
    hash: "RIHS01_5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e",
};
/// `std_srvs/srv/Trigger`. Its hash is over the request, the response and the event of both.
pub const TRIGGER: RosType = RosType {
    name: "std_srvs/srv/Trigger",
    hash: "RIHS01_eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f",
};

impl RosType {
    /// The name and the hash in keys: `sensor_msgs::msg::dds_::JointState_/RIHS01_...`.
    fn in_key(self) -> String {
        let (package, name) = self.name.rsplit_once('/').unwrap_or_default();
        format!("{}::dds_::{name}_/{}", package.replace('/', "::"), self.hash)
    }
}

/// What a ROS node has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EndpointKind {
    /// A topic that it publishes.
    Publisher,
    /// A topic that it reads.
    Subscription,
    /// A service.
    Service,
}

impl EndpointKind {
    const fn word(self) -> &'static str {
        match self {
            EndpointKind::Publisher => "MP",
            EndpointKind::Subscription => "MS",
            EndpointKind::Service => "SS",
        }
    }
}

/// A topic or a service.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Endpoint {
    /// Its name, which begins with `/`.
    pub name: String,
    /// The key of its samples or requests.
    pub key: String,
    /// The key of the liveliness token that makes it visible.
    pub token: String,
    /// Who sends.
    pub gid: Gid,
}

/// A ROS node.
#[derive(Debug, Clone)]
pub struct Graph {
    domain: u32,
    session: String,
    node: String,
}

/// The number of the node in its session. Those of endpoints follow.
const NODE: usize = 0;

impl Graph {
    /// A node of a Zenoh session.
    pub fn new(domain: u32, session: String, node: String) -> Self {
        Graph { domain, session, node }
    }

    /// The key of the liveliness token of the node.
    pub fn token(&self) -> String {
        let Graph { domain, session, node } = self;
        format!("@ros2_lv/{domain}/{session}/{NODE}/{NODE}/NN/%/%/{node}")
    }

    /// The endpoint with this number from 1 on. `depth` is how many samples wait.
    pub fn endpoint(
        &self,
        number: usize,
        kind: EndpointKind,
        name: &str,
        ty: RosType,
        depth: u32,
    ) -> Endpoint {
        let Graph { domain, session, node } = self;
        let ty = ty.in_key();
        let key = format!("{domain}{name}/{ty}");
        let (word, mangled) = (kind.word(), name.replace('/', "%"));
        // Reliable, volatile, the last `depth`: what is not written is as usual.
        let qos = format!("::,{depth}:,:,:,,");
        let token = format!(
            "@ros2_lv/{domain}/{session}/{NODE}/{number}/{word}/%/%/{node}/{mangled}/{ty}/{qos}"
        );
        let mut gid = Gid::default();
        gid.copy_from_slice(&digest(&SHA256, token.as_bytes()).as_ref()[..size_of::<Gid>()]);
        Endpoint { name: name.to_owned(), key, token, gid }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_nodes_become_legal() {
        for (text, name) in
            [("arm1", "arm1"), ("left-arm.2", "left_arm_2"), ("7dof", "_7dof"), ("a__b", "a_b")]
        {
            assert_eq!(legal(text), name);
            assert!(is_name(name));
        }
        assert!(is_name("robot/arm") && !is_name("robot/") && !is_name("/robot") && !is_name(""));
    }

    #[test]
    fn an_attachment_is_a_number_a_time_and_a_sender() {
        let attachment = Attachment { sequence: 1, sent_ns: -2, gid: [7; 16] };
        let bytes = attachment.encode();
        assert_eq!(
            bytes[..17],
            [1, 0, 0, 0, 0, 0, 0, 0, 254, 255, 255, 255, 255, 255, 255, 255, 16]
        );
        assert_eq!(Attachment::decode(&bytes), Some(attachment));
        for end in 0..bytes.len() {
            assert_eq!(Attachment::decode(&bytes[..end]), None);
        }
        assert_eq!(Attachment::decode(&[bytes, vec![0]].concat()), None);
    }

    #[test]
    fn keys_and_tokens_are_those_of_rmw_zenoh() {
        let graph = Graph::new(3, "ab12".to_owned(), "arm1".to_owned());
        assert_eq!(graph.token(), "@ros2_lv/3/ab12/0/0/NN/%/%/arm1");
        let states =
            graph.endpoint(1, EndpointKind::Publisher, "/arm1/joint_states", JOINT_STATE, 10);
        let kind = "sensor_msgs::msg::dds_::JointState_/\
                    RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e";
        assert_eq!(states.key, format!("3/arm1/joint_states/{kind}"));
        assert_eq!(
            states.token,
            format!("@ros2_lv/3/ab12/0/1/MP/%/%/arm1/%arm1%joint_states/{kind}/::,10:,:,:,,")
        );
        assert!(TRIGGER.in_key().starts_with("std_srvs::srv::dds_::Trigger_/RIHS01_eeff2cd6"));
    }
}
