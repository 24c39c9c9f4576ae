//! The demands of a document.

/// A demand of a document, in our words.
#[derive(Debug, Clone, Copy)]
pub struct Clause {
    /// `ST-4.1-07`: the document, the paragraph, a number. In the CAN document the middle part is
    /// the command code, or a chapter number if the clause is not about one command.
    pub id: &'static str,
    /// The demand, and whether it applies to a drive or a host.
    pub text: &'static str,
    /// Names of this project's own tests that check a host.
    pub host: &'static [&'static str],
    /// Why no drive is tested; empty if drives are tested.
    pub untested: &'static str,
}

impl Clause {
    /// A clause that cases test on a drive.
    pub const fn new(id: &'static str, text: &'static str) -> Self {
        Clause { id, text, host: &[], untested: "" }
    }

    /// Adds the tests of a host.
    pub const fn host(self, host: &'static [&'static str]) -> Self {
        Clause { host, ..self }
    }

    /// Adds the reason why no drive can be tested.
    pub const fn untested(self, untested: &'static str) -> Self {
        Clause { untested, ..self }
    }

    /// The paragraph of the document.
    pub fn paragraph(&self) -> &'static str {
        self.id.split('-').nth(1).unwrap_or(self.id)
    }
}
