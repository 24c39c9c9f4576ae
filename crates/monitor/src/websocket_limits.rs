//! What holds for the WebSockets of pages and of viewers.

use std::time::Duration;

use axum::extract::ws::{CloseFrame, Message, WebSocket, close_code};
use futures_util::SinkExt;
use futures_util::stream::SplitSink;
use tokio::time::{Instant, timeout};

/// How long a message may wait for a browser or a program that does not read.
pub const PATIENCE: Duration = Duration::from_secs(10);
/// The most messages of a connection in a second.
const MESSAGES: u32 = 1000;

/// Where messages go out.
pub type Sink = SplitSink<WebSocket, Message>;

/// Ends a connection. The last text says why.
pub async fn close(sink: &mut Sink, last: String) {
    let frame = CloseFrame { code: close_code::POLICY, reason: "".into() };
    let last = async {
        sink.send(Message::Text(last.into())).await?;
        sink.send(Message::Close(Some(frame))).await
    };
    // It may have gone.
    let _ = timeout(PATIENCE, last).await;
}

/// Counts the messages of a connection.
pub struct Budget {
    since: Instant,
    count: u32,
}

impl Budget {
    /// None came yet.
    pub fn new() -> Self {
        Budget { since: Instant::now(), count: 0 }
    }

    /// One came.
    ///
    /// # Errors
    /// Too many came in a second.
    pub fn spend(&mut self) -> Result<(), String> {
        if self.since.elapsed() >= Duration::from_secs(1) {
            *self = Budget::new();
        }
        self.count += 1;
        match self.count > MESSAGES {
            true => Err(format!("more than {MESSAGES} messages in a second")),
            false => Ok(()),
        }
    }
}
