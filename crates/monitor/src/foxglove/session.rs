//! A viewer, without a socket. Nothing that it sends goes further than here.

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;
use std::time::Duration;

use axum::extract::ws::Message;
use serde::Deserialize;
use tokio::time::Instant;

use super::protocol::{self, Level, Op, Subscribe, Subscription, Unsubscribe, status};

/// The longest message of a viewer, in bytes.
pub const LONGEST_TEXT: usize = 1 << 16;
/// Messages that wait for a viewer, in bytes.
const MOST_BYTES: usize = 1 << 20;
/// Texts that wait for a viewer.
const MOST_TEXTS: usize = 256;
/// The least time between two texts about lost messages.
const SAID: Duration = Duration::from_secs(1);
/// How much of a word of a viewer is repeated to it.
const LONGEST_WORD: usize = 40;

/// A viewer, and what waits for it.
#[derive(Debug, Default)]
pub struct Session {
    texts: VecDeque<String>,
    messages: VecDeque<Waiting>,
    bytes: usize,
    /// The number of the subscription of each channel.
    subscriptions: BTreeMap<u32, u32>,
    lost: u64,
    said_at: Option<Instant>,
    is_flooded: bool,
}

#[derive(Debug)]
struct Waiting {
    subscription: u32,
    time: u64,
    data: Arc<[u8]>,
}

impl Session {
    /// A text for the viewer.
    pub fn tell(&mut self, text: String) {
        match self.texts.len() < MOST_TEXTS {
            true => self.texts.push_back(text),
            false => self.is_flooded = true,
        }
    }

    /// Whether more texts wait for the viewer than there is room for.
    pub fn is_flooded(&self) -> bool {
        self.is_flooded
    }

    /// A message of a channel. If the viewer is too slow, it loses the oldest ones.
    pub fn offer(&mut self, channel: u32, time: u64, data: &Arc<[u8]>) {
        let Some(subscription) = self.subscriptions.get(&channel) else { return };
        self.bytes += data.len();
        self.messages.push_back(Waiting {
            subscription: *subscription,
            time,
            data: Arc::clone(data),
        });
        while self.bytes > MOST_BYTES
            && let Some(oldest) = self.messages.pop_front()
        {
            self.bytes -= oldest.data.len();
            self.lost += 1;
        }
    }

    /// What is sent next.
    pub fn take(&mut self, now: Instant) -> Option<Message> {
        if let Some(text) = self.texts.pop_front() {
            return Some(Message::Text(text.into()));
        }
        let may_say = self.said_at.is_none_or(|said| now.duration_since(said) >= SAID);
        if self.lost > 0 && may_say {
            self.said_at = Some(now);
            let lost = std::mem::take(&mut self.lost);
            let text = format!("{lost} messages are lost here: this viewer is too slow");
            return Some(Message::Text(status(Level::Warning, &text).into()));
        }
        let Waiting { subscription, time, data } = self.messages.pop_front()?;
        self.bytes -= data.len();
        Some(Message::Binary(protocol::message(subscription, time, &data).into()))
    }

    /// A text of the viewer. There are `channels` channels, numbered from 0.
    pub fn receive(&mut self, text: &str, channels: usize) {
        if let Err(why) = self.received(text, channels) {
            self.tell(status(Level::Error, &why));
        }
    }

    /// A binary message of the viewer: viewers that may publish or call services send such.
    pub fn receive_binary(&mut self) {
        self.tell(status(
            Level::Error,
            "this server is for reading alone: it takes no binary message",
        ));
    }

    fn received(&mut self, text: &str, channels: usize) -> Result<(), String> {
        let Op { op } = parse(text)?;
        match op.as_str() {
            "subscribe" => {
                let Subscribe { subscriptions } = parse(text)?;
                for subscription in subscriptions {
                    self.subscribe(&subscription, channels)?;
                }
            }
            "unsubscribe" => {
                let Unsubscribe { subscription_ids } = parse(text)?;
                for id in subscription_ids {
                    self.unsubscribe(id)?;
                }
            }
            other => {
                let word: String = other.chars().take(LONGEST_WORD).collect();
                return Err(format!("this server is for reading alone: it does not do {word:?}"));
            }
        }
        Ok(())
    }

    fn subscribe(&mut self, wanted: &Subscription, channels: usize) -> Result<(), String> {
        let Subscription { id, channel_id } = *wanted;
        if channel_id as usize >= channels {
            return Err(format!("there is no channel {channel_id}"));
        }
        if self.subscriptions.values().any(|used| *used == id) {
            return Err(format!("the subscription {id} is in use"));
        }
        if self.subscriptions.contains_key(&channel_id) {
            return Err(format!("the channel {channel_id} has a subscription already"));
        }
        self.subscriptions.insert(channel_id, id);
        Ok(())
    }

    fn unsubscribe(&mut self, id: u32) -> Result<(), String> {
        let before = self.subscriptions.len();
        self.subscriptions.retain(|_, used| *used != id);
        if self.subscriptions.len() == before {
            return Err(format!("there is no subscription {id}"));
        }
        // Its number may be used for another channel now.
        self.messages.retain(|waiting| waiting.subscription != id);
        self.bytes = self.messages.iter().map(|waiting| waiting.data.len()).sum();
        Ok(())
    }
}

fn parse<'t, T: Deserialize<'t>>(text: &'t str) -> Result<T, String> {
    serde_json::from_str(text).map_err(|error| format!("this is not a message: {error}"))
}

#[cfg(test)]
mod tests;
