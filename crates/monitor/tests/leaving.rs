//! The session that turns the motors of a page ends with a reason.

use crate::world::{LIMIT, World, connect};
use motorlink_proto::st::Profile;
use motorlink_telemetry::share::message::{Answer, Ask, Event, Happening, Reason, Text, decode};
use motorlink_telemetry::share::program::{Listener, Program, Refusal};
use tokio::time::timeout;

/// A speed of 360 °/s.
const TURN: [u8; 8] = [0xA2, 0, 0, 0, 0xA0, 0x8C, 0, 0];

/// A program that turned motor 1 of the bus, and one that sees the log.
async fn turning(world: &World) -> (Program, Listener) {
    let (_, watcher, _) = Program::connect(&world.share(), "watcher").await.unwrap();
    let (drive, _) = connect(&world.path, "page 4 (control)").await;
    let command = Ask::Command {
        line: "rmd0".to_owned(),
        motor: 1,
        bytes: TURN.to_vec(),
        time_to_live: 10.0,
        continues: false,
        own: false,
    };
    assert!(matches!(drive.ask(command).await, Ok(Answer::Command { .. })));
    world.reaches("rmd1.speed_dps", |dps| dps > 300.0).await;
    (drive, watcher)
}

async fn event(watcher: &mut Listener, wanted: Happening) -> Event {
    let found = async {
        loop {
            let frame = watcher.next().await.unwrap();
            if let Ok(Text::Event(event)) = decode(&frame.payload)
                && event.event == wanted
            {
                return event;
            }
        }
    };
    timeout(LIMIT, found).await.expect("the event comes")
}

fn lapsed(message: &str) -> Refusal {
    Refusal::new(Reason::Lapsed, message)
}

#[tokio::test]
async fn the_log_says_why_the_motors_of_a_page_stop() {
    let world = World::new("leaving", Profile::Spec);
    let (drive, mut watcher) = turning(&world).await;
    drive.close_because(lapsed("the page gave no sign of life for 300 ms"));
    let left = event(&mut watcher, Happening::Left).await;
    assert_eq!(left.message, "page 4 (control) left: the page gave no sign of life for 300 ms");
    let stopping = event(&mut watcher, Happening::Stopping).await.message;
    assert!(stopping.ends_with("has left: the page gave no sign of life for 300 ms"), "{stopping}");
    world.reaches("rmd1.speed_dps", |dps| dps.abs() < 5.0).await;
}

#[tokio::test]
async fn the_motors_stop_if_the_share_does_not_take_the_reason() {
    let world = World::new("leaving-refused", Profile::Spec);
    let (drive, mut watcher) = turning(&world).await;
    // As at a share of an earlier version, which does not know the request.
    drive.close_because(lapsed(&"x".repeat(1000)));
    assert_eq!(event(&mut watcher, Happening::Left).await.message, "page 4 (control) left");
    world.reaches("rmd1.speed_dps", |dps| dps.abs() < 5.0).await;
}
