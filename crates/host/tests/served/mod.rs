//! Simulated drives behind ptys, served by a thread of the test.
#![allow(dead_code)]

use std::io::{BufRead, BufReader, Write};
use std::os::fd::AsFd;
use std::os::unix::net::UnixStream;
use std::path::PathBuf;
use std::thread::JoinHandle;
use std::time::Duration;

use motorlink::sim::{Bench, BenchConfig};

/// Drives on ptys; gone when it is dropped.
pub struct Served {
    /// Port of the ST drive.
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
        let (st, can) = (path("st"), path("can"));
        let (control, theirs) = UnixStream::pair().expect("a socket pair");
        let ports = [format!("pty:{}", st.display()), format!("slcan-pty:{}", can.display())];
        let thread = std::thread::spawn(move || serve(&ports, &theirs));
        let mut served = Served {
            st: st.display().to_string(),
            rmd: format!("slcan:{}", can.display()),
            control: Some(control),
            thread: Some(thread),
        };
        served.obey("{\"command\":\"state\"}");
        served
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

fn serve([st, rmd]: &[String; 2], control: &UnixStream) {
    let config = BenchConfig::default();
    let mut bench = Bench::new();
    bench.serve_st(&st.parse().expect("a port"), &config).expect("served");
    bench.serve_rmd(&rmd.parse().expect("a port"), &config).expect("served");
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
