//! Files that were cut, damaged, or never finished.

use std::io::{Cursor, Seek, SeekFrom, Write};
use std::sync::{Arc, Mutex};

use mcap::WriteOptions;
use motorlink_recording::read::{Damage, Loss, Recording};

use super::files::{
    IN_A_CHUNK, check, chunk_starts, compressed, finished, messages, options, read, write,
};

#[test]
fn a_file_cut_at_any_byte_gives_all_messages_before() {
    for (name, options) in [("plain", options()), ("zstd", compressed())] {
        let file = finished(options, 3);
        let sent = messages(3);
        let starts = chunk_starts(&file);
        for end in 8..file.len() {
            let (got, losses) = read(&file[..end]);
            let whole = starts.iter().skip(1).filter(|start| **start <= end).count() as u64;
            assert!(got.len() as u64 >= whole * IN_A_CHUNK, "{name} at {end}: {}", got.len());
            assert!(sent.starts_with(&got), "{name} at {end}");
            assert!(!losses.is_empty(), "{name} at {end}: the loss is listed");
            assert_eq!(check(&file[..end]), (got, losses), "{name} at {end}");
        }
    }
}

#[test]
fn each_message_of_a_cut_plain_chunk_is_given() {
    let file = finished(options(), 2);
    let sent = messages(2);
    let content = &sent[8].2;
    let at = file.windows(content.len()).position(|bytes| bytes == content).unwrap();
    let (got, losses) = read(&file[..at + content.len()]);
    assert_eq!(got, sent[..9]);
    assert_eq!(losses[0].damage, Damage::Cut);
    assert_eq!(losses[0].after, Some(sent[8].1));
    assert!(losses[0].bytes.is_empty(), "no byte was lost: {:?}", losses[0].bytes);
    let (got, losses) = read(&file[..at + content.len() - 1]);
    assert_eq!(got, sent[..8]);
    assert_eq!(losses[0].bytes.end, (at + content.len() - 1) as u64);
    assert_eq!(losses[0].after, Some(sent[7].1));
}

#[test]
fn no_flipped_bit_is_a_wrong_message_or_a_hidden_loss() {
    let sent = messages(2);
    let mut endings = [finished(options(), 2), finished(compressed(), 2)].to_vec();
    // The same without an end: there is no index to compare with.
    let cut: Vec<Vec<u8>> = endings.iter().map(|file| file[..data_end(file)].to_vec()).collect();
    endings.extend(cut);
    for (n, file) in endings.iter().enumerate() {
        // The compressed files differ in the content of their chunks only, which has a checksum.
        let is_compressed = n % 2 == 1;
        for bit in (0..file.len() * 8).filter(|bit| !is_compressed || bit % 8 == bit / 8 % 8) {
            let mut file = file.clone();
            file[bit / 8] ^= 1 << (bit % 8);
            // Without an index both read from the beginning.
            let readers: &[fn(_) -> _] = match n {
                0 | 1 => &[Recording::new, Recording::checked],
                _ => &[Recording::new],
            };
            for reader in readers {
                let (got, losses) = match reader(Cursor::new(&file)) {
                    Ok(recording) => super::files::all(recording),
                    Err(_) => continue,
                };
                let place = format!("file {n}, byte {}, bit {}", bit / 8, bit % 8);
                let mut rest = sent.iter();
                let is_sent = got.iter().all(|message| {
                    // The topic is not in a checksum of its own.
                    rest.any(|sent| sent.1 == message.1 && sent.2 == message.2)
                });
                assert!(is_sent, "{place}: {got:?} {losses:?}");
                assert!(got.len() == sent.len() || !losses.is_empty(), "{place}: hidden loss");
            }
        }
    }
}

/// Where the record is that ends the data.
fn data_end(file: &[u8]) -> usize {
    let end = [0x0F, 4, 0, 0, 0, 0, 0, 0, 0];
    file.windows(end.len()).position(|bytes| bytes == end).unwrap()
}

#[test]
fn a_damaged_chunk_is_left_out_and_the_others_are_read() {
    for options in [options(), compressed()] {
        let mut file = finished(options, 3);
        let middle = chunk_starts(&file)[1];
        file[middle + 60] ^= 0x10;
        let sent = messages(3);
        let expected: Vec<_> = [&sent[..5], &sent[10..]].concat();
        let (got, losses) = read(&file);
        assert_eq!(got, expected);
        assert_eq!(losses.len(), 1);
        assert_eq!((&losses[0].damage, losses[0].after), (&Damage::Checksum, Some(sent[4].1)));
        let (got, losses) = check(&file);
        assert_eq!(got, expected);
        assert_eq!(losses[0].bytes.start, middle as u64);
        assert_eq!(losses[1].damage, Damage::Fewer { missing: IN_A_CHUNK });
    }
}

