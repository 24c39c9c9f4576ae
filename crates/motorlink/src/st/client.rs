//! The blocking client: one lock around one exchange, no thread, no allocation in an exchange.

use std::error;
use std::sync::Arc;

use motorlink_link::Clock;
use motorlink_link::port::{ByteLink, Ending, PortError, PortName};
use motorlink_link::printable;
use motorlink_link::reopening::{LinkSign, LinkState, Opener, Reopening};
use motorlink_proto::st as proto;
use motorlink_proto::st::{
    Confirmation, Counters, MotorNumber, Profile, Recovery, Request, SyncState,
};

use super::driven::{Driven, opener};
use super::session::{Exchanged, Rules};
use super::{Error, Options};
use crate::client::{opening, waiting};
use crate::turn::{Turn, Turns};
use crate::way::Way;
use proto::Started;

/// What GET_BOARD_INFO tells (4.7).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BoardInfo {
    /// Major, minor, patch.
    pub version: [u8; 3],
    /// Name of the SDK.
    pub name: String,
    /// The profile that has this form of the version: shipped firmware sends ASCII digits.
    pub profile: Profile,
}

/// What GET_FW_VERSION tells (4.12).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FirmwareVersion {
    /// Name of the firmware.
    pub name: String,
    /// Its version, such as `Ver.5.4.4`.
    pub version: String,
}

/// A master on a serial line: shared by reference between threads, one exchange at a time.
///
/// A port that went away is opened again by the next call, behind a back-off; see
/// [`link_state`](Self::link_state). A failed exchange loses the line, which the next call recovers
/// as [`MasterConfig::recovery`](proto::MasterConfig::recovery) says. What stops a motor does not wait for that: it is sent at once and
/// again on the recovered line, and only the second reply counts.
pub struct Client {
    pub(super) turns: Turns<Driven<Box<dyn ByteLink>>>,
    sign: LinkSign,
    rules: Rules,
    port: Arc<str>,
}

/// How an exchange ended, and what the session has seen of it.
pub type Seen<T> = (Result<T, Error>, Option<Exchanged>);

impl Client {
    opening!(dyn ByteLink, open_bytes);
    waiting!(dyn ByteLink);

    pub(super) fn driving(driven: Driven<Box<dyn ByteLink>>) -> Self {
        let (sign, rules) = (driven.port.sign(), driven.session.rules);
        let port = Arc::clone(&driven.port.name);
        Client { turns: Turns::new(driven), sign, rules, port }
    }

    /// The port's name.
    pub fn port(&self) -> &Arc<str> {
        &self.port
    }

    /// The profile that the drive is expected to follow.
    pub fn profile(&self) -> Profile {
        self.rules.profile
    }

    /// Whether the last exchange ended in sync.
    pub fn sync_state(&self) -> SyncState {
        self.turns.take().session.master.sync_state()
    }

    /// Whether the line has been in sync since the port was opened. If not, only questions and stops
    /// were sent.
    pub fn has_been_in_sync(&self) -> bool {
        self.sync_state() == SyncState::InSync || self.counters().losses > 0
    }

    /// Recovers a lost line with [`Recovery::Pad`] instead of [`Recovery::Drain`] while `act` stops
    /// motors. A drive that waits for the rest of a frame would not hear them. Padding may complete a
    /// write that was cut off, so that a stop has to follow.
    pub(super) fn padded<T>(&self, act: impl FnOnce() -> T) -> T {
        let before = self.turns.take().session.set_recovery(Recovery::Pad);
        if before == Recovery::None {
            self.turns.take().session.set_recovery(before);
        }
        let result = act();
        self.turns.take().session.set_recovery(before);
        result
    }

    /// What came without being asked for.
    pub fn counters(&self) -> Counters {
        self.turns.take().session.master.counters()
    }

    /// Motors that this client started and did not stop.
    pub fn started(&self) -> impl Iterator<Item = MotorNumber> + use<> {
        self.turns.take().session.account.started().motors()
    }

    /// Name and version of the SDK (4.7).
    pub fn board_info(&self) -> Result<BoardInfo, Error> {
        self.exchange(0, &Request::GetBoardInfo, |payload| {
            let info = proto::BoardInfo::decode(payload)?;
            let proto::BoardInfo { version, profile, name } = info;
            Some(BoardInfo { version, profile, name: printable(name) })
        })
    }

    /// Name and version of the firmware (4.12).
    pub fn firmware_version(&self) -> Result<FirmwareVersion, Error> {
        self.exchange(0, &Request::GetFirmwareVersion, |payload| {
            let version = proto::FirmwareVersion::decode(payload);
            Some(FirmwareVersion {
                name: printable(version.name),
                version: printable(version.version),
            })
        })
    }

    /// Checks a request against the limits. Nothing is sent. That a start has a ramp is checked when it
    /// is sent.
    ///
    /// # Errors
    /// [`Error::Limit`], [`Error::NoSuchMotor`].
    pub fn check(&self, motor: u8, request: &Request<'_>) -> Result<(), Error> {
        self.rules.check(motor, request)
    }

    /// One exchange with motor number `motor`, where 0 is the drive's current motor. `reply` reads
    /// the acknowledge's payload; `None` from it is [`Error::Reply`]. It must not call this client,
    /// which is locked meanwhile.
    pub fn exchange<T>(
        &self,
        motor: u8,
        request: &Request<'_>,
        reply: impl FnOnce(&[u8]) -> Option<T>,
    ) -> Result<T, Error> {
        self.exchange_seen(motor, request, reply).0
    }

