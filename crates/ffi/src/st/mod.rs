//! ST's Motor Control Protocol.

mod exchange;
pub mod master;
pub mod message;
pub mod names;
pub mod request;
pub mod slave;

pub use crate::storage::{motorlink_st_master, motorlink_st_slave};
