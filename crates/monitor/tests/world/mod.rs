//! A share of simulated drives on ptys, what is on its wires, and a page.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use crate::shared::Share;
use motorlink::port::{Direction, EventBytes, EventCan, Tap};
use motorlink_monitor::drive::{Drives, MotionPermit};
use motorlink_monitor::message::{Answer, Ask, RunResult};
use motorlink_proto::st::{Frame, Parse, Profile};
use motorlink_telemetry::share::address::{Address, Local};
use motorlink_telemetry::share::client::{Program, Refusal};
use motorlink_telemetry::share::message::{self as share, MotorName, Reason};

pub use crate::drives::path;
pub use crate::shared::LIMIT;

/// A busy machine may be late with a reply.
pub const PATIENT: Duration = Duration::from_secs(2);

/// A request on a wire: the motor, and the frame code with the payload, or eight bytes.
pub type Sent = (u8, Vec<u8>);

/// A share with the line st0 and the line rmd0.
pub struct World {
    pub share: Share,
    pub st: Arc<Mutex<Vec<Sent>>>,
    pub rmd: Arc<Mutex<Vec<Sent>>>,
}

/// A page at the share, and the drives of its server.
pub struct Page {
    pub drives: Drives,
    pub view: Program,
    pub drive: Drive,
}

/// The session of a page that moves motors.
pub struct Drive {
    path: PathBuf,
    pub lapsed: AtomicBool,
    pub opened: AtomicBool,
    /// The ends of references.
    pub rans: Arc<Mutex<Vec<RunResult>>>,
    session: tokio::sync::Mutex<Option<Program>>,
    listening: Mutex<Option<tokio::task::JoinHandle<()>>>,
}

pub fn st(motor: u8) -> MotorName {
    MotorName { line: "st0".to_owned(), motor }
}

pub fn rmd(motor: u8) -> MotorName {
    MotorName { line: "rmd0".to_owned(), motor }
}

impl World {
    pub fn new(name: &str, profile: Profile) -> Self {
        Self::with(name, (profile, PATIENT), |link| link, |link| link)
    }

    /// With something around the serial line and around the bus, behind the taps. A reply may take
    /// `timeout`.
    pub fn with(
        name: &str,
        (profile, timeout): (Profile, Duration),
        mut around: impl FnMut(Box<dyn EventBytes>) -> Box<dyn EventBytes> + Send + 'static,
        mut around_bus: impl FnMut(Box<dyn EventCan>) -> Box<dyn EventCan> + Send + 'static,
    ) -> Self {
        let [st, rmd] = [(); 2].map(|()| Arc::<Mutex<Vec<Sent>>>::default());
        let (st_wire, rmd_wire) = (Arc::clone(&st), Arc::clone(&rmd));
        let observed = move |link| -> Box<dyn EventBytes> {
            let wire = Arc::clone(&st_wire);
            let mut stream = Vec::new();
            let observer = move |direction, _, bytes: &[u8]| {
                if direction == Direction::Received {
                    return;
                }
                stream.extend(bytes);
                while let Parse::Frame(frame, size) = Frame::parse(&stream) {
                    let bytes = [&[frame.code()], frame.payload].concat();
                    wire.lock().unwrap().push((frame.motor(), bytes));
                    stream.drain(..size);
                }
            };
            Box::new(Tap::bytes(around(link), observer))
        };
        let observed_bus = move |link| -> Box<dyn EventCan> {
            let wire = Arc::clone(&rmd_wire);
            let observer = move |direction, _, frame: &motorlink_proto::can::CanFrame| {
                if direction == Direction::Sent {
                    let motor = (frame.id() - 0x140) as u8;
                    wire.lock().unwrap().push((motor, frame.data().to_vec()));
                }
            };
            Box::new(Tap::frames(around_bus(link), observer))
        };
        let around = (observed, observed_bus);
        let share = Share::of(name, profile, (timeout, timeout), None, around);
        World { share, st, rmd }
    }

    /// A page, with the drives of a server of its own.
    pub async fn page(&self) -> Page {
        let (view, _) = connect(&self.share.path, "page").await;
        let Ok(share::Answer::Lines { lines, .. }) = view.ask(share::Ask::Lines).await else {
            panic!("no lines")
        };
        let drives = Drives::new(lines);
        Page { drives, view, drive: Drive::new(&self.share.path) }
    }

    /// Another page of the same server.
    pub async fn other(&self, page: &Page) -> Page {
        Page { drives: page.drives.clone(), ..self.page().await }
    }

