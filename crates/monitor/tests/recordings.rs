//! Recordings of a real share of simulated drives.

use std::fs;
use std::os::fd::BorrowedFd;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use crate::world::{LIMIT, World, connect};
use motorlink::port::{ByteLink, EventBytes, Evented, Link, PortError};
use motorlink_monitor::message::{
    Answer, Ask, Condition, Phase, Recorded, RecordingContent, RecordingFile, RecordingPart,
};
use motorlink_monitor::recordings::{Recordings, Wanted};
use motorlink_proto::st::Profile;
use motorlink_recording::read::Recording;
use motorlink_telemetry::share::client::{Program, Refusal};
use motorlink_telemetry::share::data::Data;
use motorlink_telemetry::share::frame::{FrameKind, Reader};
use motorlink_telemetry::share::message::{Reason, decode};
use tokio::time::timeout;

const PAGE: &str = "page 1";

/// A server's recordings, and a page at its share.
struct Desk {
    world: World,
    folder: PathBuf,
    recordings: Arc<Recordings>,
    view: Program,
}

impl Desk {
    async fn new(name: &str) -> Self {
        let folder = crate::world::path(name, "recordings");
        Self::at(name, folder).await
    }

    async fn at(name: &str, folder: PathBuf) -> Self {
        Self::of(World::new(name, Profile::Spec), folder).await
    }

    async fn of(world: World, folder: PathBuf) -> Self {
        motorlink_telemetry::share::port::register();
        let recordings = Arc::new(Recordings::new(folder.clone(), world.share()));
        let (view, _) = connect(&world.share.path, PAGE).await;
        Desk { world, folder, recordings, view }
    }

    async fn ask(&self, ask: Ask) -> Result<Answer, Refusal> {
        let answer = self.recordings.answer(ask, PAGE, Ok(self.view.clone()));
        timeout(LIMIT, answer).await.expect("no answer in time")
    }

    async fn record(&self) -> String {
        match self.ask(Ask::Record { rate: None }).await {
            Ok(Answer::Record { name }) => name,
            other => panic!("{other:?}"),
        }
    }

    async fn end(&self) -> Recorded {
        match self.ask(Ask::EndRecording).await {
            Ok(Answer::EndRecording { recording }) => *recording,
            other => panic!("{other:?}"),
        }
    }

    async fn refused(&self, ask: Ask) -> (Reason, String) {
        match self.ask(ask.clone()).await {
            Err(refusal) => (refusal.reason, refusal.message),
            Ok(answer) => panic!("{ask:?}: {answer:?}"),
        }
    }

    async fn list(&self) -> Vec<RecordingFile> {
        match self.ask(Ask::Recordings).await {
            Ok(Answer::Recordings { recordings, .. }) => recordings,
            other => panic!("{other:?}"),
        }
    }

    async fn content(&self, name: &str) -> RecordingContent {
        match self.ask(Ask::Recording { name: name.to_owned() }).await {
            Ok(Answer::Recording(content)) => content,
            other => panic!("{other:?}"),
        }
    }

    async fn part(&self, name: &str, wanted: Wanted) -> (RecordingPart, Vec<Data>) {
        let bytes = self.recordings.part(name, wanted, || {}).await.unwrap();
        let mut frames = Reader::default();
        frames.push(&bytes);
        let head = frames.take().unwrap().expect("a text");
        assert_eq!(head.kind, FrameKind::Text);
        let mut all = Vec::new();
        while let Some(frame) = frames.take().unwrap() {
            all.push(Data::decode(&frame.payload).unwrap());
        }
        (decode(&head.payload).unwrap(), all)
    }

    /// Waits until what pages are told is so.
    async fn told(&self, is_so: impl Fn(&Recorded) -> bool) -> Recorded {
        let mut told = self.recordings.watch();
        let found = told.wait_for(|told| told.as_ref().is_some_and(&is_so));
        let found = timeout(LIMIT, found).await.expect("it is not so in time").unwrap();
        found.clone().expect("it is so")
    }
}

impl Drop for Desk {
    fn drop(&mut self) {
        self.recordings.close();
        let _ = fs::remove_dir_all(&self.folder);
    }
}

