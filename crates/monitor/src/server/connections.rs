//! Connections: how many, and how long they may take.
//!
//! A connection arrives until its request has shown a token. Connections that arrive have places of their
//! own, and the oldest is closed for a new one, so they never block other requests. A stop needs no further
//! place.

use std::collections::BTreeMap;
use std::net::IpAddr;
use std::sync::Arc;
use std::time::Duration;

use axum::{Extension, Router};
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use parking_lot::Mutex;
use rustix::net::listen;
use rustix::net::sockopt::set_socket_send_buffer_size;
use socket2::SockRef;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::task::{AbortHandle, yield_now};
use tokio::time::{Instant, sleep, sleep_until, timeout};
use tokio_rustls::TlsAcceptor;

/// Connections that the system keeps until they are taken. Of more the other end hears nothing for a second.
const WAITING: i32 = 4096;
/// Connections that arrive at the same time.
const ARRIVALS: usize = 128;
/// Requests at the same time that may come in, besides stops and the connections of pages.
const REQUESTS: usize = 128;
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
        *self.0.lock() = Instant::now() + EXCHANGE;
    }

    async fn pass(&self) {
        loop {
            let time = *self.0.lock();
            if time <= Instant::now() {
                return;
            }
            sleep_until(time).await;
        }
    }
}

/// The places of connections.
struct Places {
    /// Those that arrive, by their order: where they come from, and what ends them.
    arriving: Mutex<BTreeMap<u64, (IpAddr, AbortHandle)>>,
    requests: Arc<Semaphore>,
}

/// The oldest connection of the address that has the most.
fn oldest_of_most(arriving: &BTreeMap<u64, (IpAddr, AbortHandle)>) -> Option<u64> {
    let mut counts = BTreeMap::<IpAddr, (usize, u64)>::new();
    for (number, (from, _)) in arriving {
        counts.entry(*from).or_insert((0, *number)).0 += 1;
    }
    counts.into_values().max_by_key(|(count, _)| *count).map(|(_, oldest)| oldest)
}

/// A connection, until its end.
pub struct Arrival {
    places: Arc<Places>,
    number: u64,
    /// The place of its request.
    place: Mutex<Option<OwnedSemaphorePermit>>,
}

impl Arrival {
    /// Its request may come in: it gives way to no other. Gives whether there is a place for it. A request
    /// that stops motors needs none.
    pub fn come_in(&self, stops: bool) -> bool {
        self.places.arriving.lock().remove(&self.number);
        if stops {
            return true;
        }
        let place = Arc::clone(&self.places.requests).try_acquire_owned().ok();
        let has_place = place.is_some();
        *self.place.lock() = place;
        has_place
    }
}

impl Drop for Arrival {
    fn drop(&mut self) {
        self.places.arriving.lock().remove(&self.number);
    }
}

/// Serves each connection in a task of its own: a panic in one ends that one.
pub async fn serve(listener: TcpListener, tls: Option<TlsAcceptor>, router: Router) {
    // If it fails, fewer connections wait until they are taken.
    let _ = listen(&listener, WAITING);
    let (arriving, requests) = (Mutex::default(), Arc::new(Semaphore::new(REQUESTS)));
    let places = Arc::new(Places { arriving, requests });
    for number in 0.. {
        let Ok((stream, from)) = listener.accept().await else {
            // Too many files are open, or the other end has gone.
            sleep(PAUSE).await;
            continue;
        };
        // A request that is there already comes in before the next connection can take its place.
        yield_now().await;
        let mut arriving = places.arriving.lock();
        if arriving.len() >= ARRIVALS
            && let Some((_, oldest)) = oldest_of_most(&arriving).and_then(|it| arriving.remove(&it))
        {
            oldest.abort();
        }
        let (places, place) = (Arc::clone(&places), Mutex::default());
        let arrival = Arc::new(Arrival { places, number, place });
        let task = tokio::spawn(connected(stream, tls.clone(), router.clone(), arrival));
        arriving.insert(number, (from.ip(), task.abort_handle()));
    }
}

async fn connected(
    stream: TcpStream,
    tls: Option<TlsAcceptor>,
    router: Router,
    arrival: Arc<Arrival>,
) {
    // The connection works without these, too.
    let _ = stream.set_nodelay(true);
    let _ = set_socket_send_buffer_size(&stream, STORED);
    let _ = SockRef::from(&stream).set_tcp_notsent_lowat(UNSENT);
    match tls {
        None => exchange(stream, router, arrival).await,
        Some(tls) => {
            if let Ok(Ok(stream)) = timeout(ARRIVAL, tls.accept(stream)).await {
                exchange(stream, router, arrival).await;
            }
        }
    }
}

async fn exchange(
    stream: impl AsyncRead + AsyncWrite + Unpin + Send + 'static,
    router: Router,
    arrival: Arc<Arrival>,
) {
    let mut builder = http1::Builder::new();
    builder.timer(TokioTimer::new()).header_read_timeout(ARRIVAL).max_buf_size(HEADER);
    // A connection for each request: one that waits for more would have to be watched, too.
    builder.keep_alive(false);
    let deadline = Deadline::new();
    let service = TowerToHyperService::new(
        router.layer(Extension(deadline.clone())).layer(Extension(arrival)),
    );
    let connection = builder.serve_connection(TokioIo::new(stream), service).with_upgrades();
    tokio::select! {
        // A broken request concerns its sender alone.
        _ = connection => {}
        () = deadline.pass() => {}
    }
}
