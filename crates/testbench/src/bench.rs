//! Drives in the process, on virtual time.

use std::io::ErrorKind;
use std::os::fd::AsFd;
use std::os::unix::net::UnixStream;
use std::sync::mpsc;
use std::thread::JoinHandle;
use std::time::Duration;

use motorlink_link::Clock;
use motorlink_link::fault::Faults;
use motorlink_link::port::{ByteLink, CanLink, FaultBytes, FaultCan, PortError};
use motorlink_link::serve::ServeName;
use motorlink_link::serve::{Served, Server};
use motorlink_proto::rmd::IDENTIFIERS;
use motorlink_proto::st::Profile;
use motorlink_proto::time::{self, Instant};
use motorlink_sim::hash;
use serde_json::Value;

use super::cast::Cast;
use super::drives::{Drives, Recording, Stage};
use super::line::{RmdStage, SimBytes, SimCan, StStage};
use super::places::{Kind, ServedDrives};
use super::signals::{Signal, find_signal};
use super::{BenchConfig, Command, ConfigError};

/// A byte at 115200 baud.
const BYTE: Duration = Duration::from_micros(87);
/// A CAN frame of 8 bytes at 1 Mbit/s, with some stuffed bits.
const FRAME: Duration = Duration::from_micros(125);
/// Drives step at multiples of this.
const STEP: time::Micros = time::Micros(50);
/// How often drives on served ports are advanced while no request comes.
const FOLLOW: Duration = Duration::from_millis(20);

/// An ST drive and a bus of RMD motors in the process, on virtual time: it advances when a client
/// waits, while bytes are transmitted, and in [`run`](Self::run). No thread sleeps. The same calls from
/// one thread give the same answers.
///
/// [`serve`](Self::serve) runs the same drives in real time, on ports.
pub struct Bench {
    clock: Clock,
    stage: Stage,
    places: ServedDrives,
    signals: Vec<Signal>,
    profile: Profile,
}

impl Bench {
    /// Powers the drives on at time 0.
    ///
    /// # Errors
    /// As [`BenchConfig::station`].
    pub fn new(config: &BenchConfig) -> Result<Self, ConfigError> {
        let cast = Cast { config: config.clone(), st: true, rmd: true };
        let stage = Stage::new(Drives::new(&cast)?);
        let mut places = ServedDrives::default();
        places.add("st".to_owned(), Kind::St, stage.clone());
        places.add("rmd".to_owned(), Kind::Rmd, stage.clone());
        let (signals, profile) = (cast.signals(), config.profile);
        Ok(Bench { clock: Clock::virtual_time(), stage, places, signals, profile })
    }

    /// Protocol profile of the ST drive.
    pub fn profile(&self) -> Profile {
        self.profile
    }

    /// The bench's clock.
    pub fn clock(&self) -> &Clock {
        &self.clock
    }

    /// The bench's time.
    pub fn now(&self) -> Instant {
        self.clock.now()
    }

    /// A serial line to the ST drive, with faults; a byte takes as long as at 115200 baud.
    pub fn bytes(&self, faults: &Faults) -> Box<dyn ByteLink> {
        let link = SimBytes::new(StStage(self.stage.clone()), self.clock.clone());
        Box::new(FaultBytes::paced(link, faults, BYTE))
    }

    /// A CAN bus to the RMD motors, with faults; a frame takes as long as at 1 Mbit/s.
    pub fn can(&self, faults: &Faults) -> Box<dyn CanLink> {
        let link = SimCan::new(RmdStage(self.stage.clone()), self.clock.clone());
        Box::new(FaultCan::paced(link, faults, IDENTIFIERS, FRAME))
    }

    /// Advances the time. While ports are served, this waits in real time.
    pub fn run(&self, span: time::Micros) {
        self.clock.wait(self.now() + span);
        drop(self.stage.at(self.now()));
    }

    /// Executes a command of a bench, whose ports are `st` and `rmd`, and returns the answer.
    ///
    /// # Errors
    /// Why the command was not executed.
    pub fn execute(&self, command: &Command) -> Result<Value, String> {
        if let Command::Pause {} | Command::Resume {} = command {
            return Err("virtual time does not run by itself: `pause` and `resume` have no effect"
                .to_owned());
        }
        self.places.execute(self.now(), command)
    }

