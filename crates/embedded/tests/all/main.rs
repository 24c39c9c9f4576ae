//! Protocols behind traits of drivers: one program of tests, as each more has to be linked.

mod rmd;
mod slcan;
mod st;
mod uart;
