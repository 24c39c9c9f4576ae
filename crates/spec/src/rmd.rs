//! Names of the directions of RMD frames.

use motorlink_proto::rmd::{CommandInfo, Direction, Field};

/// What a frame of this direction is.
pub fn name(direction: Direction) -> &'static str {
    match direction {
        Direction::HostToDrive => "request",
        Direction::DriveToHost => "reply",
    }
}

pub fn plural(direction: Direction) -> &'static str {
    match direction {
        Direction::HostToDrive => "requests",
        Direction::DriveToHost => "replies",
    }
}

pub fn opposite(direction: Direction) -> Direction {
    match direction {
        Direction::HostToDrive => Direction::DriveToHost,
        Direction::DriveToHost => Direction::HostToDrive,
    }
}

/// The values of a command in this direction.
pub fn fields(row: &CommandInfo, direction: Direction) -> &'static [Field] {
    match direction {
        Direction::HostToDrive => row.request,
        Direction::DriveToHost => row.reply,
    }
}
