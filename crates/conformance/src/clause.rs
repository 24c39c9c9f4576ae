//! What a document demands.

/// A sentence of a document that demands something, in our words.
#[derive(Debug, Clone, Copy)]
pub struct Clause {
    /// `ST-4.1-07`: the document, the paragraph, a running number. In the CAN document the middle is
    /// the command code, or a chapter number where no command is meant.
    pub id: &'static str,
    /// What is demanded, of whom.
    pub text: &'static str,
    /// Tests that hold a host to it: names of this project's own tests.
    pub host: &'static [&'static str],
    /// Why no drive is tested against it; empty where one is.
    pub untested: &'static str,
}

impl Clause {
    /// A clause that cases test on a drive.
    pub const fn new(id: &'static str, text: &'static str) -> Self {
        Clause { id, text, host: &[], untested: "" }
    }

    /// The same, with what tests it on a host.
    pub const fn host(self, host: &'static [&'static str]) -> Self {
        Clause { host, ..self }
    }

    /// The same, with why no drive can be tested against it.
    pub const fn untested(self, untested: &'static str) -> Self {
        Clause { untested, ..self }
    }

    /// Where the document says it.
    pub fn paragraph(&self) -> &'static str {
        self.id.split('-').nth(1).unwrap_or(self.id)
    }
}
