//! A master of ST MCP and nothing else.
#![no_std]
#![no_main]

use motorlink_proto::st::{Master, MasterConfig};

probe::program!(Master, Master::new(MasterConfig::default()), probe::st_master);
