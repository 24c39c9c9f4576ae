//! The connection of a viewer.

use std::sync::Arc;

use axum::extract::ws::{Message, WebSocket};
use futures_util::stream::SplitStream;
use futures_util::{SinkExt, StreamExt};
use tokio::time::{Instant, timeout};

use super::protocol::{Level, status};
use super::viewers::{Viewer, Viewers};
use crate::websocket_limits::{Budget, PATIENCE, Sink, close};

/// How much is handed to the system at once, in bytes: a viewer that takes this in time is there.
pub const PACKED: usize = 1 << 10;

/// Serves a viewer until it goes.
pub async fn serve(viewers: Arc<Viewers>, socket: WebSocket) {
    let (mut sink, stream) = socket.split();
    let Ok(_place) = viewers.places.try_acquire() else {
        let why = "the server has as many viewers as it can have";
        return close(&mut sink, status(Level::Error, why)).await;
    };
    let joined = viewers.join();
    let why = tokio::select! {
        // The viewer has gone, or does not read.
        () = write(&joined.viewer, &mut sink) => return,
        why = read(&viewers, &joined.viewer, stream) => why,
    };
    if let Err(why) = why {
        close(&mut sink, status(Level::Error, &why)).await;
    }
}

/// Takes what a viewer sends, until it goes.
async fn read(
    viewers: &Viewers,
    viewer: &Viewer,
    mut stream: SplitStream<WebSocket>,
) -> Result<(), String> {
    let mut budget = Budget::new();
    loop {
        let message = stream.next().await;
        budget.spend()?;
        match message {
            Some(Ok(Message::Text(text))) => {
                let channels = viewers.channels();
                viewer.session.lock().receive(&text, channels);
            }
            Some(Ok(Message::Binary(_))) => viewer.session.lock().receive_binary(),
            Some(Ok(Message::Ping(_) | Message::Pong(_))) => {}
            Some(Ok(Message::Close(_))) | None => return Ok(()),
            Some(Err(error)) => return Err(error.to_string()),
        }
        viewer.news.notify_one();
        if viewer.session.lock().is_flooded() {
            return Err("this viewer does not read what it is told".to_owned());
        }
    }
}

/// Sends to a viewer, until it has gone or does not read.
async fn write(viewer: &Viewer, sink: &mut Sink) {
    loop {
        let out = viewer.session.lock().take(Instant::now());
        let is_idle = out.is_none();
        let sent = async {
            match out {
                Some(message) => sink.feed(message).await,
                None => sink.flush().await,
            }
        };
        match timeout(PATIENCE, sent).await {
            Ok(Ok(())) if is_idle => viewer.news.notified().await,
            Ok(Ok(())) => {}
            Ok(Err(_)) | Err(_) => return,
        }
    }
}
