//! Drives that speak ST's Motor Control Protocol.

mod bench;
mod clauses;

use motorlink_proto::stmcp::{Profile, Request};

use crate::case::Case;
use crate::markdown::markdown;

pub use bench::{Bench, Options};
pub use clauses::CLAUSES;

/// What a drive of this profile is put through.
pub fn suite(_profile: Profile) -> Vec<Case<Bench>> {
    vec![Case::new("board_info_has_32_bytes", &["ST-4.7-02"], |bench: &mut Bench| {
        let payload = bench.acknowledged(&Request::BoardInfo)?;
        bench.require(payload.len() == 32, "an ACK with 32 bytes")
    })]
}

/// Every clause and what tests it in either profile, as a Markdown table.
pub fn table() -> String {
    let suites = [Profile::Spec, Profile::Mcsdk54].map(suite);
    markdown(CLAUSES, suites.iter().flatten())
}
