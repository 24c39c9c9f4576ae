//! Channels and schemas of a file. Recordings that were put one behind the other number theirs anew, so a
//! number of the file has its meaning in one part of it only.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use super::record::{Channel, Schema};

/// Descriptions, each with a number of its own.
#[derive(Default)]
pub struct Catalogue {
    pub schemas: BTreeMap<u16, Arc<Schema>>,
    pub channels: BTreeMap<u16, Arc<Channel>>,
    schema_numbers: Numbers,
    channel_numbers: Numbers,
    /// The parts of the file that are over.
    before: Vec<Part>,
    part: Part,
}

/// Our numbers for those of a part of the file.
#[derive(Default)]
struct Part {
    schemas: BTreeMap<u16, u16>,
    channels: BTreeMap<u16, u16>,
}

/// Numbers that are in use.
#[derive(Default)]
struct Numbers {
    used: BTreeSet<u16>,
    /// No number before is free.
    free: u16,
}

impl Numbers {
    /// The wanted number or another one. `None` if all are in use.
    fn take(&mut self, wanted: u16) -> Option<u16> {
        let number = match self.used.contains(&wanted) {
            false => wanted,
            true => {
                // A channel without a schema has 0 as its schema.
                self.free = (self.free.max(1)..u16::MAX).find(|n| !self.used.contains(n))?;
                self.free
            }
        };
        self.used.insert(number);
        Some(number)
    }
}

impl Catalogue {
    /// The number of the part of the file that is read now.
    pub fn part(&self) -> usize {
        self.before.len()
    }

    /// Another recording begins here.
    pub fn begin_part(&mut self) {
        self.before.push(std::mem::take(&mut self.part));
    }

    /// The channel that has this number in a part of the file.
    pub fn channel(&self, part: usize, id: u16) -> Option<&Arc<Channel>> {
        let part = self.before.get(part).unwrap_or(&self.part);
        self.channels.get(part.channels.get(&id)?)
    }

    /// Our number for a channel of this part, whether it is described yet or not.
    pub fn number(&mut self, id: u16) -> Option<u16> {
        number(&mut self.part.channels, &mut self.channel_numbers, id, false)
    }

    /// Adds descriptions that stand together. If a number has another meaning already, another recording
    /// has begun.
    pub fn add(&mut self, schemas: Vec<Schema>, channels: Vec<Channel>) {
        let is_other = |schema: &Schema| {
            let known = self.part.schemas.get(&schema.id).and_then(|id| self.schemas.get(id));
            known.is_some_and(|known| !known.is_like(schema))
        };
        let is_other_channel = |channel: &Channel| {
            let known = self.channel(self.part(), channel.id);
            let schema = self.part.schemas.get(&channel.schema_id).copied().unwrap_or(0);
            known.is_some_and(|known| known.schema_id != schema || !known.is_like(channel))
        };
        if schemas.iter().any(is_other) || channels.iter().any(is_other_channel) {
            self.begin_part();
        }
        schemas.into_iter().for_each(|schema| self.add_schema(schema));
        channels.into_iter().for_each(|channel| self.add_channel(channel));
    }

    fn add_schema(&mut self, schema: Schema) {
        let is_known = self.schemas.get(&schema.id).is_some_and(|known| known.is_like(&schema));
        let numbers = &mut self.schema_numbers;
        if let Some(id) = number(&mut self.part.schemas, numbers, schema.id, is_known) {
            self.schemas.entry(id).or_insert_with(|| Arc::new(Schema { id, ..schema }));
        }
    }

    fn add_channel(&mut self, channel: Channel) {
        let schema_id = match channel.schema_id {
            0 => Some(0),
            id => number(&mut self.part.schemas, &mut self.schema_numbers, id, false),
        };
        let Some(schema_id) = schema_id else { return };
        let is_known = self
            .channels
            .get(&channel.id)
            .is_some_and(|known| known.schema_id == schema_id && known.is_like(&channel));
        let numbers = &mut self.channel_numbers;
        if let Some(id) = number(&mut self.part.channels, numbers, channel.id, is_known) {
            let ours = || Arc::new(Channel { id, schema_id, ..channel });
            self.channels.entry(id).or_insert_with(ours);
        }
    }
}

/// Our number for one of a part. `is_known`: it has the same meaning in a part before.
fn number(
    part: &mut BTreeMap<u16, u16>,
    numbers: &mut Numbers,
    id: u16,
    is_known: bool,
) -> Option<u16> {
    if let Some(known) = part.get(&id) {
        return Some(*known);
    }
    let ours = if is_known { id } else { numbers.take(id)? };
    part.insert(id, ours);
    Some(ours)
}
