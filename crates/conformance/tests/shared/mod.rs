//! A station on virtual time. The test can inspect it while the kit uses it.
#![allow(dead_code, reason = "no test needs all of it")]

use std::sync::{Arc, Mutex, MutexGuard};

use motorlink::Clock;
use motorlink::port::{ByteLink, CanLink};
use motorlink_link::serve::{Station, StationLink, Traffic};
use motorlink_proto::can::CanFrame;
use motorlink_proto::time::Instant;

/// Clones share the same station.
pub struct Shared<S> {
    station: Arc<Mutex<S>>,
    pub clock: Clock,
}

impl<S> Clone for Shared<S> {
    fn clone(&self) -> Self {
        Shared { station: Arc::clone(&self.station), clock: self.clock.clone() }
    }
}

impl<S> Shared<S> {
    pub fn new(station: S) -> Self {
        Shared { station: Arc::new(Mutex::new(station)), clock: Clock::virtual_time() }
    }

    pub fn station(&self) -> MutexGuard<'_, S> {
        self.station.lock().expect("no panic while it was locked")
    }
}

impl<S: Station<u8> + Send + 'static> Shared<S> {
    pub fn line(&self) -> Box<dyn ByteLink> {
        Box::new(StationLink::<_, u8>::new(self.clone(), self.clock.clone()))
    }
}

impl<S: Station<CanFrame> + Send + 'static> Shared<S> {
    pub fn bus(&self) -> Box<dyn CanLink> {
        Box::new(StationLink::<_, CanFrame>::new(self.clone(), self.clock.clone()))
    }
}

impl<T: Traffic, S: Station<T>> Station<T> for Shared<S> {
    fn receive(&mut self, now: Instant, received: &[T], replies: &mut Vec<T>) {
        self.station().receive(now, received, replies);
    }

    fn poll(&mut self, now: Instant, replies: &mut Vec<T>) {
        self.station().poll(now, replies);
    }

    fn deadline(&self) -> Option<Instant> {
        self.station().deadline()
    }
}
