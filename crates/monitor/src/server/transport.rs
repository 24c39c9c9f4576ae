//! Connections: how many, and how long they may take.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use axum::{Extension, Router};
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use rustix::net::sockopt::set_socket_send_buffer_size;
use socket2::SockRef;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::Semaphore;
use tokio::time::{Instant, sleep, sleep_until, timeout};
use tokio_rustls::TlsAcceptor;

/// Connections at the same time, besides those of pages.
const CONNECTIONS: usize = 128;
/// The longest header of a request, in bytes.
const HEADER: usize = 1 << 14;
/// How long a request may take to arrive, and before it the handshake of TLS.
const ARRIVAL: Duration = Duration::from_secs(5);
/// How long an exchange may take. The connection of a page has begun then.
const EXCHANGE: Duration = Duration::from_secs(30);
/// What the system stores for a browser that does not read, in bytes: beats wait behind it.
const STORED: usize = 1 << 15;
/// The part of it that may wait to be sent, in bytes. The system takes more when half of it has gone
/// out. With more, a viewer that reads slowly looks like one that reads nothing.
const UNSENT: u32 = 1 << 12;
/// The pause after a connection that could not be taken.
const PAUSE: Duration = Duration::from_millis(50);

/// When a connection is given up. What takes long, such as a download, moves it on while it goes on.
#[derive(Clone)]
pub struct Deadline(Arc<Mutex<Instant>>);

impl Deadline {
    fn new() -> Self {
        Deadline(Arc::new(Mutex::new(Instant::now() + EXCHANGE)))
    }

    /// The connection goes on: its time begins again.
    pub fn extend(&self) {
        *self.time() = Instant::now() + EXCHANGE;
    }

    async fn pass(&self) {
        loop {
            let time = *self.time();
            if time <= Instant::now() {
                return;
            }
            sleep_until(time).await;
        }
    }

    fn time(&self) -> MutexGuard<'_, Instant> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Serves each connection in a task of its own: a panic in one ends that one.
pub async fn serve(listener: TcpListener, tls: Option<TlsAcceptor>, router: Router) {
    let places = Arc::new(Semaphore::new(CONNECTIONS));
    loop {
        let Ok((stream, _)) = listener.accept().await else {
            // Too many files are open, or the other end has gone.
            sleep(PAUSE).await;
            continue;
        };
        let Ok(place) = Arc::clone(&places).try_acquire_owned() else { continue };
        let (tls, router) = (tls.clone(), router.clone());
        tokio::spawn(async move {
            connected(stream, tls, router).await;
            drop(place);
        });
    }
}

async fn connected(stream: TcpStream, tls: Option<TlsAcceptor>, router: Router) {
    // The connection works without these, too.
    let _ = stream.set_nodelay(true);
    let _ = set_socket_send_buffer_size(&stream, STORED);
    let _ = SockRef::from(&stream).set_tcp_notsent_lowat(UNSENT);
    match tls {
        None => exchange(stream, router).await,
        Some(tls) => {
            if let Ok(Ok(stream)) = timeout(ARRIVAL, tls.accept(stream)).await {
                exchange(stream, router).await;
            }
        }
    }
}

async fn exchange(stream: impl AsyncRead + AsyncWrite + Unpin + Send + 'static, router: Router) {
    let mut builder = http1::Builder::new();
    builder.timer(TokioTimer::new()).header_read_timeout(ARRIVAL).max_buf_size(HEADER);
    // A connection for each request: one that waits for more would have to be watched, too.
    builder.keep_alive(false);
    let deadline = Deadline::new();
    let service = TowerToHyperService::new(router.layer(Extension(deadline.clone())));
    let connection = builder.serve_connection(TokioIo::new(stream), service).with_upgrades();
    tokio::select! {
        // A broken request concerns its sender alone.
        _ = connection => {}
        () = deadline.pass() => {}
    }
}