    pub async fn reaches(&self, signal: &str, what: impl Fn(f64) -> bool) {
        let end = Instant::now() + LIMIT;
        while !what(self.share.value(signal)) {
            assert!(Instant::now() < end, "{signal} is {}", self.share.value(signal));
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
    }

    /// Requests to the ST drive that write or command.
    pub fn st_writes(&self) -> Vec<Sent> {
        let read = |(_, bytes): &&Sent| !matches!(bytes[0], 0x02 | 0x06 | 0x08 | 0x0C);
        self.st.lock().unwrap().iter().filter(read).cloned().collect()
    }

    /// Motion commands to an RMD motor, in the order of the wire.
    pub fn rmd_motion(&self, motor: u8) -> Vec<Vec<u8>> {
        let moves = |(to, bytes): &&Sent| *to == motor && (0x80..0xB0).contains(&bytes[0]);
        let sent = self.rmd.lock().unwrap();
        let reads = [0x90, 0x92, 0x94, 0x9A, 0x9B, 0x9C, 0x9D];
        sent.iter()
            .filter(moves)
            .filter(|(_, bytes)| !reads.contains(&bytes[0]))
            .map(|(_, bytes)| bytes.clone())
            .collect()
    }

    /// The share, for programs.
    pub fn share(&self) -> Arc<dyn Address> {
        Arc::new(Local(self.share.path.clone()))
    }

    /// Executes a command of the bench, as JSON.
    pub fn execute(&self, json: &str) {
        let command = motorlink_testbench::Command::read(json).unwrap();
        self.share.bench.execute(&command).unwrap();
    }
}

pub async fn connect(path: &Path, name: &str) -> (Program, tokio::task::JoinHandle<()>) {
    let share: Arc<dyn Address> = Arc::new(Local(path.to_owned()));
    let (program, mut listener, _) = Program::connect(&share, name).await.unwrap();
    let listening = tokio::spawn(async move { while listener.next().await.is_ok() {} });
    (program, listening)
}

impl Page {
    pub async fn ask(&self, ask: Ask) -> Result<Answer, Refusal> {
        let answer = self.drives.answer(ask, &self.view, &self.drive);
        tokio::time::timeout(LIMIT, answer).await.expect("no answer in time")
    }

    pub async fn refused(&self, ask: Ask) -> (Reason, String) {
        match self.ask(ask.clone()).await {
            Err(refusal) => (refusal.reason, refusal.message),
            Ok(answer) => panic!("{ask:?}: {answer:?}"),
        }
    }

    pub async fn read(&self, motor: MotorName, names: &[&str]) -> Vec<(Option<f64>, String)> {
        let names = names.iter().map(|name| (*name).to_owned()).collect();
        match self.ask(Ask::Read { motor, names }).await {
            Ok(Answer::Read { values }) => {
                values.into_iter().map(|value| (value.value, value.text)).collect()
            }
            other => panic!("{other:?}"),
        }
    }

    pub async fn act(
        &self,
        motor: MotorName,
        command: &str,
        values: &[(&str, f64)],
    ) -> Result<Answer, Refusal> {
        self.ask(act(motor, command, values)).await
    }

    /// A stop of this page.
    pub async fn stop(&self, motor: MotorName) {
        let answer = self.view.ask(share::Ask::Stop { motor: Some(motor) }).await.unwrap();
        let share::Answer::Stop { motors } = answer else { panic!("{answer:?}") };
        assert_eq!(motors[0].failure, None);
    }
}

pub fn act(motor: MotorName, command: &str, values: &[(&str, f64)]) -> Ask {
    let values = values.iter().map(|(name, value)| ((*name).to_owned(), *value)).collect();
    Ask::Act { motor, command: command.to_owned(), values, hold: false, to_rom: false }
}

impl Drive {
    fn new(path: &Path) -> Self {
        Drive {
            path: path.to_owned(),
            lapsed: AtomicBool::new(false),
            opened: AtomicBool::new(false),
            rans: Arc::default(),
            session: tokio::sync::Mutex::default(),
            listening: Mutex::default(),
        }
    }

    /// The page gives no sign of life any more: its session ends.
    pub async fn lapse(&self) {
        self.lapsed.store(true, Ordering::SeqCst);
        *self.session.lock().await = None;
        if let Some(listening) = self.listening.lock().unwrap().take() {
            listening.abort();
        }
    }
}

impl MotionPermit for Drive {
    async fn program(&self, _: bool) -> Result<Program, Refusal> {
        if self.lapsed.load(Ordering::SeqCst) {
            return Err(Refusal::new(Reason::Lapsed, "the page gives no sign of life"));
        }
        let mut session = self.session.lock().await;
        if session.is_none() {
            let (program, listening) = connect(&self.path, "page (control)").await;
            *self.listening.lock().unwrap() = Some(listening);
            *session = Some(program);
        }
        self.opened.store(true, Ordering::SeqCst);
        Ok(session.clone().expect("it was set"))
    }

    fn report(&self) -> impl FnOnce(RunResult) + Send + 'static {
        let rans = Arc::clone(&self.rans);
        move |ran| rans.lock().unwrap().push(ran)
    }
}
