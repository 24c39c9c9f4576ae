//! One program of the tests that need none of their own: each more has to be linked.

mod clock;
mod common;
mod model;
mod rmd_bench;
mod rmd_drive;
mod rmd_exhaustive;
mod rmd_host;
mod rmd_opened;
mod rmd_properties;
mod rmd_vectors;
mod st_bench;
mod st_exhaustive;
mod st_frame;
mod st_master;
mod st_model;
mod st_opened;
mod st_slave;
mod st_vectors;
mod st_verified;
mod units;
