//! `motorlink decode` and `cantools decode` on the same log, whose content is known.

use std::env::current_exe;
use std::fs::{self, File};
use std::io::{BufRead, BufReader, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

use motorlink_proto::rmd::{Direction, MotorId};

use crate::report::{Goal, Section};
use motorlink_kernels::result::Result;

/// Frames of the log.
const FRAMES: u32 = 1_000_000;
/// Runs of our decoder.
const ROUNDS: usize = 5;
/// How many times as fast as cantools.
const RATIO: f64 = 20.0;
/// The command whose reply repeats the request.
const OFF: &str = "0x80 Motor off command";
/// Motors of the log.
const MOTORS: u8 = 4;
/// The first time of the log, µs since 1970.
const START_US: u64 = 1_436_509_053_000_000;

pub fn measure() -> Result<(Vec<Section>, Vec<Goal>)> {
    let folder = Folder::new()?;
    let (log, truth) = (folder.file("can0.log"), folder.file("truth.txt"));
    let count = write_log(&log, &truth)?;
    let decoded = folder.file("decoded.txt");
    let program = current_exe()?.with_file_name("motorlink");
    if !program.exists() {
        return Err("build the program first: cargo build --profile dist -p motorlink-cli".into());
    }
    let mut times = Vec::new();
    for _ in 0..ROUNDS {
        let mut command = Command::new(&program);
        command.args(["decode", "rmd"]).arg(&log);
        times.push(timed(&mut command, Stdio::null(), &decoded)?);
    }
    times.sort_by(f64::total_cmp);
    let ours = times[ROUNDS / 2];
    let wrong = differences(&truth, &decoded)?;
    let theirs = cantools(&folder, &log)?;
    let rate = |seconds: f64| f64::from(count) / seconds;
    let mut rows = vec![vec![
        "motorlink decode rmd".to_owned(),
        format!("{:.0}", rate(ours)),
        "1.0".to_owned(),
    ]];
    rows.extend(theirs.map(|theirs| {
        vec![
            "cantools decode".to_owned(),
            format!("{:.0}", rate(theirs)),
            format!("{:.1}", theirs / ours),
        ]
    }));
    let section = Section {
        title: "Decoding a log of candump",
        note: format!(
            "\
- {count} frames of {MOTORS} RMD motors: requests and replies without a direction.
- Time from the start of the process to its end, with the output in a file: the median of {ROUNDS}
  runs of `motorlink decode`, and one of cantools.
- Each line of `motorlink decode` is compared with what the generator of the log wrote. Where
  the log does not show a direction, both meanings are right: the first request of each motor, and
  the reply to 0x80.
- cantools decodes with the DBC file of `motorlink spec dbc`, in one line per frame."
        ),
        columns: vec!["program", "frames/s", "ratio to it"],
        rows,
    };
    let goals = vec![
        Goal {
            what: "decoded lines that are wrong".to_owned(),
            wanted: "0".to_owned(),
            reached: Some((wrong.to_string(), wrong == 0)),
        },
        Goal {
            what: "decoding a log: ratio to cantools".to_owned(),
            wanted: format!(">= {RATIO:.0}"),
            reached: theirs.map(|theirs| (format!("{:.1}", theirs / ours), theirs / ours >= RATIO)),
        },
    ];
    Ok((vec![section], goals))
}

/// A folder that is removed at the end.
struct Folder(PathBuf);

impl Folder {
    fn new() -> Result<Self> {
        let path = std::env::temp_dir().join(format!("motorlink-bench-{}", std::process::id()));
        fs::create_dir_all(&path)?;
        Ok(Folder(path))
    }

    fn file(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // What is left is in the folder for temporary files.
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// Runs a program to its end. Returns the seconds.
fn timed(command: &mut Command, stdin: Stdio, out: &Path) -> Result<f64> {
    let began = Instant::now();
    let status = command.stdin(stdin).stdout(File::create(out)?).stderr(Stdio::null()).status()?;
    let seconds = began.elapsed().as_secs_f64();
    if status.success() { Ok(seconds) } else { Err(format!("{command:?}: {status}").into()) }
}

/// The seconds of cantools; `None` if it is not installed.
fn cantools(folder: &Folder, log: &Path) -> Result<Option<f64>> {
    let venv = Path::new(env!("CARGO_MANIFEST_DIR")).join("../.venv-bench");
    let program = venv.join("bin/cantools");
    if !program.exists() {
        eprintln!(
            "WARNING: CANTOOLS IS NOT MEASURED: `make bench` did not get it into .venv-bench"
        );
        return Ok(None);
    }
    let dbc = folder.file("rmd.dbc");
    let motors = (1..=MOTORS).filter_map(MotorId::new).collect();
    fs::write(&dbc, motorlink_spec::dbc::dbc(motors, Direction::DriveToHost))?;
    let decoded = folder.file("cantools.txt");
    let mut command = Command::new(program);
    command.args(["decode", "--single-line", "--no-strict"]).arg(dbc);
    timed(&mut command, File::open(log)?.into(), &decoded).map(Some)
}

/// Writes the log, and what its lines mean. Returns the number of frames.
fn write_log(log: &Path, truth: &Path) -> Result<u32> {
    let (mut log, mut truth) =
        (BufWriter::new(File::create(log)?), BufWriter::new(File::create(truth)?));
    let mut random = Random(1);
    let mut us = START_US;
    let mut last = 0;
    // The first request of a motor is one without values.
    let first = (1..=MOTORS).map(|motor| (motor, Exchange::Angle { centidegrees: 1 }));
    let mut first = first.collect::<Vec<_>>().into_iter();
    for _ in 0..FRAMES / 2 {
        let any = || (1 + random.below(MOTORS.into()) as u8, Exchange::any(&mut random));
        let (motor, exchange) = first.next().unwrap_or_else(any);
        let (request, reply) = exchange.frames(motor);
        for (arrow, (data, meaning)) in [("->", request), ("<-", reply)] {
            us += 100 + u64::from(random.below(300));
            let time = format!("{}.{:06}", us / 1_000_000, us % 1_000_000);
            let frame = format!("{:03X}#{}", 0x140 + u16::from(motor), hex(&data));
            writeln!(log, "({time}) can0 {frame}")?;
            writeln!(truth, "{time} can0 {arrow} {frame} {meaning}")?;
            last += 1;
        }
    }
    log.flush()?;
    truth.flush()?;
    Ok(last)
}

/// The values of one exchange.
enum Exchange {
    Status { temperature: i8, decivolts: u16, low_voltage: bool },
    Motion { speed: Option<i32>, temperature: i8, iq: i16, dps: i16, encoder: u16 },
    Angle { centidegrees: i64 },
    Off,
}

impl Exchange {
    fn any(random: &mut Random) -> Self {
        // Not 0, so that a reply differs from each request.
        let temperature = 1 + random.below(120) as i8;
        match random.below(16) {
            0..=5 => {
                let decivolts = random.below(600) as u16;
                Exchange::Status { temperature, decivolts, low_voltage: random.below(8) == 0 }
            }
            6..=11 => Exchange::Motion {
                speed: (random.below(2) == 0).then(|| random.below(u32::MAX) as i32),
                temperature,
                iq: random.below(65_536) as u16 as i16,
                dps: random.below(65_536) as u16 as i16,
                encoder: random.below(65_536) as u16,
            },
            12..=14 => {
                let turns = i64::from(random.below(1 << 31)) - (1 << 30);
                Exchange::Angle { centidegrees: (turns * 997) | 1 }
            }
            _ => Exchange::Off,
        }
    }

    /// The bytes and the meaning of the request and of the reply.
    fn frames(&self, motor: u8) -> (([u8; 8], String), ([u8; 8], String)) {
        let ask = |code: u8| [code, 0, 0, 0, 0, 0, 0, 0];
        let (request, name, asked, reply, told) = match *self {
            Exchange::Status { temperature, decivolts, low_voltage } => {
                let [v0, v1] = decivolts.to_le_bytes();
                let reply = [0x9A, temperature as u8, 0, v0, v1, 0, 0, low_voltage.into()];
                let errors = if low_voltage { "low voltage protection" } else { "no error" };
                let (whole, tenth) = (decivolts / 10, decivolts % 10);
                let told = format!(
                    ": temperature {temperature} °C, voltage {whole}.{tenth} V, errors {errors}"
                );
                (ask(0x9A), "0x9A Read motor status 1 and error flag commands", None, reply, told)
            }
            Exchange::Motion { speed, temperature, iq, dps, encoder } => {
                let ([i0, i1], [s0, s1]) = (iq.to_le_bytes(), dps.to_le_bytes());
                let [e0, e1] = encoder.to_le_bytes();
                let code = if speed.is_some() { 0xA2 } else { 0x9C };
                let reply = [code, temperature as u8, i0, i1, s0, s1, e0, e1];
                // Thousandths of an ampere, a half to the even one.
                let amps = f64::from(iq) * 33.0 / 2048.0;
                let told = format!(
                    ": temperature {temperature} °C, iq {amps:.3} A, speed {dps} °/s, encoder {encoder}"
                );
                match speed {
                    None => (ask(code), "0x9C Read motor status 2", None, reply, told),
                    Some(speed) => {
                        let [a, b, c, d] = speed.to_le_bytes();
                        let asked = format!(": speed {} °/s", hundredths(speed.into()));
                        let request = [code, 0, 0, 0, a, b, c, d];
                        (request, "0xA2 Speed closed-loop command", Some(asked), reply, told)
                    }
                }
            }
            Exchange::Angle { centidegrees } => {
                let reply = (centidegrees << 8 | 0x92).to_le_bytes();
                let told = format!(": angle {} °", hundredths(centidegrees));
                (ask(0x92), "0x92 Read multi turns angle command", None, reply, told)
            }
            Exchange::Off => (ask(0x80), OFF, None, ask(0x80), String::new()),
        };
        let asked = asked.unwrap_or_default();
        (
            (request, format!("motor {motor} > {name}{asked}")),
            (reply, format!("motor {motor} < {name}{told}")),
        )
    }
}

/// Hundredths as a decimal number.
fn hundredths(number: i64) -> String {
    let sign = if number < 0 { "-" } else { "" };
    let number = number.unsigned_abs();
    format!("{sign}{}.{:02}", number / 100, number % 100)
}

fn hex(data: &[u8]) -> String {
    data.iter().map(|byte| format!("{byte:02X}")).collect()
}

/// How many lines differ from the truth.
fn differences(truth: &Path, decoded: &Path) -> Result<u32> {
    let (mut truth, mut decoded) =
        (BufReader::new(File::open(truth)?).lines(), BufReader::new(File::open(decoded)?).lines());
    let (mut wrong, mut first) = (0, [true; MOTORS as usize + 1]);
    loop {
        let (wanted, found) = match (truth.next(), decoded.next()) {
            (None, None) => return Ok(wrong),
            (wanted, found) => {
                (wanted.transpose()?.unwrap_or_default(), found.transpose()?.unwrap_or_default())
            }
        };
        let (_, meaning) = wanted.split_once(" motor ").ok_or("the truth has no motor")?;
        let motor: usize = meaning.split(' ').next().unwrap_or_default().parse()?;
        let is_first = std::mem::take(&mut first[motor]);
        let is_open = is_first || wanted.contains(OFF);
        if wanted != found && !(is_open && found == of_unknown_direction(&wanted)) {
            if wrong == 0 {
                eprintln!("wanted {wanted}\nfound  {found}");
            }
            wrong += 1;
        }
    }
}

/// A line of a request, or of a reply that repeats it, as it is shown if its direction is not known.
fn of_unknown_direction(line: &str) -> String {
    let (before, meaning) = line.split_once(" motor ").unwrap_or((line, ""));
    let before = before.replacen(" -> ", " -- ", 1).replacen(" <- ", " -- ", 1);
    let meaning = meaning.replacen(" > ", " ? ", 1).replacen(" < ", " ? ", 1);
    let zeros = if meaning.ends_with(OFF) { "" } else { ": request, or reply angle 0.00 °" };
    format!("{before} motor {meaning}{zeros}")
}

/// Numbers that look random (xorshift), the same in each run.
struct Random(u64);

impl Random {
    fn below(&mut self, limit: u32) -> u32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (((self.0 >> 32) * u64::from(limit)) >> 32) as u32
    }
}
