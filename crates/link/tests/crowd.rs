//! Many clients that send at full speed to one served CAN bus.

use std::io::{ErrorKind, Read, Write};
use std::net::TcpStream;
use std::time::Duration;

use motorlink_link::serve::ServeName;
use motorlink_link::serve::{MOST_CLIENTS, Server, Station};
use motorlink_proto::can::CanFrame;
use motorlink_proto::time::Instant;

/// Receives, and sends nothing.
struct Silent;

impl Station<CanFrame> for Silent {
    fn receive(&mut self, _: Instant, _: &[CanFrame], _: &mut Vec<CanFrame>) {}
}

/// Peak memory of this process, KiB.
fn peak() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").expect("this system tells");
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).expect("a peak");
    line.trim().trim_end_matches(" kB").parse().expect("a number")
}

#[test]
fn many_clients_that_flood_a_bus_use_little_memory() {
    let name: ServeName = "tcp-listen:127.0.0.1:0".parse().expect("a name");
    let mut server = Server::new();
    let address = server.serve_can(&name, Box::new(Silent)).expect("served").path;
    let mut crowd: Vec<TcpStream> = (0..300)
        .map(|_| {
            let client = TcpStream::connect(&address).expect("connected");
            server.turn(Duration::from_millis(100), None).expect("a turn");
            client.set_nonblocking(true).expect("set");
            client
        })
        .collect();
    let stayed = |client: &mut TcpStream| matches!(client.read(&mut [0; 64]), Err(error) if error.kind() == ErrorKind::WouldBlock);
    let staying: Vec<bool> = crowd.iter_mut().map(stayed).collect();
    assert_eq!(staying.iter().filter(|stays| **stays).count(), MOST_CLIENTS);

    let flood = [&b"O\r"[..], &b"t14189C00000000000000\r".repeat(1000)].concat();
    for client in &mut crowd {
        // Bytes that the kernel does not accept, and closed clients, do not matter.
        let _ = client.write(&flood);
    }
    let before = peak();
    for _ in 0..20 {
        server.turn(Duration::ZERO, None).expect("a turn");
    }
    let grown = peak() - before;
    assert!(grown < 16 * 1024, "{grown} KiB more");
    let heard = crowd[0].read(&mut vec![0; 1 << 20]).expect("frames of the others");
    assert!(heard > 10_000, "{heard} bytes");
}