#[test]
fn a_changed_fact_is_found_by_the_checksum_of_the_whole_file() {
    let mut file = finished(compressed(), 2);
    let mut recording = Recording::new(Cursor::new(&file)).unwrap();
    recording.check_whole().unwrap();
    assert_eq!(recording.losses(), []);
    let fact = file.windows(7).position(|bytes| bytes == b"version").unwrap();
    file[fact] ^= 1;
    let mut recording = Recording::new(Cursor::new(&file)).unwrap();
    assert_eq!(recording.messages().count(), messages(2).len());
    recording.check_whole().unwrap();
    let damage =
        |losses: &[Loss]| losses.iter().map(|loss| loss.damage.clone()).collect::<Vec<_>>();
    assert_eq!(damage(recording.losses()), [Damage::Unprotected]);
    assert_eq!(damage(&check(&file).1), [Damage::Unprotected]);
}

#[test]
fn reading_continues_behind_garbage() {
    let file = finished(compressed(), 3);
    let sent = messages(3);
    let middle = chunk_starts(&file)[1];
    for garbage in [&[0xFF; 1000][..], &[0; 5000], &[6; 70_000], b"x"] {
        let file = [&file[..middle], garbage, &file[middle..]].concat();
        let (got, losses) = read(&file);
        assert_eq!(got, sent);
        assert_eq!(losses[0].bytes, middle as u64..(middle + garbage.len()) as u64);
        assert_eq!(losses[0].damage, Damage::NoRecord);
    }
}

#[test]
fn an_appended_recording_is_read_too() {
    let file = finished(compressed(), 1);
    let (got, losses) = read(&[&file[..], &file].concat());
    assert_eq!(got, [messages(1), messages(1)].concat());
    assert!(!losses.is_empty());
}

#[test]
fn a_hole_of_zeros_at_the_end_is_no_message() {
    let file = finished(options(), 2);
    let starts = chunk_starts(&file);
    let mut cut = file[..starts[1] + 200].to_vec();
    let whole = read(&cut).0;
    cut.truncate(starts[1] + 150);
    cut.resize(starts[1] + 200, 0);
    let (got, losses) = read(&cut);
    assert!(got.len() >= 5 && whole.starts_with(&got) && got.len() < whole.len());
    assert!(!losses.is_empty());
}

/// A file that stays as it is when its writer is killed.
#[derive(Clone, Default)]
struct Disk(Arc<Mutex<Cursor<Vec<u8>>>>);

impl Write for Disk {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.0.lock().unwrap().write(bytes)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

impl Seek for Disk {
    fn seek(&mut self, to: SeekFrom) -> std::io::Result<u64> {
        self.0.lock().unwrap().seek(to)
    }
}

#[test]
fn the_file_of_a_killed_writer_gives_all_that_was_written() {
    for (options, partial) in [(options(), true), (options().disable_seeking(true), false)] {
        let disk = Disk::default();
        let mut writer = WriteOptions::create(options, disk.clone()).unwrap();
        let channel_id = write(&mut writer, 3);
        // A chunk that is not finished.
        let header = mcap::records::MessageHeader {
            channel_id,
            sequence: 0,
            log_time: 1_800_000_000_000_000_000,
            publish_time: 0,
        };
        writer.write_to_known_channel(&header, b"late").unwrap();
        std::mem::forget(writer);
        let file = disk.0.lock().unwrap().get_ref().clone();
        let (got, losses) = read(&file);
        assert_eq!(got[..15], messages(3));
        assert_eq!(got.len(), if partial { 16 } else { 15 });
        let expected = if partial { Damage::Cut } else { Damage::Unfinished };
        assert_eq!(losses[0].damage, expected);
        assert_eq!(losses[0].after, Some(got.last().unwrap().1));
    }
}

#[test]
fn a_file_with_very_many_damaged_places_is_read() {
    let mut file = finished(options(), 1);
    let start = chunk_starts(&file)[0];
    // Its messages are damaged, and the byte behind it does not begin a record.
    file[start + 60] ^= 0x10;
    let end =
        start + 9 + u64::from_le_bytes(file[start + 1..start + 9].try_into().unwrap()) as usize;
    let chunk = [&file[start..end], b"x"].concat();
    let file = [&file[..start], &chunk.repeat(30_000)].concat();
    let (got, losses) = check(&file);
    assert_eq!((got.len(), losses.len()), (0, 30_000));
}

#[test]
fn sizes_of_a_damaged_file_take_no_memory() {
    let file = finished(compressed(), 1);
    let start = chunk_starts(&file)[0];
    // Length of the record; sizes of the chunk before and after compression.
    for field in [start + 1, start + 9 + 16, start + 9 + 36] {
        let mut file = file.clone();
        file[field..field + 8].copy_from_slice(&(1u64 << 50).to_le_bytes());
        let (got, losses) = read(&file);
        assert!(got.len() <= 5 && !losses.is_empty());
    }
}