    /// As [`exchange`](Self::exchange), with what the session has seen of it; `None`: nothing was sent.
    pub fn exchange_seen<T>(
        &self,
        motor: u8,
        request: &Request<'_>,
        reply: impl FnOnce(&[u8]) -> Option<T>,
    ) -> Seen<T> {
        if let Err(error) = self.rules.check(motor, request) {
            return (Err(error), None);
        }
        let mut driven = self.turns.take();
        match driven.begin(motor, request) {
            Ok(()) => self.conclude(driven, reply),
            Err(error) => (Err(error), None),
        }
    }

    /// One exchange with any frame code and payload; gives the acknowledge's payload.
    pub fn raw(&self, motor: u8, code: u8, payload: &[u8]) -> Result<Vec<u8>, Error> {
        self.raw_seen(motor, code, payload).0
    }

    /// As [`raw`](Self::raw), with what the session has seen of it; `None`: nothing was sent.
    pub fn raw_seen(&self, motor: u8, code: u8, payload: &[u8]) -> Seen<Vec<u8>> {
        let begin = |driven: &mut Driven<_>| {
            let effect = self.rules.check_raw(motor, code, payload)?;
            driven.begin_raw(motor, code, payload, effect)
        };
        let mut driven = self.turns.take();
        match begin(&mut driven) {
            Ok(()) => self.conclude(driven, |payload| Some(payload.to_vec())),
            Err(error) => (Err(error), None),
        }
    }

    /// Makes sure that the replies since the last confirmation or failed exchange went to their own
    /// requests: asks for STATUS, FLAGS or the board information, whichever has another size than the
    /// last reply. A reply that came twice, or late, has put each one behind it off by one, which no
    /// single exchange can tell. The values before a failed exchange stay
    /// unconfirmed.
    ///
    /// # Errors
    /// [`Error::Unconfirmed`]: what was read or acknowledged since the last confirmation cannot be
    /// trusted. The line is lost. The port's.
    pub fn confirm(&self) -> Result<(), Error> {
        self.confirm_seen().0
    }

    /// As [`confirm`](Self::confirm), with what the session has seen of its last exchange; `None`: nothing
    /// was sent.
    pub fn confirm_seen(&self) -> Seen<()> {
        let mut confirmation = self.turns.take().session.confirmation();
        let (mut answer, mut seen) = self.answers(&confirmation);
        if matches!(answer, Err(Error::Refused { .. }))
            && self.turns.take().session.repeat(&mut confirmation)
        {
            (answer, seen) = self.answers(&confirmation);
        }
        let mut driven = self.turns.take();
        let confirmed = driven.session.confirmed(&confirmation, answer);
        // The judgement may have found a loss.
        let after = driven.session.exchanged().after;
        (confirmed, seen.map(|seen| Exchanged { after, ..seen }))
    }

    fn answers(&self, confirmation: &Confirmation) -> Seen<()> {
        let mut driven = self.turns.take();
        let confirms = driven.session.confirms(confirmation);
        let accepted = |payload: &[u8]| confirms(payload.len()).then_some(());
        match driven.ask(confirmation) {
            Ok(()) => self.conclude(driven, accepted),
            Err(error) => (Err(error), None),
        }
    }

    /// Sends STOP_MOTOR without waiting for an answer, as for the other motors of a drive that does
    /// not answer. Afterwards the line is lost.
    pub fn stop_unheard(&self, motor: MotorNumber) -> Result<(), Error> {
        let mut driven = self.turns.take();
        driven.abandon();
        let sent = driven.stop_unheard(motor);
        if sent.is_err() {
            driven.port.close();
        }
        Ok(sent?)
    }

    /// Takes the line over from another master, which started these motors.
    pub(crate) fn take_over(&self, started: Started) {
        self.turns.take().session.account.take_over(started);
    }

    /// What [`take_over`](Self::take_over) was given and later calls left of it.
    pub(crate) fn hand_over(&self) -> Started {
        self.turns.take().session.account.started()
    }

    /// Brings the exchange that was begun to its end.
    fn conclude<T>(
        &self,
        mut driven: Turn<'_, Driven<Box<dyn ByteLink>>>,
        reply: impl FnOnce(&[u8]) -> Option<T>,
    ) -> Seen<T> {
        let mut reply = Some(reply);
        let mut reply = |payload: &[u8]| reply.take()?(payload);
        let exchange = driven.exchanges;
        let outcome = loop {
            match driven.run(self.turns.next_look(), &mut reply) {
                Ok(Some(outcome)) => break Ok(outcome),
                Ok(None) => {}
                Err(error) => break Err(error),
            }
            let port = Arc::clone(&driven.port.name);
            let looked;
            (driven, looked) = driven.look(&port);
            let overtaken = driven.exchanges != exchange;
            if overtaken {
                let overtaken = PortError::Overtaken(port.to_string());
                let seen = driven.session.exchanged();
                return (Err(looked.err().unwrap_or(overtaken).into()), Some(seen));
            }
            if let Err(error) = looked {
                break Err(error);
            }
        };
        driven.ended = driven.port.now();
        let result = match outcome {
            Ok(outcome) => driven.session.conclude(outcome),
            Err(error) => Err(driven.lost(error)),
        };
        (result, Some(driven.session.exchanged()))
    }
}
