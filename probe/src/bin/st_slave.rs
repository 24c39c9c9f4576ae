//! A slave of ST MCP and nothing else.
#![no_std]
#![no_main]

use motorlink_proto::st::{Motor, Profile, Slave};

probe::program!(Slave, Slave::new(Profile::Spec, Motor::FIRST), probe::st_slave);
