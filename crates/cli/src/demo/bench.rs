//! The simulated drives of the demo: `motorlink sim` in a thread, on ptys in a folder of its own.

use std::io::{BufRead, BufReader, Write};
use std::net::Shutdown;
use std::os::unix::net::UnixStream;
use std::slice::from_ref;
use std::sync::Mutex;
use std::thread::JoinHandle;

use motorlink_testbench::{BenchConfig, SimServer};
use serde_json::{Value, json};
use tempfile::TempDir;

use crate::failure::Failure;
use crate::folder;
use crate::nonblocking_writer::NonblockingWriter;
use crate::output::missed;
use crate::sim;

pub struct Drives {
    /// Port of the ST drive.
    pub st: String,
    /// Port of the RMD bus.
    pub rmd: String,
    served: [String; 2],
    control: Mutex<Control>,
    /// Removed at the end, after the links.
    _folder: TempDir,
    thread: Option<JoinHandle<()>>,
}

struct Control {
    commands: UnixStream,
    answers: BufReader<UnixStream>,
}

impl Drives {
    /// Starts the drives. Their ports can be opened when this returns.
    pub fn start() -> Result<Self, Failure> {
        let folder = folder::new()?;
        let (st, can) = (folder.path().join("st0"), folder.path().join("can0"));
        let served = [format!("pty:{}", st.display()), format!("slcan-pty:{}", can.display())];
        let (commands, theirs) = UnixStream::pair()?;
        let ports = served.clone();
        let thread = std::thread::spawn(move || {
            if let Err(failure) = serve(&ports, &theirs) {
                // The thread that reads the announcements reports it.
                let _ = writeln!(&theirs, "{}", json!({ "error": format!("{failure:?}") }));
            }
        });
        let answers = BufReader::new(commands.try_clone()?);
        let mut control = Control { commands, answers };
        for _ in &served {
            control.answer()?;
        }
        Ok(Drives {
            st: st.display().to_string(),
            rmd: format!("slcan:{}", can.display()),
            served,
            control: Mutex::new(control),
            _folder: folder,
            thread: Some(thread),
        })
    }

    /// Triggers a fault of an ST motor with a command of `motorlink sim`.
    pub fn st_fault(&self, motor: u8, fault: &str) -> Result<(), Failure> {
        let command = json!({
            "command": "fault", "port": self.served[0], "motor": motor, "fault": fault,
        });
        let mut control = self.control.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        writeln!(control.commands, "{command}")?;
        control.answer().map(drop)
    }
}

fn serve([st, rmd]: &[String; 2], stream: &UnixStream) -> Result<(), Failure> {
    let mut bench = SimServer::new();
    let out = NonblockingWriter::new(stream.try_clone()?, missed);
    sim::serve(&mut bench, &drives(), from_ref(st), from_ref(rmd), &out)?;
    // A signal must not end the drives before the demo has stopped its motors.
    sim::obey(&mut bench, stream, &out, |end| end)
}

impl Control {
    fn answer(&mut self) -> Result<Value, Failure> {
        let mut line = String::new();
        self.answers.read_line(&mut line)?;
        let answer: Value = serde_json::from_str(&line).unwrap_or(Value::Null);
        match answer.get("error") {
            None if !answer.is_null() => Ok(answer),
            error => Err(Failure::link(format!(
                "the simulated drives did not start, or refused a command: {}",
                error.unwrap_or(&Value::Null)
            ))),
        }
    }
}

impl Drop for Drives {
    fn drop(&mut self) {
        let control = self.control.get_mut().unwrap_or_else(|poisoned| poisoned.into_inner());
        // The thread ends when its input ends, and removes its links.
        let _ = control.commands.shutdown(Shutdown::Write);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// The default drives. RMD motors have viscous friction: without it they are too fast to watch.
fn drives() -> BenchConfig {
    let motor = |id| format!("[[rmd.motor]]\nid = {id}\nplant.load.viscous = 1.5e-3\n");
    let text: String = (1..=4).map(motor).collect();
    BenchConfig::parse(&text).expect("the configuration of the demo is valid")
}
