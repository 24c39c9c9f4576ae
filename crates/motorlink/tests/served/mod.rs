//! Simulated drives behind ports, served by a thread of the test.
#![allow(dead_code)]

use std::io::{BufRead, BufReader, Write};
use std::os::fd::AsFd;
use std::os::unix::net::UnixStream;
use std::path::PathBuf;
use std::thread::JoinHandle;
use std::time::Duration;

use motorlink_testbench::{BenchConfig, SimServer};

/// Drives that are gone when it is dropped.
pub struct Served {
    /// Port of the ST drive, if there is one.
    pub st: String,
    /// Port of the RMD bus.
    pub rmd: String,
    control: Option<UnixStream>,
    thread: Option<JoinHandle<()>>,
}

impl Served {
    /// Serves the default bench; `name` is the test's own.
    pub fn new(name: &str) -> Self {
        let folder: PathBuf = env!("CARGO_TARGET_TMPDIR").into();
        let path = |kind: &str| folder.join(format!("{name}-{kind}-{}", std::process::id()));
        let (st, can) = (path("st").display().to_string(), path("can").display().to_string());
        let ports = (Some(format!("pty:{st}")), format!("slcan-pty:{can}"));
        Self::start(BenchConfig::default(), ports, st, format!("slcan:{can}"))
    }

    /// Serves RMD motors 1 to `count` on a CAN interface, and no ST drive.
    pub fn on(interface: &str, count: u8) -> Self {
        let motors: String = (1..=count).map(|id| format!("[[rmd.motor]]\nid = {id}\n")).collect();
        let config = BenchConfig::parse(&motors).expect("a configuration");
        let port = format!("socketcan:{interface}");
        Self::start(config, (None, port.clone()), String::new(), port)
    }

    fn start(
        config: BenchConfig,
        (st_served, rmd_served): (Option<String>, String),
        st: String,
        rmd: String,
    ) -> Self {
        let (control, theirs) = UnixStream::pair().expect("a socket pair");
        let thread = std::thread::spawn(move || {
            let mut bench = SimServer::new();
            if let Some(port) = st_served {
                bench.serve_st(&port.parse().expect("a port"), &config).expect("served");
            }
            bench.serve_rmd(&rmd_served.parse().expect("a port"), &config).expect("served");
            run(bench, &theirs);
        });
        let mut served = Served { st, rmd, control: Some(control), thread: Some(thread) };
        served.state();
        served
    }

    /// What is really going on in the motors, as JSON.
    pub fn state(&mut self) -> String {
        self.obey("{\"command\":\"state\"}")
    }

    /// Sends a command to the bench and waits until it is obeyed.
    pub fn obey(&mut self, command: &str) -> String {
        let control = self.control.as_mut().expect("the bench is there");
        writeln!(control, "{command}").expect("the bench listens");
        let mut answer = String::new();
        BufReader::new(control).read_line(&mut answer).expect("the bench answers");
        assert!(answer.contains("\"ok\":true"), "{answer}");
        answer
    }
}

fn run(mut bench: SimServer, control: &UnixStream) {
    let mut lines = BufReader::new(control).lines();
    loop {
        let turn = bench.turn(Duration::from_millis(10), Some(control.as_fd())).expect("a turn");
        if !turn.extra_is_ready {
            continue;
        }
        let Some(Ok(line)) = lines.next() else { return };
        let answer = bench.obey(&line);
        writeln!(&*control, "{answer}").expect("the test reads");
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        self.control = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}
