//! The topics of a recording, in the order of their numbers.

use crate::schema::{DiagnosticArray, Frame, JointState, Log, Message, SignalsType, name};
use crate::write::{Entry, Pairs, Topic};

/// Numbers the topics of a recording.
#[derive(Debug)]
pub struct Topics {
    /// Those that have a number, and are to be declared.
    new: Vec<Topic>,
    next: usize,
}

impl Default for Topics {
    fn default() -> Self {
        let mut topics = Topics { new: Vec::new(), next: 0 };
        topics.add::<JointState>(name::JOINT_STATES.to_owned(), Pairs::new());
        topics.add::<DiagnosticArray>(name::DIAGNOSTICS.to_owned(), Pairs::new());
        topics.add::<Log>(name::EVENTS.to_owned(), Pairs::new());
        topics
    }
}

impl Topics {
    /// The number of [`name::JOINT_STATES`].
    pub const JOINT_STATES: usize = 0;
    /// The number of [`name::DIAGNOSTICS`].
    pub const DIAGNOSTICS: usize = 1;
    /// The number of [`name::EVENTS`].
    pub const EVENTS: usize = 2;

    /// The frames of a port.
    pub(super) fn frames(&mut self, label: &str, pairs: Pairs) -> usize {
        self.add::<Frame>(name::frames_topic(label), pairs)
    }

    /// The signals of a motor.
    pub fn signals(&mut self, name: &str, ty: &SignalsType) -> usize {
        let (name, definition) = (name.to_owned(), ty.definition());
        self.put(Topic { name, ty: ty.name().to_owned(), definition, metadata: Pairs::new() })
    }

    fn add<M: Message>(&mut self, name: String, metadata: Pairs) -> usize {
        let (ty, definition) = (M::TYPE.to_owned(), M::definition());
        self.put(Topic { name, ty, definition, metadata })
    }

    fn put(&mut self, topic: Topic) -> usize {
        self.new.push(topic);
        self.next += 1;
        self.next - 1
    }

    /// The topics that are to be declared now.
    pub fn take(&mut self) -> impl Iterator<Item = Entry> {
        std::mem::take(&mut self.new).into_iter().map(Entry::Topic)
    }
}
