//! Recordings: the one that is made, and those in the folder.
//!
//! [`Recordings`] belongs to the server, not to a page: a recording goes on when the page that asked for
//! it has gone. Nothing else waits for it.

mod downsample;
mod excerpt;
mod folder;
mod recorder;

use std::fs::File;
use std::io;
use std::ops::RangeInclusive;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use motorlink_proto::time::Micros;
use motorlink_telemetry::share::address::Address;
use motorlink_telemetry::share::client::{Program, Refusal};
use motorlink_telemetry::share::message::{self as share, Reason};
use parking_lot::Mutex;
use tokio::sync::{Mutex as AsyncMutex, oneshot, watch};
use tokio::task::spawn_blocking;

pub use excerpt::{MOST_SIGNALS, Wanted};
pub use folder::Name;

use crate::message::{Answer, Ask, Recorded};
use folder::Folder;
use recorder::{Making, Order};

/// The rates of signals, in Hz, as `motorlink record` takes them.
const RATES: RangeInclusive<f64> = 0.1..=1000.0;
/// The rate that is not asked for, in Hz.
const RATE: f64 = 100.0;
/// How long the end of the server waits for the end of the file.
const LAST: Duration = Duration::from_secs(10);
/// How often the end of the server looks whether the file has its end.
const LOOKED: Duration = Duration::from_millis(10);

/// The recordings of a server.
pub struct Recordings {
    path: PathBuf,
    share: Arc<dyn Address>,
    told: watch::Sender<Option<Recorded>>,
    making: Mutex<Option<Making>>,
    /// One file is read at a time, so that reading never takes all of the machine.
    folder: Arc<AsyncMutex<Folder>>,
}

impl Recordings {
    /// Recordings of the share, in this folder. The first recording makes the folder.
    pub fn new(path: PathBuf, share: Arc<dyn Address>) -> Self {
        // Pages show it, and the folder of this program says nothing to them.
        let path = std::path::absolute(&path).unwrap_or(path);
        let folder = Arc::new(AsyncMutex::new(Folder::new(path.clone())));
        let (told, _) = watch::channel(None);
        Recordings { path, share, told, making: Mutex::default(), folder }
    }

    /// The recording that is made, or the last one, whenever it changes.
    pub fn watch(&self) -> watch::Receiver<Option<Recorded>> {
        self.told.subscribe()
    }

    /// Carries out a request of the page `by`, which sees the share through `view`.
    ///
    /// # Errors
    /// It is refused.
    pub async fn answer(
        &self,
        ask: Ask,
        by: &str,
        view: Result<Program, Refusal>,
    ) -> Result<Answer, Refusal> {
        match ask {
            Ask::Record { rate } => {
                let rate = rate.unwrap_or(RATE);
                if !RATES.contains(&rate) {
                    let (least, most) = (RATES.start(), RATES.end());
                    return Err(Refusal::usage(format!("a rate is {least} to {most} Hz")));
                }
                let period = Micros((1e6 / rate).round() as u64);
                let share::Answer::Lines { lines, .. } = view?.ask(share::Ask::Lines).await? else {
                    return Err(Refusal::usage("the share gives another answer"));
                };
                Ok(Answer::Record { name: self.record(by, period, lines).await? })
            }
            Ask::EndRecording => {
                Ok(Answer::EndRecording { recording: Box::new(self.end().await?) })
            }
            Ask::Recordings => self.list().await,
            Ask::Recording { name } => {
                let file = self.open(&name)?;
                let read = self.reading(move |_| excerpt::content(name, file)).await?;
                read.map(Answer::Recording).map_err(Refusal::usage)
            }
            _ => Err(Refusal::usage("this is not a request about recordings")),
        }
    }

