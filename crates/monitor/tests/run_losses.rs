//! Runs whose references get no reply: they continue, or the motor stops and the page gets the reason.

use std::os::fd::BorrowedFd;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use crate::world::{LIMIT, Page, World, rmd};
use motorlink::port::{CanLink, EventCan, Evented, Link, PortError};
use motorlink_monitor::message::{Answer, Ask, Mode, RunResult};
use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::Code;
use motorlink_proto::st::Profile;

/// Below the time that a run waits for replies.
const TIMEOUT: Duration = Duration::from_millis(150);

/// A bus that loses the next replies to references.
struct Deaf {
    bus: Box<dyn EventCan>,
    loses: Arc<AtomicUsize>,
}

impl Link for Deaf {
    fn within(&self) -> Option<&dyn Link> {
        Some(&self.bus)
    }
}

impl CanLink for Deaf {
    fn send(&mut self, frame: &CanFrame) -> Result<(), PortError> {
        self.bus.send(frame)
    }

    fn receive(&mut self, timeout: Option<Duration>) -> Result<Option<CanFrame>, PortError> {
        let frame = self.bus.receive(timeout)?;
        let is_reply = frame.is_some_and(|frame| frame.data()[0] == u8::from(Code::SetSpeed));
        let one_less = |left: usize| left.checked_sub(1);
        let order = Ordering::SeqCst;
        let is_lost = is_reply && self.loses.fetch_update(order, order, one_less).is_ok();
        Ok(frame.filter(|_| !is_lost))
    }
}

impl Evented for Deaf {
    fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        self.bus.descriptor()
    }

    fn flush(&mut self) -> Result<bool, PortError> {
        self.bus.flush()
    }
}

/// The world, and how many replies its bus loses from now on.
fn deaf(name: &str) -> (World, Arc<AtomicUsize>) {
    let loses = Arc::<AtomicUsize>::default();
    let of_bus = Arc::clone(&loses);
    let around =
        move |bus| -> Box<dyn EventCan> { Box::new(Deaf { bus, loses: Arc::clone(&of_bus) }) };
    (World::with(name, (Profile::Spec, TIMEOUT), |link| link, around), loses)
}

async fn run(page: &Page, target: f64, rate: f64) {
    let ask = Ask::Run { motor: rmd(1), mode: Mode::Speed, target, rate, hold: false };
    assert!(matches!(page.ask(ask).await, Ok(Answer::Run { streams: true, .. })));
}

async fn ran(page: &Page) -> RunResult {
    let end = Instant::now() + LIMIT;
    loop {
        if let Some(ran) = page.drive.rans.lock().unwrap().pop() {
            return ran;
        }
        assert!(Instant::now() < end, "the run does not end");
        tokio::time::sleep(Duration::from_millis(2)).await;
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_lost_reply_does_not_end_a_run() {
    let (world, loses) = deaf("run-lost");
    let page = world.page().await;
    run(&page, 360.0, 400.0).await;
    world.reaches("rmd1.speed_dps", |dps| dps > 60.0).await;
    loses.store(1, Ordering::SeqCst);
    assert_eq!(ran(&page).await, RunResult { motor: rmd(1), reference: 360.0, failure: None });
    assert_eq!(loses.load(Ordering::SeqCst), 0);
    world.reaches("rmd1.speed_dps", |dps| dps > 350.0).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_motor_that_does_not_reply_is_stopped_and_the_page_is_told() {
    let (world, loses) = deaf("run-silent");
    let page = world.page().await;
    run(&page, 360.0, 100.0).await;
    world.reaches("rmd1.speed_dps", |dps| dps > 60.0).await;
    loses.store(usize::MAX, Ordering::SeqCst);
    let RunResult { reference, failure, .. } = ran(&page).await;
    assert!((30.0..360.0).contains(&reference), "{reference}");
    let failure = failure.unwrap();
    assert!(
        failure.contains("motor 1") && failure.ends_with("the motor confirmed its stop"),
        "{failure}"
    );
    world.reaches("rmd1.speed_dps", |dps| dps.abs() < 5.0).await;
    // The page is alive, and can turn it again.
    loses.store(0, Ordering::SeqCst);
    run(&page, 100.0, 1000.0).await;
    assert_eq!(ran(&page).await.failure, None);
    // A run that a stop ends reports nothing.
    run(&page, 360.0, 50.0).await;
    world.reaches("rmd1.speed_dps", |dps| dps > 110.0).await;
    page.stop(rmd(1)).await;
    world.reaches("rmd1.speed_dps", |dps| dps.abs() < 5.0).await;
    run(&page, 20.0, 1000.0).await;
    assert_eq!(ran(&page).await.reference, 20.0);
    assert!(page.drive.rans.lock().unwrap().is_empty());
}
