//! A master of ST MCP and nothing else.
#![no_std]
#![no_main]

use motorlink_proto::st::{Config, Master};

probe::program!(Master, Master::new(Config::default()), probe::st_master);
