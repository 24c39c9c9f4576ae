//! The connection of the server to a share that ends and is started again.

use std::sync::Arc;
use std::time::Duration;

use crate::drive_writes::{limit, limits};
use crate::world::{LIMIT, Page, World, st};
use motorlink_monitor::message::Mode;
use motorlink_monitor::server::share_link::ShareLink;
use motorlink_proto::st::Profile;
use motorlink_telemetry::share::client::{Listener, Program};
use motorlink_telemetry::share::message::{Answer, Ask, EventKind, Reason, Text, decode};
use tokio::time::timeout;

const TURN: [u8; 8] = [0xA2, 0, 0, 0, 0xA0, 0x8C, 0, 0];
const STOP: u8 = 0x81;

fn turn() -> Ask {
    let (line, bytes) = ("rmd0".to_owned(), TURN.to_vec());
    Ask::Command { line, motor: 1, bytes, time_to_live: 10.0, continues: false, own: false }
}

/// A link whose share has ended.
async fn lost(name: &str) -> Arc<ShareLink> {
    lost_of(name, |link| link).await
}

async fn lost_of(name: &str, with: fn(ShareLink) -> ShareLink) -> Arc<ShareLink> {
    let world = World::new(name, Profile::Spec);
    let link = joined(with(ShareLink::new(world.share()))).await;
    drop(world);
    joins(&link, false).await;
    link
}

/// A link that is kept and connected.
async fn joined(link: ShareLink) -> Arc<ShareLink> {
    let link = Arc::new(link);
    let kept = Arc::clone(&link);
    tokio::spawn(async move { kept.keep().await });
    joins(&link, true).await;
    link
}

/// Waits until the server itself is connected to the share, or is not.
async fn joins(link: &ShareLink, is_joined: bool) {
    let joins = async {
        while link.drives().await.is_ok() != is_joined {
            tokio::task::yield_now().await;
        }
    };
    timeout(LIMIT, joins).await.unwrap();
}

/// The first connection of a page to the share that was started again.
async fn connected(link: &ShareLink) -> Program {
    let connected = async {
        loop {
            if let Ok((program, listener, _)) = link.connect("page 1 (control)").await {
                tokio::spawn(listen(listener));
                return program;
            }
            tokio::task::yield_now().await;
        }
    };
    timeout(LIMIT, connected).await.unwrap()
}

async fn listen(mut listener: Listener) {
    while listener.next().await.is_ok() {}
}

async fn released(events: &mut Listener) {
    loop {
        let text = decode(&events.next().await.unwrap().payload);
        if matches!(text, Ok(Text::Event(event)) if event.event == EventKind::Released) {
            return;
        }
    }
}

async fn latched_by(program: &Program) -> Option<String> {
    match program.ask(Ask::Lines).await {
        Ok(Answer::Lines { latched_by, .. }) => latched_by,
        other => panic!("{other:?}"),
    }
}

/// The code of the first command that ended or began motion of RMD motor 1.
async fn first_motion(world: &World) -> u8 {
    let moved = async {
        while world.rmd_motion(1).is_empty() {
            tokio::task::yield_now().await;
        }
    };
    timeout(LIMIT, moved).await.unwrap();
    world.rmd_motion(1)[0][0]
}

#[tokio::test]
async fn a_stop_that_a_lost_share_did_not_get_is_sent_before_a_page_can_move_a_motor() {
    let link = lost("link-stop").await;
    let refusal = link.stop_all().await.unwrap_err();
    assert_eq!(refusal.reason, Reason::Line);
    assert!(
        refusal.message.starts_with("the share is lost: ")
            && refusal.message.ends_with(". If it is back within 10 s, the stop is sent"),
        "{}",
        refusal.message
    );

    let world = World::new("link-stop", Profile::Spec);
    let page = connected(&link).await;
    assert_eq!(page.ask(turn()).await.unwrap_err().reason, Reason::Latched);
    assert_eq!(first_motion(&world).await, STOP);

    // It is sent once.
    assert!(matches!(page.ask(Ask::Release).await, Ok(Answer::Release)));
    let other = connected(&link).await;
    joins(&link, true).await;
    assert_eq!(latched_by(&other).await, None);
    assert!(matches!(other.ask(turn()).await, Ok(Answer::Command { .. })));
}

#[tokio::test]
async fn a_stop_that_is_too_old_is_not_sent() {
    let link = lost_of("link-old", |link| link.with_stops_waiting(Duration::ZERO)).await;
    link.stop_all().await.unwrap_err();
    let _world = World::new("link-old", Profile::Spec);
    let page = connected(&link).await;
    assert_eq!(latched_by(&page).await, None);
    assert!(matches!(page.ask(turn()).await, Ok(Answer::Command { .. })));
}

#[tokio::test]
async fn a_latch_holds_for_a_share_that_is_started_again_and_stops_its_motors() {
    let world = World::new("link-latch", Profile::Spec);
    let link = joined(ShareLink::new(world.share())).await;
    link.stop_all().await.unwrap();
    drop(world);
    joins(&link, false).await;
    let world = World::new("link-latch", Profile::Spec);
    let page = connected(&link).await;
    assert!(latched_by(&page).await.is_some());
    assert_eq!(page.ask(turn()).await.unwrap_err().reason, Reason::Latched);
    // They may not have confirmed the stop before.
    assert_eq!(first_motion(&world).await, STOP);
    // A release holds, too.
    joins(&link, true).await;
    let (_program, mut events, _) = link.connect("looks").await.unwrap();
    page.ask(Ask::Release).await.unwrap();
    page.ask(turn()).await.unwrap();
    // The share tells programs in the order in which they came, and the link came before.
    timeout(LIMIT, released(&mut events)).await.unwrap();
    drop(world);
    joins(&link, false).await;
    let _world = World::new("link-latch", Profile::Spec);
    assert_eq!(latched_by(&connected(&link).await).await, None);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn limits_of_pages_hold_when_the_share_has_other_lines() {
    let world = World::new("link-limits", Profile::Spec);
    let link = joined(ShareLink::new(world.share())).await;
    let before = link.drives().await.unwrap();
    let page = Page { drives: before.clone(), ..world.page().await };
    page.ask(limit(st(1), Mode::Speed, Some(1000.0))).await.unwrap();
    page.view.ask(Ask::Close { line: "rmd0".to_owned() }).await.unwrap();
    timeout(LIMIT, link.other_lines(&before)).await.unwrap();
    let page = Page { drives: link.drives().await.unwrap(), ..page };
    assert_eq!(limits(&page).await, [("st0".to_owned(), 1, Mode::Speed, 1000.0)]);
}