    /// Begins a recording. It goes on if this is dropped.
    async fn record(
        &self,
        by: &str,
        period: Micros,
        lines: Vec<share::Line>,
    ) -> Result<String, Refusal> {
        let (begun, begins) = oneshot::channel();
        {
            let mut making = self.making.lock();
            let told = self.told.borrow().clone();
            if let Some(told) = told.filter(Recorded::is_active) {
                let message = format!("{} records already, for {}", told.name, told.by);
                return Err(Refusal::new(Reason::Busy, message));
            }
            let (folder, share) = (self.path.clone(), Arc::clone(&self.share));
            let order = Order { folder, share, lines, period, by: by.to_owned() };
            *making = Some(Making::start(order, self.told.clone(), begun)?);
        }
        let fault = || Refusal::usage("the server has a fault");
        begins.await.unwrap_or_else(|_| Err(fault()))
    }

    /// Ends the recording, and waits until its file is whole.
    async fn end(&self) -> Result<Recorded, Refusal> {
        let nothing = || Refusal::usage("nothing is recorded");
        let mut told = self.watch();
        if !told.borrow().as_ref().is_some_and(Recorded::is_active) {
            return Err(nothing());
        }
        self.making.lock().as_ref().ok_or_else(nothing)?.end();
        let is_over = |told: &Option<Recorded>| !told.as_ref().is_some_and(Recorded::is_active);
        let ended = told.wait_for(is_over).await.map_err(|_| nothing())?;
        ended.clone().ok_or_else(nothing)
    }

    /// Ends the recording, and waits a while for that: the server ends.
    pub fn close(&self) {
        let Some(making) = self.making.lock().take() else { return };
        making.end();
        let began = Instant::now();
        // A disk that does not answer must not keep the server.
        while !making.is_over() && began.elapsed() < LAST {
            std::thread::sleep(LOOKED);
        }
    }

    async fn list(&self) -> Result<Answer, Refusal> {
        let told = self.told.borrow().clone();
        let active = told.filter(Recorded::is_active).and_then(|told| Name::new(&told.name));
        let listed = self.reading(move |folder| folder.list(active.as_ref())).await?;
        let folder = self.path.display().to_string();
        let (recordings, older) = listed
            .map_err(|error| Refusal::usage(format!("cannot read the folder {folder}: {error}")))?;
        let older = u32::try_from(older).unwrap_or(u32::MAX);
        Ok(Answer::Recordings { folder, recordings, older })
    }

    /// Opens a recording.
    ///
    /// # Errors
    /// There is no such recording.
    pub fn open(&self, name: &str) -> Result<File, Refusal> {
        let checked = Name::new(name).ok_or(io::ErrorKind::NotFound.into());
        let opened = checked.and_then(|name| folder::open(&self.path, &name));
        opened.map_err(|error: io::Error| {
            Refusal::usage(match error.kind() {
                io::ErrorKind::NotFound => format!("there is no recording `{name}`"),
                _ => format!("cannot read `{name}`: {error}"),
            })
        })
    }

    /// A part of a recording for a plot: frames of a share, first a text with a
    /// [`RecordingPart`](crate::message::RecordingPart), then one with samples for each signal that has
    /// some, whose group is its number. `moves` is called again and again while it reads. It ends if
    /// this is dropped.
    ///
    /// # Errors
    /// It cannot be read.
    pub async fn part(
        &self,
        name: &str,
        wanted: Wanted,
        moves: impl Fn() + Send + 'static,
    ) -> Result<Vec<u8>, Refusal> {
        let file = self.open(name)?;
        // The reader asks whether somebody waits: this is dropped with the future.
        let waits = Arc::new(());
        let is_awaited = Arc::downgrade(&waits);
        let read = self.reading(move |_| {
            excerpt::read(file, &wanted, &|| {
                moves();
                is_awaited.strong_count() > 0
            })
        });
        read.await?.map(Option::unwrap_or_default).map_err(Refusal::usage)
    }

    /// Reads in a thread of its own, after those that read now.
    async fn reading<T: Send + 'static>(
        &self,
        read: impl FnOnce(&mut Folder) -> T + Send + 'static,
    ) -> Result<T, Refusal> {
        let mut folder = Arc::clone(&self.folder).lock_owned().await;
        let read = spawn_blocking(move || read(&mut folder)).await;
        read.map_err(|_| Refusal::usage("the recording cannot be read: the server has a fault"))
    }
}
