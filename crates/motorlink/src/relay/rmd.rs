//! A CAN bus with RMD motors in a relay.

use std::cell::RefCell;
use std::rc::Rc;
use std::time::Duration;

use motorlink_link::port::{CanLink, EventCan, PortError, PortName};
use motorlink_link::serve::ServeName;
use motorlink_link::serve::{Served, Server};
use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::{MotorId, MotorSet};
use motorlink_proto::time::{self, Instant};

use super::event::{Event, Halt, Outcome, Part};
use super::held::Held;
use super::hold::Hold;
use super::pace::Pace;
use super::port::Port;
use super::station::Desk;
use crate::rmd::follow::Follower;
use crate::rmd::{Client, Options, StopAction, Stopped};

/// What a frame takes behind a serial adapter at 115200 baud: 27 bytes. A CAN interface of the kernel
/// has a short queue of its own.
const FRAME: time::Micros = time::Micros(2_344);
/// A request to every motor, and as many to all of 1 to 4.
const FRAMES_AHEAD: u64 = 64;
/// Frames that are taken from the bus in one turn: the client has its turn as well.
const TURN: usize = 64;
/// Longer than a client waits for a reply: every motor is sent its stop before the relay waits for any
/// answer.
const TIMEOUT: Duration = Duration::from_millis(200);

pub(super) struct RmdHold {
    held: Held<Box<dyn EventCan>, CanFrame>,
    on_loss: StopAction,
    follower: Follower,
}

impl RmdHold {
    pub(super) fn open(name: &PortName, on_loss: StopAction) -> Result<Self, PortError> {
        let opened = name.clone();
        let is_paced = name.as_can().is_some_and(|bus| bus.is_paced());
        let frame = if is_paced { time::Micros(0) } else { FRAME };
        let port = Port::open(name, Box::new(move || opened.open_event_can()))?;
        let pace = Pace::new(frame, time::Micros(frame.0 * FRAMES_AHEAD));
        Ok(RmdHold { held: Held::new(port, pace), on_loss, follower: Follower::default() })
    }

    /// Takes what is on the bus.
    fn pull(&mut self, now: Instant, events: &mut dyn FnMut(Event)) -> Result<(), PortError> {
        for _ in 0..TURN {
            let Some(frame) = self.held.port.receive(Some(Duration::ZERO))? else { break };
            let heard = self.follower.heard(now, &frame);
            if let Some(number) = heard.reply_to {
                self.held.pace.arrived(now, number);
            }
            if let (Some(id), [code, ..]) = (heard.unguarded, frame.data()) {
                events(Event::Unguarded { motor: id.number(), code: *code });
            }
            self.held.lane.borrow_mut().to_client.push_back(frame);
        }
        Ok(())
    }

    /// Hands over what the bus takes of what the client has sent.
    fn push(&mut self, now: Instant) -> Result<(), PortError> {
        while self.held.room(now)? > 0 {
            let next = self.held.lane.borrow_mut().to_port.pop_front();
            let Some(frame) = next else { break };
            // What may set a motor turning is noted before it leaves.
            let number = self.held.pace.hand(now, 1);
            self.follower.sent(now, &frame, number);
            self.held.port.with(|link| link.send(&frame))?;
        }
        Ok(())
    }
}

impl Hold for RmdHold {
    fn serve(
        &self,
        server: &mut Server,
        name: &ServeName,
        desk: &Rc<RefCell<Desk>>,
        port: Rc<RefCell<String>>,
    ) -> Result<Served, PortError> {
        if let ServeName::SocketCan(_) = name {
            // Everybody on such an interface would be the one client.
            let usable = "slcan-pty:PATH, unix-listen:PATH or tcp-listen:ADDR:PORT".to_owned();
            let (port, wanted) = (name.to_string(), "CAN bus with one client");
            return Err(PortError::WrongKind { port, wanted, usable });
        }
        server.serve_can(name, Box::new(self.held.place(desk, port)))
    }

    fn turn(&self, server: &mut Server, most: Duration) -> Result<bool, PortError> {
        self.held.port.turn(server, most)
    }

    fn pass(&mut self, now: Instant, desk: &mut Desk) -> Result<(), PortError> {
        let mut events = |event| desk.events.push_back(event);
        let passed = self.pull(now, &mut events).and_then(|()| self.push(now));
        self.held.drop_untaken(passed.is_err(), desk);
        passed
    }

    fn due(&self, now: Instant) -> Option<Instant> {
        self.held.due(now)
    }

    fn forget(&mut self, _: Instant) -> usize {
        self.follower.unguarded = MotorSet::EMPTY;
        self.held.forget()
    }

    fn owes(&self) -> bool {
        !self.follower.moving.is_empty()
    }

    /// Tells the motors first, then waits for answers that can only be to what they are told again.
    fn stop(&mut self) -> Vec<Halt> {
        let moving = self.follower.moving;
        let request = self.on_loss.request();
        for id in moving {
            // The bus below listens first. If this fails, so does what follows, which says why.
            let _ = self.held.port.send(&CanFrame::new(id.can_id(), request));
        }
        let port = &self.held.port;
        let open = port.opener(|port| Box::new(port) as Box<dyn CanLink>);
        let options = Options { timeout: TIMEOUT, ..Options::default() };
        let Ok(bus) = Client::open_with(&port.name(), open, options) else {
            let why = port.closed().to_string();
            let failed = |id: MotorId| Halt {
                part: Part::Motor(id.number()),
                outcome: Outcome::Failed(why.clone()),
            };
            return moving.map(failed).collect();
        };
        bus.take_over(moving);
        let stopped = bus.stop_on_drop().with(self.on_loss).stop_now();
        self.follower.moving = bus.moving();
        let told = |Stopped { id, result }: Stopped| Halt {
            part: Part::Motor(id.number()),
            outcome: match result {
                Ok(()) => Outcome::Acknowledged(format!("{:#04x}", request[0])),
                Err(error) => Outcome::Failed(error.to_string()),
            },
        };
        let mut halts: Vec<Halt> = stopped.into_iter().map(told).collect();
        halts.sort_by_key(|halt| match halt.part {
            Part::Motor(id) => id,
            Part::Pfc => u8::MAX,
        });
        halts
    }
}
