//! Both ends of slcan and nothing else.
#![no_std]
#![no_main]

use motorlink_slcan::{AnswerParser, Device};

probe::program!((Device, AnswerParser), Default::default(), probe::slcan);
