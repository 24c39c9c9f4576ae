//! Nothing: what any such program has.
#![no_std]
#![no_main]

probe::program!((), (), |_: &mut ()| core::hint::black_box(()));
