//! The web server: the page, its files, and a WebSocket for each page.
//!
//! [`Server::start`] serves in threads of its own, until it is dropped.

mod assets;
mod auth;
mod connections;
mod recordings;
mod routes;
pub mod share_link;
mod socket;
mod state;
mod tls;

use std::io;
use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use motorlink_telemetry::share::address::Address;
use tokio::runtime::{Builder, Runtime};

pub use auth::random_word;
pub use state::Settings;
pub use tls::{Tls, TlsError};

use crate::message::Role;
use crate::recordings::Recordings;
use auth::Auth;
use share_link::ShareLink;
use state::State;

/// The usual deadline of a page that turned motors.
pub const DEADLINE: Duration = Duration::from_millis(300);
/// How long the last messages may take.
const LAST: Duration = Duration::from_millis(500);

/// What to serve.
pub struct Options {
    /// Where browsers connect.
    pub listener: TcpListener,
    /// Without it, requests are not encrypted.
    pub tls: Option<Tls>,
    /// Names of this machine that browsers may use, besides its addresses.
    pub names: Vec<String>,
    /// Where programs connect that speak Foxglove's protocol without a token.
    pub foxglove: Option<TcpListener>,
    /// The share.
    pub share: Arc<dyn Address>,
    /// The folder of recordings. The first recording makes it.
    pub recordings: PathBuf,
    /// What pages may do, and what they are told.
    pub settings: Settings,
}

/// A web server that runs.
pub struct Server {
    runtime: Option<Runtime>,
    state: Arc<State>,
    address: SocketAddr,
    bare: Option<SocketAddr>,
}

impl Server {
    /// Serves these. The share has to run for what pages ask of it, but not for this.
    ///
    /// # Errors
    /// The system gives no threads, sockets or random numbers.
    pub fn start(options: Options) -> io::Result<Self> {
        let Options { listener, tls, names, foxglove, share, recordings, settings } = options;
        let address = listener.local_addr()?;
        let bare_address = foxglove.as_ref().map(TcpListener::local_addr).transpose()?;
        let auth = Auth::new(address.port(), tls.is_some(), names)?;
        let recordings = Recordings::new(recordings, Arc::clone(&share));
        let state = Arc::new(State::new(auth, ShareLink::new(share), recordings, settings)?);
        let runtime = Builder::new_multi_thread()
            .worker_threads(2)
            .thread_name("monitor")
            .enable_all()
            .build()?;
        let (listener, bare) = {
            let _inside = runtime.enter();
            (nonblocking(listener)?, foxglove.map(nonblocking).transpose()?)
        };
        let tls = tls.as_ref().map(Tls::acceptor);
        let link = Arc::clone(&state.link);
        runtime.spawn(async move { link.keep().await });
        runtime.spawn(connections::serve(listener, tls, routes::router(Arc::clone(&state))));
        if let Some(bare) = bare {
            let router = routes::bare_router(Arc::clone(&state));
            runtime.spawn(connections::serve(bare, None, router));
        }
        Ok(Server { runtime: Some(runtime), state, address, bare: bare_address })
    }

    /// The address that a person of this role opens. `host` is this machine.
    pub fn url(&self, host: &str, role: Role) -> String {
        let (port, token) = (self.address.port(), self.state.auth.token(role));
        format!("{}://{host}:{port}/?token={token}", self.state.auth.scheme())
    }

    /// The address for programs that speak Foxglove's protocol: with the token of viewers.
    pub fn foxglove_url(&self, host: &str) -> String {
        let (port, token) = (self.address.port(), self.state.auth.token(Role::Viewer));
        let scheme = if self.state.auth.scheme() == "https" { "wss" } else { "ws" };
        format!("{scheme}://{host}:{port}{}?token={token}", routes::VIEWER_PATH)
    }

    /// The address of [`Options::foxglove`].
    pub fn bare_url(&self) -> Option<String> {
        let mut address = self.bare?;
        if address.ip().is_unspecified() {
            address.set_ip(Ipv4Addr::LOCALHOST.into());
        }
        Some(format!("ws://{address}"))
    }
}

fn nonblocking(listener: TcpListener) -> io::Result<tokio::net::TcpListener> {
    listener.set_nonblocking(true)?;
    tokio::net::TcpListener::from_std(listener)
}

impl Drop for Server {
    fn drop(&mut self) {
        self.state.recordings.close();
        if let Some(runtime) = self.runtime.take() {
            runtime.shutdown_timeout(LAST);
        }
    }
}
