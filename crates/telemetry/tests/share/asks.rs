//! What a line of a share as a port asks the share.

use std::io::{Read, Write};
use std::os::unix::net::UnixListener;
use std::path::Path;
use std::sync::mpsc::{Sender, channel};

use motorlink::rmd::{Asked, Client, MotorId};
use motorlink_telemetry::share::frame::{self, Kind, Reader};
use motorlink_telemetry::share::message::{
    Answer, Ask, Line, Protocol, Request, Text, decode, encode,
};
use motorlink_telemetry::share::{VERSION, port};

/// A share with one bus, for one program. All motors answer each command.
fn share(path: &Path, asks: Sender<Ask>) {
    let listener = UnixListener::bind(path).unwrap();
    std::thread::spawn(move || {
        let (mut program, _) = listener.accept().unwrap();
        let (mut reader, mut received) = (Reader::default(), [0; 4096]);
        while let Ok(size @ 1..) = program.read(&mut received) {
            reader.push(&received[..size]);
            while let Some(frame) = reader.take().unwrap() {
                let Request { id, ask } = decode(&frame.payload).unwrap();
                let text = encode(&Text::Answer { id, answer: answer(&ask) });
                let mut bytes = Vec::new();
                frame::append(Kind::Text, &text, &mut bytes).unwrap();
                let _ = program.write_all(&bytes);
                let _ = asks.send(ask);
            }
        }
    });
}

fn answer(ask: &Ask) -> Answer {
    match ask {
        Ask::Hello { .. } => {
            Answer::Hello { protocol: VERSION, share: "test".to_owned(), name: "test".to_owned() }
        }
        Ask::Lines => {
            let (line, port) = ("rmd0".to_owned(), "can0".to_owned());
            let (protocol, profile) = (Protocol::Rmd, None);
            let line = Line {
                line,
                protocol,
                port,
                profile,
                timeout: 5.0,
                t: 0.0,
                wall: 0.0,
                counts: None,
                heard: Vec::new(),
                unstopped: Vec::new(),
            };
            Answer::Lines { lines: vec![line], latched_by: None }
        }
        Ask::Command { bytes, .. } => Answer::Command { bytes: [&bytes[..1], &[7; 7]].concat() },
        _ => Answer::Confirm,
    }
}

#[test]
fn each_of_many_motors_is_confirmed_at_once() {
    let folder: &Path = env!("CARGO_TARGET_TMPDIR").as_ref();
    let path = folder.join(format!("share-asks-{}", std::process::id()));
    let (asks, asked) = channel();
    share(&path, asks);
    port::register();
    let port = format!("share:{}/rmd0", path.display()).parse().unwrap();
    let client = Client::open(&port, Default::default()).unwrap();
    let motors = [1, 2, 3].map(|id| (MotorId::new(id).unwrap(), Asked::Confirmation));
    client.ask_each(&motors, |id, reply, _| assert!(reply.is_ok(), "{id}")).unwrap();
    drop(client);
    let confirmed: Vec<u8> = asked
        .iter()
        .filter_map(|ask| match ask {
            Ask::Confirm { motor, .. } => Some(motor),
            _ => None,
        })
        .collect();
    assert_eq!(confirmed, [1, 2, 3]);
    std::fs::remove_file(path).unwrap();
}
