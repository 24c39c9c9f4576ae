//! A served port while the process has no free descriptors. It is its own process, because the
//! limit applies to the whole process.

use std::fs::File;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use motorlink_link::serve::{Server, Station};
use motorlink_proto::time::Instant as Moment;
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};

struct Echo;

impl Station<u8> for Echo {
    fn receive(&mut self, _: Moment, bytes: &[u8], reply: &mut Vec<u8>) {
        reply.extend_from_slice(bytes);
    }
}

#[test]
fn without_free_descriptors_a_client_waits_and_the_server_does_not_spin() {
    let mut server = Server::new();
    let name = "tcp-listen:127.0.0.1:0".parse().expect("a name");
    let served = server.serve_bytes(&name, Box::new(Echo)).expect("served");
    let mut client = TcpStream::connect(served.path).expect("the kernel takes it");
    client.write_all(b"hello").expect("the kernel takes it");

    let maximum = getrlimit(Resource::Nofile).maximum;
    setrlimit(Resource::Nofile, Rlimit { current: Some(64), maximum }).expect("lower is allowed");
    let mut hoard: Vec<File> = Vec::new();
    while let Ok(file) = File::open("/dev/null") {
        hoard.push(file);
    }
    assert!(!hoard.is_empty());

    let (began, mut turns) = (Instant::now(), 0);
    while began.elapsed() < Duration::from_millis(500) {
        server.turn(Duration::from_secs(5), None).expect("a turn");
        turns += 1;
    }
    assert!(turns < 50, "{turns} turns in half a second");

    drop(hoard);
    let mut said = [0; 5];
    client.set_nonblocking(true).expect("set");
    while client.read_exact(&mut said).is_err() {
        server.turn(Duration::from_millis(10), None).expect("a turn");
    }
    assert_eq!(&said, b"hello");
}
