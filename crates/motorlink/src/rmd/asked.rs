//! What a motor is asked.

/// What [`Client::ask_each`](super::Client::ask_each) asks a motor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Asked {
    /// Eight bytes.
    Request([u8; 8]),
    /// Whether the replies so far belong to their requests.
    Confirmation,
}

impl Asked {
    pub(super) fn request(self) -> Option<[u8; 8]> {
        match self {
            Asked::Request(request) => Some(request),
            Asked::Confirmation => None,
        }
    }
}
