//! Frames as text.

use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::{Direction, describe};

/// `141 [8] 9A 00 00 00 00 00 00 00  motor 1 > 0x9A Read motor status 1 and error flag commands`.
pub(super) fn words(frame: &CanFrame, direction: Direction) -> String {
    let mut text = if frame.is_extended() {
        format!("{:08X} [{}]", frame.id(), frame.len())
    } else {
        format!("{:03X} [{}]", frame.id(), frame.len())
    };
    if frame.is_remote() {
        text += " remote";
    }
    text += &frame.data().iter().map(|byte| format!(" {byte:02X}")).collect::<String>();
    format!("{text}  {}", describe(*frame, direction))
}

/// The last ones of several frames, one line each.
pub(super) fn lines(frames: &[CanFrame], direction: Direction) -> String {
    const MOST: usize = 8;
    let shown = &frames[frames.len().saturating_sub(MOST)..];
    let mut text = shown.iter().map(|frame| words(frame, direction)).collect::<Vec<_>>();
    if shown.len() < frames.len() {
        text.insert(0, format!("{} frames, at last", frames.len()));
    }
    match text.len() {
        0 => "nothing".to_owned(),
        _ => text.join("; "),
    }
}
