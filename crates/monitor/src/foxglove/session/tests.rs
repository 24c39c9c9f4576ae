//! What a viewer may do, what it loses, and what is refused.

use serde_json::Value;

use super::*;

fn data(size: usize) -> Arc<[u8]> {
    vec![7; size].into()
}

/// The next status for the viewer: level and text.
fn told(session: &mut Session) -> (u64, String) {
    let Some(Message::Text(text)) = session.take(Instant::now()) else { panic!("a text") };
    let status: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(status["op"], "status", "{status}");
    (status["level"].as_u64().unwrap(), status["message"].as_str().unwrap().to_owned())
}

fn subscribed(pairs: &[(u32, u32)]) -> Session {
    let mut session = Session::default();
    for (id, channel) in pairs {
        let text = format!(
            r#"{{"op":"subscribe","subscriptions":[{{"id":{id},"channelId":{channel}}}]}}"#
        );
        session.receive(&text, 10);
    }
    assert_eq!(session.take(Instant::now()), None);
    session
}

#[test]
fn a_message_has_the_number_that_the_viewer_gave_and_the_time() {
    let mut session = subscribed(&[(0x0102_0304, 3)]);
    session.offer(2, 1, &data(4));
    session.offer(3, 0x1122_3344_5566_7788, &data(2));
    let expected =
        [[1].as_slice(), &[4, 3, 2, 1], &[0x88, 0x77, 0x66, 0x55, 0x44, 0x33, 0x22, 0x11], &[7, 7]];
    assert_eq!(session.take(Instant::now()), Some(Message::Binary(expected.concat().into())));
    assert_eq!(session.take(Instant::now()), None);
}

#[test]
fn a_slow_viewer_loses_the_oldest_messages_and_is_told_how_many() {
    let mut session = subscribed(&[(1, 0)]);
    let most = MOST_BYTES / 1024;
    for time in 0..most as u64 + 5 {
        session.offer(0, time, &data(1024));
    }
    assert_eq!(
        told(&mut session),
        (1, "5 messages are lost here: this viewer is too slow".to_owned())
    );
    let Some(Message::Binary(message)) = session.take(Instant::now()) else { panic!("a message") };
    assert_eq!(message[5..13], 5u64.to_le_bytes());
    // At most one such text comes in a second.
    for time in 0..3 {
        session.offer(0, time, &data(1024));
    }
    let now = Instant::now();
    assert!(matches!(session.take(now), Some(Message::Binary(_))));
    let Some(Message::Text(text)) = session.take(now + SAID) else { panic!("a text") };
    assert!(text.contains("2 messages are lost"), "{text}");
    while session.take(now + SAID).is_some() {}
    assert_eq!((session.bytes, session.messages.len()), (0, 0));
}

#[test]
fn one_message_that_is_longer_than_the_queue_is_lost_too() {
    let mut session = subscribed(&[(1, 0)]);
    session.offer(0, 1, &data(MOST_BYTES + 1));
    assert_eq!((session.lost, session.bytes), (1, 0));
}

#[test]
fn nothing_of_a_subscription_comes_after_its_end() {
    let mut session = subscribed(&[(1, 0), (2, 1)]);
    session.offer(0, 1, &data(10));
    session.offer(1, 2, &data(20));
    session.receive(r#"{"op":"unsubscribe","subscriptionIds":[1]}"#, 10);
    assert_eq!(session.bytes, 20);
    session.offer(0, 3, &data(10));
    let Some(Message::Binary(message)) = session.take(Instant::now()) else { panic!("a message") };
    assert_eq!(message[1], 2);
    assert_eq!(session.take(Instant::now()), None);
    session.receive(r#"{"op":"unsubscribe","subscriptionIds":[1]}"#, 10);
    assert_eq!(told(&mut session), (2, "there is no subscription 1".to_owned()));
}

#[test]
fn a_wrong_subscription_is_refused_and_those_before_it_hold() {
    let mut session = subscribed(&[(1, 0)]);
    let subscribe = |id: i64, channel: i64| {
        format!(r#"{{"op":"subscribe","subscriptions":[{{"id":{id},"channelId":{channel}}}]}}"#)
    };
    for (id, channel, why) in [
        (2, 10, "there is no channel 10"),
        (1, 2, "the subscription 1 is in use"),
        (2, 0, "the channel 0 has a subscription already"),
    ] {
        session.receive(&subscribe(id, channel), 10);
        assert_eq!(told(&mut session), (2, why.to_owned()));
    }
    for (id, channel) in [(-1, 1), (1 << 32, 1), (2, -1)] {
        session.receive(&subscribe(id, channel), 10);
        let (level, why) = told(&mut session);
        assert!(level == 2 && why.starts_with("this is not a message: "), "{why}");
    }
    assert_eq!(session.subscriptions, BTreeMap::from([(0, 1)]));
}

#[test]
fn what_is_no_reading_is_refused() {
    for op in [
        "advertise",
        "unadvertise",
        "getParameters",
        "setParameters",
        "subscribeParameterUpdates",
        "subscribeConnectionGraph",
        "fetchAsset",
        "playbackControl",
        "stop",
    ] {
        let mut session = Session::default();
        session.receive(&format!(r#"{{"op":"{op}","parameters":[{{"name":"x","value":1}}]}}"#), 10);
        let why = format!("this server is for reading alone: it does not do \"{op}\"");
        assert_eq!(told(&mut session), (2, why));
    }
    let mut session = Session::default();
    session.receive_binary();
    assert_eq!(told(&mut session).0, 2);
}

#[test]
fn texts_that_are_no_messages_are_refused_and_not_repeated() {
    let deep = "[".repeat(60_000);
    let long = format!(r#"{{"op":"{}"}}"#, "\u{1F600}".repeat(10_000));
    for text in ["", "{", "null", "[]", "{}", r#"{"op":5}"#, r#"{"op":"subscribe"}"#, &deep, &long]
    {
        let mut session = Session::default();
        session.receive(text, 10);
        let (level, why) = told(&mut session);
        assert!(level == 2 && why.len() < 300, "{why}");
    }
}

#[test]
fn a_viewer_that_reads_no_refusal_is_flooded() {
    let mut session = Session::default();
    (0..MOST_TEXTS).for_each(|_| session.receive("", 10));
    assert!(!session.is_flooded());
    session.receive("", 10);
    assert!(session.is_flooded());
}
