//! Time and instructions to encode and decode each message.

mod kind;
mod rmd;
mod st;

use crate::report::{Goal, Section};
use kind::Kind;
use motorlink_kernels::kernel::{Counter, Kernel};
use motorlink_kernels::result::Result;

pub fn kernels() -> impl Iterator<Item = Kernel> {
    let kinds = st::kinds().into_iter().chain(rmd::kinds());
    kinds.flat_map(|kind| [kind.request, kind.reply])
}

pub fn measure() -> Result<(Vec<Section>, Vec<Goal>)> {
    let counter = Counter::find();
    let sections = vec![
        section("ST Motor Control Protocol: encode and decode", st::kinds(), counter.as_ref())?,
        section("RMD over CAN: encode and decode", rmd::kinds(), counter.as_ref())?,
    ];
    Ok((sections, Vec::new()))
}

fn section(title: &'static str, kinds: Vec<Kind>, counter: Option<&Counter>) -> Result<Section> {
    let mut rows = Vec::new();
    for Kind { name, request, reply } in kinds {
        let (request, reply) = (request.cost(counter)?, reply.cost(counter)?);
        rows.push([name].into_iter().chain(request.show()).chain(reply.show()).collect());
    }
    Ok(Section {
        title,
        note: "\
- One operation: from the typed message to the bytes of the frame, and back.
- Times are the minimum and the median of 201 batches of 1000 operations.
- Instructions are counted by callgrind."
            .to_owned(),
        columns: vec![
            "message",
            "request ns, least",
            "median",
            "instructions",
            "reply ns, least",
            "median",
            "instructions",
        ],
        rows,
    })
}
