//! The frames of RMD motors in a capture: their direction and their meaning.

mod pairing;

use motorlink_proto::rmd::{self, Described, MotorId, Subject, describe};

use crate::captured::{Captured, Wire};
use pairing::Bus;
pub use pairing::{KnownBy, Way};

/// Decodes the frames of a capture, which it must get in their order.
#[derive(Debug, Default)]
pub struct Decoder {
    forced: Option<rmd::Direction>,
    buses: Vec<(Option<std::sync::Arc<str>>, Bus)>,
}

/// Buses that are told apart. A damaged capture can have any number of names.
const MOST_BUSES: usize = 64;

impl Decoder {
    /// A decoder at the begin of a capture.
    pub fn new() -> Self {
        Decoder::default()
    }

    /// A decoder of frames that all have this direction.
    pub fn of(direction: rmd::Direction) -> Self {
        Decoder { forced: Some(direction), buses: Vec::new() }
    }

    /// The meaning of an entry; `None` if it is not a classic CAN frame.
    pub fn decode(&mut self, entry: &Captured) -> Option<(Way, Described)> {
        let Wire::Can(frame) = &entry.wire else {
            self.lose(entry);
            return None;
        };
        let forced = self.forced;
        let bus = self.bus(entry);
        let way = match describe(*frame, None).subject() {
            Subject::Motor(motor, code) => match forced {
                Some(direction) => Way { direction: Some(direction), by: KnownBy::Caller },
                None => bus.exchange(entry, motor, code, &frame.padded_data()),
            },
            // Only a host sends it, and its motors reply as to 0xA1.
            Subject::Torque4 => {
                bus.torque4(entry);
                Way { direction: Some(rmd::Direction::HostToDrive), by: KnownBy::Frame }
            }
            Subject::Dialect(..) => {
                Way { direction: Some(rmd::Direction::DriveToHost), by: KnownBy::Frame }
            }
            _ => Way { direction: None, by: KnownBy::Nothing },
        };
        Some((way, describe(*frame, way.direction)))
    }

    /// After an entry that may hide frames of motors.
    fn lose(&mut self, entry: &Captured) {
        match (&entry.wire, &entry.channel) {
            (Wire::Fd(_), _) => {}
            (_, Some(_)) => self.bus(entry).lose(),
            (_, None) => self.buses.iter_mut().for_each(|(_, bus)| bus.lose()),
        }
    }

    fn bus(&mut self, entry: &Captured) -> &mut Bus {
        let channel = &entry.channel;
        let known = self.buses.iter().position(|(name, _)| name == channel);
        let index = known.unwrap_or_else(|| {
            if self.buses.len() == MOST_BUSES {
                self.buses.clear();
            }
            self.buses.push((channel.clone(), Bus::default()));
            self.buses.len() - 1
        });
        &mut self.buses[index].1
    }
}

/// The motor of a frame, if it is that of one.
pub fn motor(subject: Subject) -> Option<MotorId> {
    match subject {
        Subject::Motor(motor, _) | Subject::Dialect(_, motor) => Some(motor),
        _ => None,
    }
}
