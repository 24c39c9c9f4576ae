//! Motors that speak the RMD protocol V1.62.

mod bench;
mod clauses;

use motorlink_proto::rmd::{Command, ReadStatus1};

use crate::case::Case;
use crate::markdown::markdown;

pub use bench::{Bench, Options};
pub use clauses::CLAUSES;

/// What a motor is put through.
pub fn suite() -> Vec<Case<Bench>> {
    vec![Case::new("status_1_is_answered_with_its_code", &["RMD-9A-01"], |bench: &mut Bench| {
        let request = ReadStatus1.encode();
        let reply = bench.ask(request)?;
        bench.require(reply[0] == request[0], "DATA[0] of the request")
    })]
}

/// Every clause and what tests it, as a Markdown table.
pub fn table() -> String {
    markdown(CLAUSES, suite().iter())
}
