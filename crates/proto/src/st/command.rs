//! Messages in frames: the position of code, motor and payload in a frame.

use super::frame::{self, Frame};
use super::message::{Reply, Request};
use super::{ErrorCode, HEADER_ACK, HEADER_ATR, HEADER_NACK, Profile};

impl<'a> Frame<'a> {
    /// Writes the frame of `request` for motor number `motor` into `out` and returns its bytes. The
    /// number is 0 to 7; 0 is the current motor. `None` if the request does not fit into a frame or
    /// into `out`.
    #[inline]
    pub fn command<'o>(motor: u8, request: &Request<'_>, out: &'o mut [u8]) -> Option<&'o [u8]> {
        let size = request.payload(frame::room(out)?)?.len();
        frame::seal(out, Frame::header(request.code().number(), motor), size)
    }

    /// The message of a command frame. The error is the code with which a slave of `profile`
    /// refuses it.
    #[inline]
    pub fn request(&self, profile: Profile) -> Result<Request<'a>, ErrorCode> {
        Request::decode(profile, self.code(), self.payload)
    }

    /// The message of a reply frame; `None` if the header is not a reply header.
    pub fn reply(&self) -> Option<Reply<'a>> {
        Some(match (self.header, self.payload) {
            (HEADER_ACK, payload) => Reply::Acknowledged(payload),
            (HEADER_NACK, [code, ..]) => Reply::Refused(ErrorCode::from(*code)),
            (HEADER_NACK, []) => Reply::Refused(ErrorCode::None),
            (HEADER_ATR, _) => Reply::Identification,
            _ => return None,
        })
    }
}