    /// The signals, motor by motor.
    pub fn signals(&self) -> &[Signal] {
        &self.signals
    }

    /// The values of all signals at this moment.
    pub fn values(&self) -> Vec<f64> {
        self.stage.at(self.now()).drives.values().collect()
    }

    /// FNV-1a over the state of all drives.
    pub fn state_hash(&self) -> u64 {
        hash::fingerprint(&self.stage.at(self.now()).drives)
    }

    /// Records signals from now on, every 50 µs at most.
    ///
    /// # Errors
    /// A signal does not exist, or the interval is too short.
    pub fn record(&self, signals: &[&str], every: time::Micros) -> Result<Recording, String> {
        if every < STEP {
            return Err(format!(
                "drives step every {} µs: choose an interval of at least that",
                STEP.0
            ));
        }
        let columns = signals.iter().map(|name| find_signal(name, &self.signals));
        Ok(self.stage.record(&self.clock, columns.collect::<Result<_, _>>()?, every))
    }

    /// Serves the drives on ports, in a thread. Time is real time until the result is dropped. Links of
    /// this bench wait in real time meanwhile.
    ///
    /// # Errors
    /// A port that cannot be served, or a bench that is served already.
    pub fn serve(
        &self,
        st: Option<ServeName>,
        rmd: Option<ServeName>,
    ) -> Result<Serving, PortError> {
        if !self.clock.is_virtual() {
            let port = st.or(rmd).map(|port| port.to_string()).unwrap_or_default();
            let why = "this bench is served already: end that first".to_owned();
            return Err(PortError::Unusable { port, why });
        }
        let (stop, stopped) = UnixStream::pair().map_err(failed)?;
        let (tell, told) = mpsc::channel();
        let (clock, stage) = (self.clock.clone(), self.stage.clone());
        // A server cannot change threads: its ports are opened in its own.
        let serve = move || {
            let mut server = Server::by(clock);
            let open = || {
                let line = || Box::new(StStage(stage.clone()));
                let bus = || Box::new(RmdStage(stage.clone()));
                let st = st.map(|port| server.serve_bytes(&port, line())).transpose()?;
                let rmd = rmd.map(|port| server.serve_can(&port, bus())).transpose()?;
                Ok((st, rmd))
            };
            let served: Result<_, PortError> = open();
            let refused = served.is_err();
            if tell.send(served).is_err() || refused {
                return Ok(());
            }
            while !server.turn(FOLLOW, Some(stopped.as_fd()))?.extra_is_ready {
                drop(stage.at(server.now()));
            }
            Ok(())
        };
        let thread = std::thread::Builder::new().name("motorlink-serve".to_owned()).spawn(serve);
        let thread = thread.map_err(failed)?;
        let (st, rmd) = told.recv().map_err(|_| failed(ErrorKind::BrokenPipe.into()))??;
        self.clock.hold(false);
        Ok(Serving { st, rmd, clock: self.clock.clone(), running: Some((stop, thread)) })
    }
}

fn failed(source: std::io::Error) -> PortError {
    PortError::Io { port: "the served ports".to_owned(), source: source.into() }
}

/// Ports on which the drives of a [`Bench`] are served until this is dropped.
#[derive(Debug)]
pub struct Serving {
    st: Option<Served>,
    rmd: Option<Served>,
    clock: Clock,
    /// End of a socket pair that stops the thread when it is closed, and the thread.
    running: Option<(UnixStream, JoinHandle<Result<(), PortError>>)>,
}

impl Serving {
    /// The port of the ST drive.
    pub fn st(&self) -> Option<&Served> {
        self.st.as_ref()
    }

    /// The port of the RMD motors.
    pub fn rmd(&self) -> Option<&Served> {
        self.rmd.as_ref()
    }

    /// Closes the ports. Time is virtual again.
    ///
    /// # Errors
    /// The error that ended the server early.
    pub fn end(mut self) -> Result<(), PortError> {
        self.close()
    }

    fn close(&mut self) -> Result<(), PortError> {
        let Some((stop, thread)) = self.running.take() else { return Ok(()) };
        drop(stop);
        let ended = thread.join();
        self.clock.hold(true);
        ended.unwrap_or_else(|_| Err(failed(ErrorKind::Other.into())))
    }
}

impl Drop for Serving {
    fn drop(&mut self) {
        // The clients have seen the failure.
        let _ = self.close();
    }
}
