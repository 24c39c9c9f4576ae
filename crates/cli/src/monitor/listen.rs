//! Where browsers connect.

use std::net::{IpAddr, Ipv4Addr, SocketAddr, TcpListener};
use std::path::PathBuf;

use motorlink_monitor::server::Tls;

use crate::failure::Failure;
use crate::output::note;

/// The usual address.
const USUAL: SocketAddr = SocketAddr::new(IpAddr::V4(Ipv4Addr::LOCALHOST), 8707);
/// Ports that are tried if the usual one is taken.
const TRIED: u16 = 100;

#[derive(clap::Args)]
pub struct Listen {
    /// Where browsers connect: ADDRESS:PORT [default: 127.0.0.1:8707, or the next free port]
    #[arg(long, value_name = "ADDRESS:PORT")]
    listen: Option<SocketAddr>,
    /// A name of this computer that browsers use; may be repeated
    #[arg(long = "name", value_name = "HOST")]
    names: Vec<String>,
    /// The certificates for TLS, as PEM: that of this computer first
    #[arg(long, value_name = "FILE", requires = "tls_key", value_hint = clap::ValueHint::FilePath)]
    tls_cert: Option<PathBuf>,
    /// The private key of the first certificate, as PEM
    #[arg(long, value_name = "FILE", requires = "tls_cert", value_hint = clap::ValueHint::FilePath)]
    tls_key: Option<PathBuf>,
    /// Where programs read the same data that have no token, PlotJuggler for one: 127.0.0.1:8765
    #[arg(long, value_name = "ADDRESS:PORT")]
    foxglove: Option<SocketAddr>,
    /// Let --listen and --foxglove have an address of the network without TLS. Anybody there can read
    /// the tokens
    #[arg(long)]
    insecure: bool,
    /// Let operators open lines at any TCP address that this computer reaches. Without --listen, or
    /// with a --listen of this computer alone, they may
    #[arg(long)]
    open_addresses: bool,
}

impl Listen {
    /// Opens the port.
    pub fn bind(&self) -> Result<TcpListener, Failure> {
        let Some(address) = self.listen else { return bind_usual() };
        let is_private = address.ip().is_loopback() || self.tls_cert.is_some() || self.insecure;
        if !is_private {
            return Err(Failure::usage(format!(
                "--listen {address} is for the network, where anybody can read the tokens"
            ))
            .trying("give --tls-cert and --tls-key, or --insecure if you trust the network"));
        }
        TcpListener::bind(address).map_err(|error| refused(address, &error))
    }

    /// Opens the port for programs without a token.
    pub fn bind_foxglove(&self) -> Result<Option<TcpListener>, Failure> {
        let Some(address) = self.foxglove else { return Ok(None) };
        if !address.ip().is_loopback() && !self.insecure {
            return Err(Failure::usage(format!(
                "--foxglove {address} is for the network, where anybody can read the drives"
            ))
            .trying("give an address of this computer, or --insecure if you trust the network"));
        }
        let failed = |error| {
            Failure::link(format!("cannot listen on {address}: {error}"))
                .trying("give another --foxglove, such as --foxglove 127.0.0.1:0 for any free port")
        };
        TcpListener::bind(address).map(Some).map_err(failed)
    }

    /// The certificate, if there is one.
    pub fn tls(&self) -> Result<Option<Tls>, Failure> {
        let Some((cert, key)) = self.tls_cert.as_ref().zip(self.tls_key.as_ref()) else {
            return Ok(None);
        };
        let tls = Tls::read(cert, key);
        tls.map(Some).map_err(|error| Failure::usage(error.to_string()))
    }

    /// The host in the addresses for browsers.
    pub fn host(&self) -> String {
        let ip = self.listen.unwrap_or(USUAL).ip();
        match self.names.first() {
            Some(name) => name.clone(),
            // Browsers on this computer.
            None if ip.is_unspecified() => USUAL.ip().to_string(),
            None if ip.is_ipv6() => format!("[{ip}]"),
            None => ip.to_string(),
        }
    }

    /// Whether pages open lines at addresses in a network. Who can connect from another computer would
    /// reach what this one reaches.
    pub fn opens_addresses(&self) -> bool {
        self.open_addresses || self.listen.unwrap_or(USUAL).ip().is_loopback()
    }

    pub fn names(&self) -> Vec<String> {
        self.names.clone()
    }
}

fn bind_usual() -> Result<TcpListener, Failure> {
    let ports = USUAL.port()..=USUAL.port() + TRIED;
    let all: Vec<SocketAddr> = ports.map(|port| SocketAddr::new(USUAL.ip(), port)).collect();
    let listener = TcpListener::bind(&all[..]).map_err(|error| refused(USUAL, &error))?;
    let port = listener.local_addr()?.port();
    if port != USUAL.port() {
        note(format!("port {} is taken; this is port {port}", USUAL.port()));
    }
    Ok(listener)
}

fn refused(address: SocketAddr, error: &std::io::Error) -> Failure {
    Failure::link(format!("cannot listen on {address}: {error}"))
        .trying("give another --listen, such as --listen 127.0.0.1:0 for any free port")
}
