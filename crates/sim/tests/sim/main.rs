//! Tests of simulated drives through their protocol, on virtual time.

mod motion;
mod rmd_bench;
mod rmd_motion;
mod rmd_plant;
mod rmd_protocol;
mod st_bench;
mod st_control;
mod st_faults;
mod st_loops;
mod st_registers;
mod st_states;
mod time;
