//! Requests of pages on lines that fail: no wrong value, and what is known after a failure.

use std::os::fd::BorrowedFd;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crate::world::{LIMIT, Page, World, rmd, st};
use motorlink::port::{ByteLink, EventBytes, Evented, FaultCan, Link, PortError};
use motorlink_link::fault::Faults;
use motorlink_monitor::message::{Answer, Ask};
use motorlink_proto::rmd::IDENTIFIERS;
use motorlink_proto::st::Profile;
use motorlink_telemetry::share::message::{MotorName, Reason};

fn read(motor: MotorName, name: &str) -> Ask {
    Ask::Read { motor, names: vec![name.to_owned()] }
}

fn write(motor: MotorName, name: &str, value: f64) -> Ask {
    Ask::Write { motor, name: name.to_owned(), value, to_rom: false }
}

/// Writes a value, however often it takes.
async fn set(page: &Page, motor: MotorName, name: &str, value: f64) {
    let end = Instant::now() + LIMIT;
    while let Err(why) = page.ask(write(motor.clone(), name, value)).await {
        assert!(Instant::now() < end, "{}", why.message);
    }
}

/// A line on which the reply to a request sometimes comes again, just before the next reply. It has the size of
/// the right one.
struct Twice {
    link: Box<dyn EventBytes>,
    last: Vec<u8>,
    again: Vec<u8>,
    requests: u32,
    repeats: Arc<AtomicBool>,
}

impl Link for Twice {
    fn within(&self) -> Option<&dyn Link> {
        Some(&self.link)
    }
}

impl ByteLink for Twice {
    fn write(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        self.requests += 1;
        let last = std::mem::take(&mut self.last);
        if self.repeats.load(Ordering::SeqCst) && self.requests.is_multiple_of(7) {
            self.again = last;
        }
        self.link.write(bytes)
    }

    fn read(&mut self, buffer: &mut [u8], timeout: Option<Duration>) -> Result<usize, PortError> {
        if !self.again.is_empty() {
            let again = std::mem::take(&mut self.again);
            buffer[..again.len()].copy_from_slice(&again);
            return Ok(again.len());
        }
        let size = self.link.read(buffer, timeout)?;
        self.last.extend(&buffer[..size]);
        Ok(size)
    }
}

impl Evented for Twice {
    fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        self.link.descriptor()
    }

    fn flush(&mut self) -> Result<bool, PortError> {
        self.link.flush()
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_reply_that_comes_twice_never_becomes_a_value() {
    let mut bus: Faults = "dup=0.05".parse::<Faults>().unwrap().on_can().unwrap();
    let repeats = Arc::new(AtomicBool::new(false));
    let on_line = Arc::clone(&repeats);
    let world = World::with(
        "twice",
        (Profile::Spec, crate::world::PATIENT),
        move |link| {
            let repeats = Arc::clone(&on_line);
            Box::new(Twice { link, last: Vec::new(), again: Vec::new(), requests: 0, repeats })
        },
        move |link| {
            bus.seed += 1;
            Box::new(FaultCan::new(link, &bus, IDENTIFIERS))
        },
    );
    let page = world.page().await;
    let values = [
        (st(1), "SPEED_KP", 71.0),
        (st(1), "TORQUE_KP", 72.0),
        (st(2), "SPEED_KP", 73.0),
        (rmd(1), "speed_kp", 74.0),
        (rmd(2), "speed_kp", 75.0),
    ];
    for (motor, name, value) in &values {
        set(&page, motor.clone(), name, *value).await;
    }
    repeats.store(true, Ordering::SeqCst);
    let (mut right, end) = (0, Instant::now() + LIMIT);
    while right < 60 {
        assert!(Instant::now() < end, "{right} values");
        // Requests of a page overlap.
        let [a, b, c, d, e] =
            values.each_ref().map(|(motor, name, _)| page.ask(read(motor.clone(), name)));
        let answers: [_; 5] = tokio::join!(a, b, c, d, e).into();
        for ((motor, name, value), answer) in values.iter().zip(answers) {
            match answer {
                Ok(Answer::Read { values }) => {
                    assert_eq!(values[0].value, Some(*value), "{motor:?} {name}");
                    right += 1;
                }
                Ok(other) => panic!("{other:?}"),
                Err(why) => assert!(
                    matches!(why.reason, Reason::Unconfirmed | Reason::Line | Reason::Silent),
                    "{why:?}"
                ),
            }
        }
    }
    assert!(!world.rmd_motion(1).iter().any(|frame| frame[0] >= 0xA0));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_restore_that_is_cut_off_says_what_was_written() {
    let world = World::new("cut-off", Profile::Spec);
    let page = world.page().await;
    let Ok(Answer::Dump { text, .. }) = page.ask(Ask::Dump { motor: st(1) }).await else {
        panic!("no dump")
    };
    // Other values for all gains.
    let changed = text.lines().map(|line| match line.split_once(" = ") {
        Some((name, _)) if name.contains("_K") && !name.contains("DIV") => format!("{name} = 1"),
        _ => line.to_owned(),
    });
    let changed = changed.collect::<Vec<_>>().join("\n") + "\n";
    let begin = world.st_writes().len();
    let restore = page.ask(Ask::Restore { motor: st(1), text: changed, to_rom: false });
    let cut = async {
        let end = Instant::now() + LIMIT;
        while world.st_writes().len() < begin + 3 {
            assert!(Instant::now() < end, "nothing was written");
            tokio::time::sleep(Duration::from_micros(200)).await;
        }
        world.share.close();
    };
    let (restored, ()) = tokio::join!(restore, cut);
    let why = restored.unwrap_err();
    assert!(why.message.contains("the share has ended"), "{}", why.message);
    assert!(why.message.contains("as in the file: SPEED_KP"), "{}", why.message);
    assert!(why.message.contains("all others are as before"), "{}", why.message);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_restore_goes_on_when_its_page_leaves() {
    let world = World::new("leaves", Profile::Spec);
    let page = world.page().await;
    let Ok(Answer::Dump { text, .. }) = page.ask(Ask::Dump { motor: st(1) }).await else {
        panic!("no dump")
    };
    for (name, value) in [("SPEED_KP", 5.0), ("FLUX_KI", 6.0), ("REVUP_4_SPEED", 60.0)] {
        set(&page, st(1), name, value).await;
    }
    let begin = world.st_writes().len();
    {
        let leaving = world.other(&page).await;
        let text = text.clone();
        let restore = tokio::spawn(async move {
            leaving.ask(Ask::Restore { motor: st(1), text, to_rom: false }).await
        });
        let end = Instant::now() + LIMIT;
        while world.st_writes().len() == begin {
            assert!(Instant::now() < end, "nothing was written");
            tokio::time::sleep(Duration::from_micros(200)).await;
        }
        restore.abort();
    }
    let end = Instant::now() + LIMIT;
    loop {
        let diff = Ask::Diff { motor: st(1), text: text.clone() };
        match page.ask(diff).await {
            Ok(Answer::Diff { differences }) if differences.is_empty() => return,
            other => assert!(Instant::now() < end, "{other:?}"),
        }
    }
}
