//! Names, keys and attachments of `rmw_zenoh`, from version 0.2.4 on.

use ring::digest::{SHA256, digest};

use super::type_hash::{dds_name, hash};

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
        (type_name, definition): (&str, &str),
        depth: u32,
    ) -> Endpoint {
        let Graph { domain, session, node } = self;
        let (hash, dds) = (hash(type_name, definition), dds_name(type_name));
        let key = format!("{domain}{name}/{dds}/{hash}");
        let (word, mangled) = (kind.word(), name.replace('/', "%"));
        // Reliable, volatile, the last `depth`: what is not written is as usual.
        let qos = format!("::,{depth}:,:,:,,");
        let token = format!(
            "@ros2_lv/{domain}/{session}/{NODE}/{number}/{word}/%/%/{node}/{mangled}/{dds}/{hash}/{qos}"
        );
        let mut gid = Gid::default();
        gid.copy_from_slice(&digest(&SHA256, token.as_bytes()).as_ref()[..size_of::<Gid>()]);
        Endpoint { name: name.to_owned(), key, token, gid }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use motorlink_recording::schema::{JointState, Message as _};

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
        let definition = JointState::definition();
        let message = (JointState::TYPE, definition.as_str());
        let states = graph.endpoint(1, EndpointKind::Publisher, "/arm1/joint_states", message, 10);
        let kind = "sensor_msgs::msg::dds_::JointState_/\
                    RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e";
        assert_eq!(states.key, format!("3/arm1/joint_states/{kind}"));
        assert_eq!(
            states.token,
            format!("@ros2_lv/3/ab12/0/1/MP/%/%/arm1/%arm1%joint_states/{kind}/::,10:,:,:,,")
        );
    }
}
