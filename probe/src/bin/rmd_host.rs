//! An RMD host and nothing else.
#![no_std]
#![no_main]

use motorlink_proto::rmd::Host;

probe::program!(Host, Host::new(), probe::rmd_host);
