//! An RMD drive and nothing else.
#![no_std]
#![no_main]

use motorlink_proto::rmd::Drive;

probe::program!(Drive, probe::new_rmd_drive(), probe::rmd_drive);
