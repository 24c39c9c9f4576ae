//! The name of a served port.

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

use crate::port::{NameError, check_printable, host_and_port, present, unknown_form};

const FORMS: &str = "served ports are pty:PATH, slcan-pty:PATH, unix-listen:PATH, \
    tcp-listen:ADDR:PORT and socketcan:INTERFACE";

/// A port to serve.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum ServeName {
    /// `pty:PATH`: a serial line; PATH becomes a link to the pty.
    Pty(PathBuf),
    /// `slcan-pty:PATH`: a CAN adapter that speaks slcan on a pty.
    SlcanPty(PathBuf),
    /// `tcp-listen:ADDR:PORT`: the same on a TCP server; port 0 selects any free one.
    TcpListen {
        /// The address to listen on.
        host: String,
        /// The TCP port.
        port: u16,
    },
    /// `unix-listen:PATH`: the same on a Unix socket, for the user who serves it.
    UnixListen(PathBuf),
    /// `socketcan:can1`: a CAN interface of this machine, for a bus of motors.
    SocketCan(String),
}

impl FromStr for ServeName {
    type Err = NameError;

    fn from_str(name: &str) -> Result<Self, NameError> {
        check_printable(name)?;
        let path = |path, example| present(name, path, "a path", example).map(PathBuf::from);
        match name.split_once(':') {
            Some(("pty", rest)) => path(rest, "pty:./st0").map(ServeName::Pty),
            Some(("slcan-pty", rest)) => path(rest, "slcan-pty:./can0").map(ServeName::SlcanPty),
            Some(("unix-listen", rest)) => {
                path(rest, "unix-listen:./drive").map(ServeName::UnixListen)
            }
            Some(("tcp-listen", rest)) => {
                let (host, port) = host_and_port(name, rest, "tcp-listen:127.0.0.1:4000")?;
                Ok(ServeName::TcpListen { host, port })
            }
            Some(("socketcan", rest)) => {
                let interface = present(name, rest, "an interface", "socketcan:can0")?;
                Ok(ServeName::SocketCan(interface.to_owned()))
            }
            _ => {
                let path = name.rsplit(':').next().filter(|path| !path.is_empty());
                let nearest = format!("pty:{}", path.unwrap_or("./st0"));
                Err(unknown_form(name, Some(nearest), FORMS.to_owned()))
            }
        }
    }
}

impl fmt::Display for ServeName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ServeName::Pty(path) => write!(f, "pty:{}", path.display()),
            ServeName::SlcanPty(path) => write!(f, "slcan-pty:{}", path.display()),
            ServeName::UnixListen(path) => write!(f, "unix-listen:{}", path.display()),
            ServeName::TcpListen { host, port } => write!(f, "tcp-listen:{host}:{port}"),
            ServeName::SocketCan(interface) => write!(f, "socketcan:{interface}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn a_wrong_name_is_refused_with_a_valid_form() {
        for (name, says) in [
            ("st0", "did you mean `pty:st0`?"),
            ("can0", "tcp-listen:ADDR:PORT and socketcan:INTERFACE"),
            ("socketcan:", "lacks an interface; write it like socketcan:can0"),
        ] {
            let message = name.parse::<ServeName>().expect_err("no served port").to_string();
            assert!(message.contains(says), "{name:?} gave: {message}");
        }
    }

    proptest! {
        #[test]
        fn a_printed_serve_name_reads_back(path in "[./a-z0-9:]{1,20}", port: u16) {
            let listen = ServeName::TcpListen { host: "[::]".into(), port };
            let interface = ServeName::SocketCan(path.clone());
            let pty = ServeName::Pty(path.clone().into());
            for name in [pty, ServeName::SlcanPty(path.into()), listen, interface] {
                prop_assert_eq!(name.to_string().parse(), Ok(name));
            }
        }

        #[test]
        fn any_text_is_parsed_or_refused(text in "\\PC{0,40}") {
            let _ = text.parse::<ServeName>().map_err(|error| error.to_string());
        }
    }
}
