//! Files: whole, cut, in parts, in places that cannot be written.

use std::collections::BTreeMap;
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::time::Duration;

use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use motorlink_recording::WriteError;
use motorlink_recording::schema::recording::{NAME, PART};
use motorlink_recording::schema::{Log, Message, Severity, Time};
use motorlink_recording::write::{Attached, Entry, Output, Rotate, Series, Topic, Writer};

/// A folder for one test.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let folder = std::env::temp_dir().join(format!("motorlink-{}-{name}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        Folder(folder)
    }

    fn output(&self, name: &str) -> Output {
        Output { path: self.0.join(name), ..Output::default() }
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

fn preamble() -> [Entry; 2] {
    let topic = Topic {
        name: "/events".to_owned(),
        ty: Log::TYPE.to_owned(),
        definition: Log::definition(),
        metadata: BTreeMap::new(),
    };
    [Entry::Metadata(NAME.to_owned(), BTreeMap::new()), Entry::Topic(topic)]
}

fn message(number: u64) -> Entry {
    let log = Log {
        stamp: Time(number),
        severity: Severity::Info,
        name: "st0".to_owned(),
        message: format!("message {number}"),
        by: String::new(),
        kind: "test".to_owned(),
    };
    Entry::Message { topic: 0, time: number, data: log.encode() }
}

fn begin(output: Output) -> Series {
    let mut series = Series::create(output).unwrap();
    preamble().into_iter().for_each(|entry| series.take(entry).unwrap());
    series
}

/// The numbers of the messages of a file that may end anywhere.
fn messages(bytes: &[u8]) -> Vec<u64> {
    let options = LinearReaderOptions::default().with_skip_end_magic(true);
    let mut reader = LinearReader::new_with_options(options);
    let (mut rest, mut found) = (bytes, Vec::new());
    while let Some(Ok(event)) = reader.next_event() {
        match event {
            LinearReadEvent::ReadRequest(wanted) => {
                let (now, later) = rest.split_at(wanted.min(rest.len()));
                reader.insert(now.len()).copy_from_slice(now);
                reader.notify_read(now.len());
                rest = later;
            }
            LinearReadEvent::Record { data, opcode } => {
                let record = mcap::parse_record(opcode, data).unwrap();
                if let mcap::records::Record::Message { header, .. } = record {
                    found.push(header.log_time);
                }
            }
        }
    }
    found
}

fn whole(path: &Path) -> Vec<u64> {
    let bytes = fs::read(path).unwrap();
    assert!(mcap::Summary::read(&bytes).unwrap().is_some());
    mcap::MessageStream::new(&bytes).unwrap().map(|it| it.unwrap().log_time).collect()
}

#[test]
fn everything_that_was_flushed_is_in_the_file_whatever_comes_after() {
    let folder = Folder::new("flushed");
    let mut series = begin(folder.output("run.mcap"));
    (0..100).for_each(|number| series.take(message(number)).unwrap());
    series.flush().unwrap();
    let flushed = fs::read(folder.0.join("run.mcap")).unwrap();
    (100..200).for_each(|number| series.take(message(number)).unwrap());
    let killed = fs::read(folder.0.join("run.mcap")).unwrap();
    assert_eq!(killed, flushed);
    assert_eq!(messages(&killed), (0..100).collect::<Vec<u64>>());
    series.flush().unwrap();
    // A part of the next chunk takes nothing from those before.
    let longer = fs::read(folder.0.join("run.mcap")).unwrap();
    for end in flushed.len()..longer.len() {
        let found = messages(&longer[..end]).len();
        assert!(found >= 100, "{found} messages in {end} bytes of {}", longer.len());
    }
    let written = series.finish().unwrap();
    assert_eq!((written.messages, written.files.len()), (200, 1));
    assert_eq!(whole(&written.files[0]), (0..200).collect::<Vec<u64>>());
    assert_eq!(written.bytes, fs::metadata(&written.files[0]).unwrap().len());
}

#[test]
fn every_file_of_a_rotated_recording_is_whole() {
    let folder = Folder::new("rotated");
    let rotate = Some(Rotate::Time(Duration::from_nanos(40)));
    let mut series = begin(Output { rotate, ..folder.output("run.mcap") });
    let settings = Attached {
        name: "st0.settings".to_owned(),
        media_type: "text/plain".to_owned(),
        time: 0,
        data: b"SPEED_KP = 1".to_vec(),
    };
    series.take(Entry::Attached(settings)).unwrap();
    (0..100).for_each(|number| series.take(message(number)).unwrap());
    let written = series.finish().unwrap();
    assert_eq!(written.messages, 100);
    for file in &written.files {
        let bytes = fs::read(file).unwrap();
        let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
        let attached = mcap::read::attachment(&bytes, &summary.attachment_indexes[0]).unwrap();
        assert_eq!(&*attached.data, b"SPEED_KP = 1", "{file:?}");
    }
    let names: Vec<_> = written.files.iter().map(|it| it.file_name().unwrap()).collect();
    assert_eq!(names, ["run_000.mcap", "run_001.mcap", "run_002.mcap"]);
    assert_eq!(whole(&written.files[0]), (0..40).collect::<Vec<u64>>());
    assert_eq!(whole(&written.files[2]), (80..100).collect::<Vec<u64>>());
    let bytes = fs::read(&written.files[2]).unwrap();
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    let metadata = mcap::read::metadata(&bytes, &summary.metadata_indexes[0]).unwrap();
    assert_eq!((&*metadata.name, &*metadata.metadata[PART]), (NAME, "2"));
}

#[test]
fn a_file_is_rotated_and_ended_by_its_size() {
    let folder = Folder::new("size");
    let rotate = Some(Rotate::Bytes(4_000));
    let mut series = begin(Output { rotate, max_size: Some(10_000), ..folder.output("run.mcap") });
    let mut number = 0;
    while !series.is_complete() {
        series.take(message(number)).unwrap();
        series.flush().unwrap();
        number += 1;
    }
    let written = series.finish().unwrap();
    assert!((2..=3).contains(&written.files.len()), "{written:?}");
    let kept: Vec<u64> = written.files.iter().flat_map(|file| whole(file)).collect();
    assert_eq!(kept, (0..number).collect::<Vec<u64>>());
}

#[test]
fn a_file_that_exists_is_overwritten_only_when_asked_and_only_by_a_recording_that_begins() {
    let folder = Folder::new("exists");
    let output = folder.output("run.mcap");
    fs::write(&output.path, "old").unwrap();
    let path = output.path.clone();
    let refused = Series::create(output.clone()).map(drop).unwrap_err();
    assert!(matches!(refused, WriteError::Exists { path: it } if it == path));
    drop(begin(Output { force: true, ..output.clone() }));
    assert_eq!(fs::read(&path).unwrap(), b"old");
    let written = begin(Output { force: true, ..output }).finish().unwrap();
    assert_eq!(whole(&written.files[0]), Vec::<u64>::new());
}

#[test]
fn two_recordings_never_share_a_file() {
    let folder = Folder::new("shared");
    let output = Output { force: true, ..folder.output("run.mcap") };
    let mut first = begin(output.clone());
    first.take(message(1)).unwrap();
    let refused = Series::create(output.clone()).map(drop).unwrap_err();
    assert!(refused.to_string().ends_with("another recording writes it"), "{refused}");
    let written = first.finish().unwrap();
    assert_eq!(whole(&written.files[0]), [1]);
    assert!(Series::create(output).is_ok());
}

#[test]
fn only_a_regular_file_is_overwritten() {
    let folder = Folder::new("regular");
    for path in ["/dev/null".into(), folder.0.clone()] {
        for force in [false, true] {
            let output = Output { path: PathBuf::clone(&path), force, ..Output::default() };
            let refused = Series::create(output).map(drop).unwrap_err();
            assert!(refused.to_string().ends_with("it is not a regular file"), "{refused}");
        }
    }
}

#[test]
fn a_rotated_recording_begins_only_if_the_names_of_all_its_files_are_free() {
    let folder = Folder::new("parts");
    for other in ["run_x01.mcap", "run_01.mcap", "run_001.csv", "other_001.mcap"] {
        fs::write(folder.0.join(other), "other").unwrap();
    }
    let rotate = Some(Rotate::Bytes(4_000));
    let output = Output { rotate, ..folder.output("run.mcap") };
    assert!(Series::create(output.clone()).is_ok());
    for old in ["run_1000.mcap", "run_012.mcap"] {
        fs::write(folder.0.join(old), "old").unwrap();
        let refused = Series::create(output.clone()).map(drop).unwrap_err();
        let first = folder.0.join(old);
        assert!(matches!(refused, WriteError::Exists { path } if path == first));
    }
    assert!(Series::create(Output { force: true, ..output }).is_ok());
    assert!(Series::create(folder.output("run.mcap")).is_ok());
}

#[test]
fn a_recording_that_does_not_begin_leaves_no_file() {
    let folder = Folder::new("none");
    drop(begin(folder.output("run.mcap")));
    assert_eq!(fs::read_dir(&folder.0).unwrap().count(), 0);
}

#[test]
fn a_folder_that_is_not_there_or_cannot_be_written_is_refused_before_all() {
    let folder = Folder::new("folder");
    let missing = Series::create(folder.output("none/run.mcap")).map(drop).unwrap_err();
    assert!(missing.to_string().ends_with("run.mcap: No such file or directory (os error 2)"));
    fs::set_permissions(&folder.0, fs::Permissions::from_mode(0o500)).unwrap();
    // Root may write everywhere.
    if let Err(refused) = Series::create(folder.output("run.mcap")) {
        assert!(refused.to_string().contains("Permission denied"), "{refused}");
    }
    fs::set_permissions(&folder.0, fs::Permissions::from_mode(0o700)).unwrap();
}

#[test]
fn a_file_that_is_removed_is_noticed() {
    let folder = Folder::new("removed");
    let mut series = begin(folder.output("run.mcap"));
    series.flush().unwrap();
    fs::remove_file(folder.0.join("run.mcap")).unwrap();
    series.take(message(1)).unwrap();
    assert!(matches!(series.flush(), Err(WriteError::Removed { .. })));
}

#[test]
fn a_file_that_another_program_shortens_is_noticed() {
    let folder = Folder::new("shortened");
    let mut series = begin(folder.output("run.mcap"));
    series.flush().unwrap();
    fs::write(folder.0.join("run.mcap"), "").unwrap();
    series.take(message(1)).unwrap();
    assert!(matches!(series.flush(), Err(WriteError::Changed { .. })));
}

#[test]
fn a_file_is_whole_even_if_the_next_one_cannot_be_made() {
    let folder = Folder::new("next");
    let rotate = Some(Rotate::Time(Duration::from_nanos(40)));
    let series = begin(Output { rotate, ..folder.output("run.mcap") });
    fs::write(folder.0.join("run_001.mcap"), "old").unwrap();
    let writer = Writer::start(series).unwrap();
    (0..100).for_each(|number| assert!(writer.queue().push(message(number))));
    assert!(matches!(writer.end(), Err(WriteError::Exists { .. })));
    assert_eq!(whole(&folder.0.join("run_000.mcap")), (0..40).collect::<Vec<u64>>());
    assert_eq!(fs::read(folder.0.join("run_001.mcap")).unwrap(), b"old");
}
