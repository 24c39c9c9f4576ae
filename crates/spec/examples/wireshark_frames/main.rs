//! Prints frames of both protocols with what `motorlink-proto` reads in them, one JSON object a line.
//! The tests of the dissector compare it with Wireshark.
//!
//! `set` is the capture, `answers` says that the frame is the reply to the frame before it. `fields`
//! are the fields of the dissector, by name.

mod out;
mod rmd;
mod st;

fn main() {
    rmd::frames();
    st::frames();
}
