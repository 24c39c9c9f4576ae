//! New files made of broken ones.

use std::io::Cursor;

use motorlink_recording::read::Recording;

use super::files::{all, check, chunk_starts, compressed, finished, messages, options, read};

fn repaired(file: &[u8]) -> Vec<u8> {
    let mut new = Vec::new();
    Recording::checked(Cursor::new(file)).unwrap().write_to(&mut new).unwrap();
    new
}

#[test]
fn a_repaired_file_is_whole_and_has_all_that_could_be_read() {
    let file = finished(options(), 3);
    let damaged = {
        let mut file = file.clone();
        file[chunk_starts(&finished(options(), 3))[1] + 60] ^= 1;
        file
    };
    for broken in [&file[..file.len() - 1], &file[..file.len() / 2], &damaged, &file] {
        let (got, losses) = read(broken);
        let new = repaired(broken);
        assert_eq!(read(&new), (got.clone(), vec![]));
        assert_eq!(check(&new), (got.clone(), vec![]));
        let other = mcap::MessageStream::new(&new).unwrap().map(|message| message.unwrap());
        assert_eq!(other.count(), got.len(), "another reader agrees");
        let mut recording = Recording::new(Cursor::new(&new)).unwrap();
        assert_eq!((recording.profile(), recording.library()), ("ros2", "test"));
        let attachment = recording.attachment("st0_motor1.toml").unwrap().unwrap();
        assert_eq!(attachment.data, b"[settings]\n");
        let names: Vec<&str> =
            recording.metadata().iter().map(|metadata| &*metadata.name).collect();
        let expected: &[&str] =
            if losses.is_empty() { &["motorlink"] } else { &["motorlink", "recovered"] };
        assert_eq!(names, expected);
        // It is repaired to itself.
        assert_eq!(all(Recording::new(Cursor::new(repaired(&new))).unwrap()).0, got);
    }
    assert_eq!(read(&repaired(&finished(compressed(), 0))), (messages(0), vec![]));
}
