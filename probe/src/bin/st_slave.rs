//! A slave of ST MCP and nothing else.
#![no_std]
#![no_main]

use motorlink_proto::st::{MotorNumber, Profile, Slave};

probe::program!(Slave, Slave::new(Profile::Spec, MotorNumber::FIRST), probe::st_slave);
