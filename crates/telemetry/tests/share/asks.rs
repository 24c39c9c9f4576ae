//! What a line of a share as a port asks the share.

use std::os::unix::net::UnixListener;
use std::path::Path;
use std::sync::mpsc::{Sender, channel};

use crate::scripted::{Scripted, line};
use motorlink::rmd::{Asked, Client, MotorId};
use motorlink_telemetry::share::message::{Answer, Ask, Line, Protocol, Request};
use motorlink_telemetry::share::port;

/// A share with one bus, for one program. All motors answer each command.
fn share(path: &Path, asks: Sender<Ask>) {
    let listener = UnixListener::bind(path).unwrap();
    std::thread::spawn(move || {
        let mut share = Scripted::accept(&listener);
        let line = || Line { timeout: 5.0, ..line("rmd0", Protocol::Rmd) };
        while let Some(Request { id, ask }) = share.asked(line) {
            let answer = match &ask {
                Ask::Command { bytes, .. } => {
                    Answer::Command { bytes: [&bytes[..1], &[7; 7]].concat() }
                }
                _ => Answer::Confirm,
            };
            share.answer(id, answer);
            let _ = asks.send(ask);
        }
    });
}

#[test]
fn each_of_many_motors_is_confirmed_at_once() {
    let path = crate::drives::path("share-asks", "socket");
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
