//! The session that turns the motors of a page ends with a reason.

use crate::world::{LIMIT, World, connect};
use motorlink_proto::st::Profile;
use motorlink_telemetry::share::client::{Listener, Program, Refusal};
use motorlink_telemetry::share::message::{Answer, Ask, Event, EventKind, Reason, Text, decode};
use tokio::time::timeout;

/// A speed of 360 °/s.
const TURN: [u8; 8] = [0xA2, 0, 0, 0, 0xA0, 0x8C, 0, 0];

/// A program that turned motor 1 of the bus.
async fn turning(world: &World) -> Program {
    let (drive, _) = connect(&world.share.path, "page 4 (control)").await;
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
    drive
}

async fn event(watcher: &mut Listener, wanted: EventKind) -> Event {
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

#[tokio::test]
async fn the_motors_of_a_page_stop_and_the_log_says_why_if_the_share_takes_the_reason() {
    let world = World::new("leaving", Profile::Spec);
    let (_, mut watcher, _) = Program::connect(&world.share(), "watcher").await.unwrap();
    let why = "the page gave no sign of life for 300 ms";
    // The long one as at a share of an earlier version, which does not know the request.
    for (why, told) in [(why, format!(": {why}")), ("x".repeat(1000).as_str(), String::new())] {
        let drive = turning(&world).await;
        drive.close_because(Refusal::new(Reason::Lapsed, why));
        let left = event(&mut watcher, EventKind::Left).await;
        assert_eq!(left.message, format!("page 4 (control) left{told}"));
        let stopping = event(&mut watcher, EventKind::Stopping).await.message;
        assert!(stopping.ends_with(&format!("has left{told}")), "{stopping}");
        world.reaches("rmd1.speed_dps", |dps| dps.abs() < 5.0).await;
    }
}
