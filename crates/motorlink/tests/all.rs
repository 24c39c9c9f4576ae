//! One program of the tests that need none of their own: each more has to be linked.

mod arrival;
mod event;
mod full_turn;
mod holder;
mod host_faults;
mod interruption;
mod limits;
mod looking;
mod lost_line;
mod opened;
mod pause;
mod relay;
mod rmd_stopping;
mod served;
mod stop_on_drop;
mod virtual_bench;
mod wire;