fn read(path: &Path) -> Recording<fs::File> {
    Recording::open(path).unwrap()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_recording_has_all_motors_and_is_whole() {
    let desk = Desk::new("all").await;
    assert_eq!(desk.list().await, []);
    let (reason, why) = desk.refused(Ask::EndRecording).await;
    assert_eq!((reason, &*why), (Reason::Usage, "nothing is recorded"));

    let name = desk.record().await;
    let told = desk.told(|told| told.bytes > 0 && told.values > 200).await;
    assert_eq!((told.phase, &*told.name, &*told.by), (Phase::Recording, &*name, PAGE));
    let motors = ["st0/motor1", "st0/motor2", "rmd0/motor1", "rmd0/motor4"];
    assert!(motors.iter().all(|motor| told.motors.iter().any(|it| it == motor)), "{told:?}");

    let (reason, why) = desk.refused(Ask::Record { rate: None }).await;
    assert_eq!((reason, why), (Reason::Busy, format!("{name} records already, for {PAGE}")));
    // It is not in the list until it is whole. It can be looked at and downloaded.
    assert_eq!(desk.list().await, []);
    assert!(!desk.content(&name).await.signals.is_empty());

    let ended = desk.end().await;
    assert_eq!((ended.phase, ended.lost, &ended.message), (Phase::Ended, 0, &None));
    let [listed] = &desk.list().await[..] else { panic!("one recording") };
    assert_eq!((&listed.name, listed.condition), (&name, Condition::Whole));
    assert_eq!((listed.bytes, &listed.motors), (ended.bytes, &ended.motors));
    let mut recording = read(&desk.folder.join(&name));
    assert_eq!(recording.size(), ended.bytes);
    let tables = recording.tables(|_, _| true).unwrap();
    let values = tables.tables.iter().flat_map(|table| &table.columns).flatten();
    assert_eq!(values.filter(|value| !value.is_nan()).count() as u64, ended.values);

    // The next one has another name, and the first one stays as it is.
    let other = desk.record().await;
    assert_ne!(other, name);
    desk.end().await;
    let names: Vec<String> = desk.list().await.into_iter().map(|it| it.name).collect();
    assert_eq!(names, [other, name]);
}

/// A line whose replies are dropped while its cable is cut.
struct Cable {
    link: Box<dyn EventBytes>,
    is_cut: Arc<AtomicBool>,
}

impl Link for Cable {
    fn within(&self) -> Option<&dyn Link> {
        Some(&self.link)
    }
}

impl ByteLink for Cable {
    fn write(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        self.link.write(bytes)
    }

    fn read(&mut self, buffer: &mut [u8], timeout: Option<Duration>) -> Result<usize, PortError> {
        let size = self.link.read(buffer, timeout)?;
        Ok(if self.is_cut.load(Ordering::SeqCst) { 0 } else { size })
    }
}

impl Evented for Cable {
    fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        self.link.descriptor()
    }

    fn flush(&mut self) -> Result<bool, PortError> {
        self.link.flush()
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn motors_without_values_for_a_time_are_named() {
    let is_cut = Arc::new(AtomicBool::new(false));
    let cut = Arc::clone(&is_cut);
    let around =
        move |link| -> Box<dyn EventBytes> { Box::new(Cable { link, is_cut: Arc::clone(&cut) }) };
    let world = World::with("gaps", (Profile::Spec, crate::world::PATIENT), around, |link| link);
    let desk = Desk::of(world, crate::world::path("gaps", "recordings")).await;
    desk.record().await;
    let told = desk.told(|told| told.values > 200 && told.slowest.is_some()).await;
    assert_eq!(told.gaps, []);
    is_cut.store(true, Ordering::SeqCst);
    let of_line = ["st0/motor1", "st0/motor2"];
    let cut = desk.told(|told| told.gaps.iter().any(|gap| gap.seconds > 3.0)).await;
    assert_eq!(cut.gaps.iter().map(|gap| &*gap.motor).collect::<Vec<_>>(), of_line);
    assert!(of_line.contains(&&*cut.slowest.unwrap().motor));
    is_cut.store(false, Ordering::SeqCst);
    let values = cut.values;
    // The gap stays named after the line is back.
    let back = |told: &Recorded| {
        told.values > values + 1_000 && told.rates.is_some_and(|[_, achieved]| achieved > 50.0)
    };
    let back = desk.told(back).await;
    let ended = desk.end().await;
    for recorded in [&back.gaps, &ended.gaps] {
        assert_eq!(recorded.iter().map(|gap| &*gap.motor).collect::<Vec<_>>(), of_line);
        assert!(recorded.iter().all(|gap| gap.seconds > 3.0), "{recorded:?}");
    }
    let slowest = ended.slowest.unwrap();
    assert!(of_line.contains(&&*slowest.motor) && slowest.rate < 80.0, "{slowest:?}");
    let [listed] = &desk.list().await[..] else { panic!("one recording") };
    assert_eq!((&listed.condition, listed.gaps.len()), (&Condition::Whole, 2));
    for (listed, ended) in listed.gaps.iter().zip(&ended.gaps) {
        assert!(listed.motor == ended.motor && (listed.seconds - ended.seconds).abs() < 0.001);
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn it_goes_on_without_the_page_and_ends_with_the_server() {
    let desk = Desk::new("page-leaves").await;
    let recordings = Arc::clone(&desk.recordings);
    let view = desk.view.clone();
    let page = tokio::spawn(async move {
        recordings.answer(Ask::Record { rate: Some(50.0) }, PAGE, Ok(view)).await
    });
    // The page leaves while the recording starts.
    desk.told(|told| told.phase == Phase::Starting).await;
    page.abort();
    let told = desk.told(|told| told.values > 100 && told.rates.is_some()).await;
    assert_eq!((told.phase, told.rates.map(|[asked, _]| asked)), (Phase::Recording, Some(50.0)));
    let recordings = Arc::clone(&desk.recordings);
    tokio::task::spawn_blocking(move || recordings.close()).await.unwrap();
    let mut recording = read(&desk.folder.join(&told.name));
    assert_eq!(recording.losses(), []);
    assert!(recording.messages().count() > 100);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_recording_that_starts_can_be_ended() {
    let desk = Desk::new("starts").await;
    for rate in [0.0, -1.0, 1e9, f64::NAN, f64::INFINITY] {
        let (reason, why) = desk.refused(Ask::Record { rate: Some(rate) }).await;
        assert_eq!((reason, &*why), (Reason::Usage, "a rate is 0.1 to 1000 Hz"));
    }
    assert!(!desk.folder.exists());
    let asked = desk.ask(Ask::Record { rate: None });
    let ended = async {
        desk.told(|told| told.phase == Phase::Starting).await;
        desk.end().await
    };
    let (asked, ended) = tokio::join!(asked, ended);
    // Either the end came in time, or there is a short recording.
    match asked {
        Ok(_) => assert_eq!(ended.phase, Phase::Ended),
        Err(refusal) => {
            assert_eq!((ended.phase, ended.message), (Phase::Failed, Some(refusal.message)));
            assert_eq!(desk.list().await, []);
        }
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_folder_that_cannot_be_written_is_said() {
    let below = crate::world::path("folder", "missing").join("below");
    let desk = Desk::at("missing", below.clone()).await;
    let (reason, why) = desk.refused(Ask::Record { rate: None }).await;
    assert_eq!(reason, Reason::Usage);
    let expected = format!("cannot make the folder {}: No such file or directory", below.display());
    assert!(why.starts_with(&expected), "{why}");
    assert_eq!(desk.told(|_| true).await.message, Some(why));

    // A file in its place.
    fs::create_dir(below.parent().unwrap()).unwrap();
    fs::write(&below, "").unwrap();
    let (_, why) = desk.refused(Ask::Record { rate: None }).await;
    assert!(why.starts_with("cannot make the folder "), "{why}");
    let (_, why) = desk.refused(Ask::Recordings).await;
    assert!(why.starts_with("cannot read the folder "), "{why}");
    fs::remove_file(&below).unwrap();

    // For root, every folder can be written.
    fs::create_dir(&below).unwrap();
    fs::set_permissions(&below, fs::Permissions::from_mode(0o500)).unwrap();
    if fs::write(below.join("probe"), "").is_err() {
        let (_, why) = desk.refused(Ask::Record { rate: None }).await;
        assert!(why.starts_with("cannot write "), "{why}");
        assert!(why.ends_with("Permission denied (os error 13)"), "{why}");
    }
    fs::set_permissions(&below, fs::Permissions::from_mode(0o700)).unwrap();
    // It can be repaired without a new start of the server.
    desk.record().await;
    assert_eq!(desk.end().await.phase, Phase::Ended);
    fs::remove_dir_all(below.parent().unwrap()).unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn names_lead_to_recordings_of_the_folder_only() {
    let desk = Desk::new("names").await;
    fs::create_dir(&desk.folder).unwrap();
    let outside = crate::world::path("names", "outside.mcap");
    fs::write(&outside, "secret").unwrap();
    std::os::unix::fs::symlink(&outside, desk.folder.join("link.mcap")).unwrap();
    fs::create_dir(desk.folder.join("folder.mcap")).unwrap();
    fs::write(desk.folder.join("notes.txt"), "secret").unwrap();
    fs::write(desk.folder.join("text.mcap"), "no recording").unwrap();
    rustix::fs::mknodat(
        rustix::fs::CWD,
        desk.folder.join("fifo.mcap"),
        rustix::fs::FileType::Fifo,
        rustix::fs::Mode::RWXU,
        0,
    )
    .unwrap();
    let dots = format!("../{}", outside.file_name().unwrap().to_str().unwrap());
    let names = ["link.mcap", "folder.mcap", "fifo.mcap", "notes.txt", &dots, "", "no.mcap"];
    for name in names.into_iter().chain([outside.to_str().unwrap()]) {
        assert!(desk.recordings.open(name).is_err(), "{name}");
        let (reason, why) = desk.refused(Ask::Recording { name: name.to_owned() }).await;
        assert_eq!(reason, Reason::Usage);
        assert!(!why.contains("secret"), "{why}");
    }
    let [listed] = &desk.list().await[..] else { panic!("one file") };
    assert_eq!((&*listed.name, listed.condition), ("text.mcap", Condition::Unreadable));
    assert_eq!(listed.message.as_deref(), Some("this is no MCAP file"));
    fs::remove_file(outside).unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_part_has_the_recorded_values() {
    let desk = Desk::new("part").await;
    let name = desk.record().await;
    desk.told(|told| told.values > 3000).await;
    desk.end().await;
    let content = desk.content(&name).await;
    let number = content.signals.iter().position(|it| it.name == "BUS_VOLTAGE").unwrap();
    let signal = &content.signals[number];
    assert_eq!((&*signal.motor, &*signal.unit), ("st0/motor1", "V"));
    let speed = content.signals.iter().position(|it| it.name == "SPEED_MEAS").unwrap();

    let wanted =
        Wanted { signals: vec![number, speed, 9999], from: -5.0, to: 1e9, points: 100_000 };
    let (part, all) = desk.part(&name, wanted.clone()).await;
    assert_eq!((part.from, part.to), (0.0, content.seconds));
    assert_eq!(part.damage, None);
    assert!(part.events.iter().any(|event| event.kind == "joined"), "{:?}", part.events);
    let tables = read(&desk.folder.join(&name))
        .tables(|topic, field| topic.contains("/motor1/") && field.signal == "SPEED_MEAS")
        .unwrap();
    let [table] = &tables.tables[..] else { panic!("one table") };
    let data = all.iter().find(|data| data.group as usize == speed).unwrap();
    let [times, spans, values] = &data.columns[..] else { panic!("three columns") };
    let given: Vec<(f64, f64, f64)> = (0..data.rows())
        .filter(|row| !values[*row].is_nan())
        .map(|row| (times[row], spans[row], values[row]))
        .collect();
    let zero = (content.zero * 1e9).round();
    assert_eq!(given.len(), table.times.len());
    for (row, (t, span, value)) in given.into_iter().enumerate() {
        assert!((t - (table.times[row] as f64 - zero) / 1e9).abs() < 1e-5);
        assert_eq!((span, value), (table.spans[row], table.columns[0][row]));
    }

    // A short part, with few points.
    let short = Wanted { from: 0.5, to: 0.6, points: 20, ..wanted };
    let (part, all) = desk.part(&name, short).await;
    assert_eq!((part.from, part.to), (0.5, 0.6));
    for data in all {
        assert!(data.rows() <= 20);
        assert!(data.columns[0].iter().filter(|t| **t < 0.5).count() <= 2);
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_reader_that_leaves_ends_the_reading() {
    let desk = Desk::new("reader").await;
    let name = desk.record().await;
    desk.told(|told| told.values > 500).await;
    let (recordings, wanted) = (
        Arc::clone(&desk.recordings),
        Wanted { signals: vec![0], from: 0.0, to: 1e9, points: 1000 },
    );
    let (begun, begins) = std::sync::mpsc::channel();
    let reading = {
        let (name, wanted) = (name.clone(), wanted.clone());
        tokio::spawn(async move {
            let moves = move || {
                let _ = begun.send(());
                std::thread::sleep(Duration::from_millis(50));
            };
            recordings.part(&name, wanted, moves).await
        })
    };
    // Reading would take half a minute now. The recording does not wait for it.
    tokio::task::spawn_blocking(move || begins.recv_timeout(LIMIT)).await.unwrap().unwrap();
    let before = desk.told(|_| true).await.values;
    desk.told(|told| told.values > before + 500).await;
    reading.abort();
    let (_, all) = desk.part(&name, wanted).await;
    assert_eq!(all.len(), 1);
    assert_eq!(desk.end().await.phase, Phase::Ended);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_removed_file_is_said_and_another_recording_can_begin() {
    let desk = Desk::new("removed").await;
    let name = desk.record().await;
    desk.told(|told| told.bytes > 0).await;
    fs::remove_file(desk.folder.join(&name)).unwrap();
    let told = desk.told(|told| told.phase == Phase::Failed).await;
    let why = told.message.unwrap();
    assert!(why.contains("was removed while it was written"), "{why}");
    desk.record().await;
    desk.told(|told| told.values > 0).await;
    assert_eq!(desk.end().await.phase, Phase::Ended);
    assert!(desk.world.share.path.exists());
}
