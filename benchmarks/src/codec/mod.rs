//! Time and instructions to encode and decode each message.

mod rmd;
mod st;

use crate::Result;
use crate::kernel::{Counter, Kernel};
use crate::report::{Goal, Section};

/// A request and its reply, each as a kernel that encodes and decodes it.
struct Kind {
    name: String,
    request: Kernel,
    reply: Kernel,
}

impl Kind {
    fn new(name: String, request: impl FnMut() + 'static, reply: impl FnMut() + 'static) -> Self {
        let request = Kernel::new(format!("{name} request"), request);
        let reply = Kernel::new(format!("{name} reply"), reply);
        Kind { name, request, reply }
    }
}

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
        note:
            "From the typed message to the frame's bytes and back, once. Times are the least and \
               the median of 201 batches of 1000; instructions are callgrind's."
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
