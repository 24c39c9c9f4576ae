//! Whole files of all kinds.

use std::io::Cursor;

use motorlink_recording::read::{ReadError, Recording};

use super::files::{
    IN_A_CHUNK, check, chunk_starts, compressed, finished, messages, options, read,
};

#[test]
fn a_whole_file_gives_all_messages_in_order() {
    let kinds = [
        options(),
        compressed(),
        options().disable_seeking(true),
        options().use_chunks(false),
        options().emit_message_indexes(false),
        options().emit_summary_records(false).emit_summary_offsets(false),
        options().calculate_chunk_crcs(false).calculate_data_section_crc(false),
        options().calculate_summary_section_crc(false),
        compressed().repeat_channels(false).repeat_schemas(false),
    ];
    for (n, kind) in kinds.into_iter().enumerate() {
        let file = finished(kind, 3);
        assert_eq!(read(&file), (messages(3), vec![]), "kind {n} by its index");
        assert_eq!(check(&file), (messages(3), vec![]), "kind {n} from its beginning");
    }
}

#[test]
fn a_file_without_messages_is_whole() {
    assert_eq!(check(&finished(options(), 0)), (vec![], vec![]));
    assert_eq!(read(&finished(compressed(), 0)), (vec![], vec![]));
}

#[test]
fn facts_and_attachments_are_read_by_the_index_and_from_the_beginning() {
    let file = finished(compressed(), 1);
    for mut recording in [
        Recording::new(Cursor::new(&file)).unwrap(),
        Recording::checked(Cursor::new(&file)).unwrap(),
    ] {
        assert_eq!((recording.profile(), recording.library()), ("ros2", "test"));
        assert_eq!(recording.metadata()[0].name, "motorlink");
        assert_eq!(recording.metadata()[0].values["version"], "1");
        let names: Vec<&str> = recording.attachments().collect();
        assert_eq!(names, ["st0_motor1.toml"]);
        let attachment = recording.attachment("st0_motor1.toml").unwrap().unwrap();
        assert_eq!(
            (&*attachment.media_type, &*attachment.data),
            ("application/toml", &b"[settings]\n"[..])
        );
        assert!(recording.attachment("st0_motor2.toml").unwrap().is_none());
        let channel = recording.channels().next().unwrap().clone();
        assert_eq!(recording.schema(&channel).unwrap().name, "test/msg/Text");
    }
}

#[test]
fn a_file_of_another_kind_is_an_error() {
    assert!(matches!(Recording::new(Cursor::new(b"")), Err(ReadError::Empty)));
    assert!(matches!(Recording::new(Cursor::new(b"t [s],SPEED_MEAS\n")), Err(ReadError::NotMcap)));
    assert!(matches!(Recording::checked(Cursor::new(b"\x89MCAP0\r")), Err(ReadError::NotMcap)));
}

#[test]
fn chunks_of_other_times_are_not_read() {
    let file = finished(options(), 4);
    let mut recording = Recording::new(Cursor::new(&file)).unwrap();
    let all: Vec<u64> = recording.messages().map(|it| it.unwrap().log_time).collect();
    let in_a_chunk = IN_A_CHUNK as usize;
    let mut between = |first: u64, last: u64| -> Vec<u64> {
        recording.messages_between(first..=last).map(|it| it.unwrap().log_time).collect()
    };
    let second = in_a_chunk..2 * in_a_chunk;
    assert_eq!(between(all[in_a_chunk], all[in_a_chunk]), all[second.clone()]);
    assert_eq!(between(all[in_a_chunk + 1], all[2 * in_a_chunk]), all[in_a_chunk..3 * in_a_chunk]);
    assert_eq!(between(0, all[0] - 1), [0; 0]);
    assert_eq!(between(0, u64::MAX), all);
    // A chunk that was cut may have any times.
    let cut = &file[..chunk_starts(&file)[1] + 150];
    let mut recording = Recording::new(Cursor::new(cut)).unwrap();
    let some = recording.messages_between(0..=1).count();
    let whole = recording.messages().count();
    assert!(some > 0 && some + in_a_chunk == whole, "{some} of {whole}");
}
