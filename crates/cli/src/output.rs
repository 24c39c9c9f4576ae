//! Output: aligned rows for people, or one JSON object per line for programs.

use std::io::{IsTerminal, Write, stderr, stdout};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, OnceLock, PoisonError};
use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};
use motorlink::Hex;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;
use serde_json::{Value, json};

use crate::failure::Failure;
use crate::json::{Cell, Line, Row};
use crate::nonblocking_writer::NonblockingWriter;
use crate::terminal::safe;

/// stdout, if the program must not wait for its reader.
static RESULTS: OnceLock<NonblockingWriter> = OnceLock::new();

/// stderr, if the program must not wait for its reader.
static MESSAGES: OnceLock<NonblockingWriter> = OnceLock::new();

/// Whether an error of stdout is kept until the end.
static KEEPS_ERROR: AtomicBool = AtomicBool::new(false);

/// The first error of stdout that was kept.
static KEPT_ERROR: Mutex<Option<Failure>> = Mutex::new(None);

/// Whether stderr has JSON, too.
static JSON: AtomicBool = AtomicBool::new(false);

/// Whether a view has the terminal.
static HAS_VIEW: AtomicBool = AtomicBool::new(false);

/// Where results go.
#[derive(Debug, Clone, Copy)]
pub struct Printer {
    /// One JSON object a line instead of text.
    pub json: bool,
}

impl Printer {
    /// Prints one result: `text` for people, or `object` as a line of JSON.
    pub fn result(
        self,
        text: impl std::fmt::Display,
        object: impl Into<Value>,
    ) -> Result<(), Failure> {
        if self.json { print_line(&object.into()) } else { print_line(&text) }
    }

    /// Prints values: a row each, or `object` with all of them.
    pub fn rows(self, object: Line, rows: &[Row]) -> Result<(), Failure> {
        if self.json {
            return print_line(&Value::from(object.values(rows)));
        }
        self.texts(rows.iter().map(|row| (&*row.name, &*row.text)))
    }

    /// Prints the values that could be read as [`rows`](Self::rows), and reports the others.
    pub fn cells(self, object: Line, cells: Vec<Cell>) -> Result<(), Failure> {
        let has_values = cells.iter().any(|cell| cell.row().is_some());
        if self.json && has_values {
            print_line(&Value::from(object.cells(&cells)))?;
        } else if has_values {
            let rows = cells.iter().filter_map(Cell::row);
            self.texts(rows.map(|row| (&*row.name, &*row.text)))?;
        }
        self.report_all(cells.into_iter().filter_map(|cell| cell.read.err()).collect())
    }

    /// Reports the failures of several values or motors. One of them is left to be returned. In JSON
    /// each is in the results.
    pub fn report_all(self, mut failures: Vec<Failure>) -> Result<(), Failure> {
        while !self.json && failures.len() > 1 {
            report(&failures.remove(0));
        }
        failures.into_iter().next().map_or(Ok(()), Err)
    }

    fn texts<'a>(
        self,
        rows: impl Iterator<Item = (&'a str, &'a str)> + Clone,
    ) -> Result<(), Failure> {
        let width = rows.clone().map(|(name, _)| name.chars().count()).max().unwrap_or(0);
        for (name, text) in rows {
            print_line(&format!("{:<width$}  {text}", in_words(name)))?;
        }
        Ok(())
    }
}

/// A value's name for people. Registers keep the document's names.
pub fn in_words(name: &str) -> String {
    if name.starts_with(char::is_uppercase) { name.to_owned() } else { name.replace('_', " ") }
}

/// The option --json of commands whose stdout always has JSON. It is read before the command line is
/// parsed: [`put_messages_in_json`].
pub fn json_messages() -> clap::Arg {
    clap::Arg::new("json")
        .long("json")
        .action(clap::ArgAction::SetTrue)
        .help("Print errors and notes as JSON, too; stdout always has JSON")
}

/// From now on stderr has JSON, an object a line, or text.
pub fn put_messages_in_json(json: bool) {
    JSON.store(json, Ordering::Relaxed);
}

/// Whether stderr has JSON.
pub fn has_json_messages() -> bool {
    JSON.load(Ordering::Relaxed)
}

/// From now on printing does not block, because motors or drives depend on this program. On stdout
/// `missed` is the line in place of dropped lines. Returns stdout.
pub fn never_wait(missed: fn(u64) -> String) -> &'static NonblockingWriter {
    never_wait_for_messages();
    RESULTS.get_or_init(|| NonblockingWriter::new(stdout(), missed))
}

/// Whether a line can be printed without waiting for the reader of stdout, now or after this time.
pub fn is_read(within: Duration) -> bool {
    if RESULTS.get().is_some() {
        return true;
    }
    let out = stdout();
    let mut fds = [PollFd::new(&out, PollFlags::OUT)];
    // After another error the next line says why.
    !matches!(poll(&mut fds, Timespec::try_from(within).ok().as_ref()), Ok(0) | Err(Errno::INTR))
}

/// As [`never_wait`], for stderr only.
pub fn never_wait_for_messages() {
    MESSAGES.get_or_init(|| NonblockingWriter::new(stderr(), missed_text));
}

/// From now on an error of stdout does not end a command: it may have motors left to stop.
pub fn keep_error() {
    KEEPS_ERROR.store(true, Ordering::Relaxed);
}

/// The error of stdout that was kept, after a command that was carried out.
pub fn kept_error() -> Result<(), Failure> {
    let kept = KEPT_ERROR.lock().unwrap_or_else(PoisonError::into_inner).take();
    kept.map_or(Ok(()), |failure| Err(failure.then("the command was carried out")))
}

/// The JSON line in place of `lines` dropped lines.
pub fn missed(lines: u64) -> String {
    json!({ "event": "dropped", "lines": lines }).to_string()
}

/// The same as text.
pub fn missed_text(lines: u64) -> String {
    format!("{lines} lines were dropped here, because they were not read in time")
}

/// Waits a moment until all output is written, after [`never_wait`].
pub fn finish() {
    for writer in [&MESSAGES, &RESULTS].into_iter().filter_map(OnceLock::get) {
        writer.finish();
    }
}

/// Prints a note on stderr.
pub fn note(text: impl std::fmt::Display) {
    if has_json_messages() {
        return print_message(&json!({ "note": console::strip_ansi_codes(&text.to_string()) }));
    }
    print_message(&text);
}

/// Prints a line on stderr as it is.
pub fn print_message(text: &dyn std::fmt::Display) {
    match MESSAGES.get() {
        Some(messages) => messages.say(text),
        None => drop(writeln!(stderr(), "{}", safe(&text.to_string()))),
    }
}

/// Prints a line of the log on stderr: it takes no place of a message, and none on a view of a terminal.
pub fn log(text: &dyn std::fmt::Display) {
    let is_on_view = HAS_VIEW.load(Ordering::Relaxed) && stderr().is_terminal();
    if let Some(messages) = MESSAGES.get().filter(|_| !is_on_view) {
        messages.say_beside(text);
    }
}

/// Whether a view has the terminal.
pub fn show_view(is_shown: bool) {
    HAS_VIEW.store(is_shown, Ordering::Relaxed);
}

/// Prints a failure on stderr; returns the exit code.
pub fn report(failure: &Failure) -> u8 {
    let code = failure.exit_code();
    match failure {
        Failure::Failed(problem) if has_json_messages() => {
            print_message(&json!({ "ok": false, "error": problem.object(), "exit": code }));
        }
        Failure::Failed(problem) => {
            let mark = console::style("error:").red().bold().for_stderr();
            print_message(&format!("{mark} {}", problem.text()));
        }
        Failure::Interrupted | Failure::OutputClosed => {}
    }
    code
}

/// Prints a line at once. If the reader has closed stdout, the program ends without a message.
pub fn print_line(text: &dyn std::fmt::Display) -> Result<(), Failure> {
    if let Some(results) = RESULTS.get() {
        results.say(text);
        return Ok(());
    }
    let mut out = stdout().lock();
    let text = text.to_string();
    let printed = writeln!(out, "{}", safe(&text)).and_then(|()| out.flush());
    let failure = match printed {
        Ok(()) => return Ok(()),
        Err(error) => Failure::output(&error),
    };
    if !KEEPS_ERROR.load(Ordering::Relaxed) {
        return Err(failure);
    }
    KEPT_ERROR.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(failure);
    Ok(())
}

/// A progress bar on stderr for a scan of `steps` steps, if stderr is a terminal.
pub fn progress(steps: usize) -> ProgressBar {
    let bar = ProgressBar::new(steps as u64);
    let style = ProgressStyle::with_template("{spinner} {bar:24} {pos}/{len} {msg}");
    bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    bar
}

/// Bytes as people write them: `02 01 1e 21`.
pub fn hex(bytes: &[u8]) -> String {
    Hex(bytes).to_string()
}

/// Reads bytes as people write them, with or without spaces, colons and `0x`.
pub fn parse_hex(words: &[String]) -> Result<Vec<u8>, Failure> {
    let joined = words.join(" ").replace("0x", " ").replace([':', ',', '-'], " ");
    let mut bytes = Vec::new();
    for word in joined.split_whitespace() {
        let word = if word.len() == 1 { format!("0{word}") } else { word.to_owned() };
        let digits: Option<Vec<u8>> =
            word.chars().map(|c| c.to_digit(16).map(|digit| digit as u8)).collect();
        match digits {
            Some(digits) if digits.len() % 2 == 0 => {
                bytes.extend(digits.chunks(2).map(|pair| pair[0] << 4 | pair[1]));
            }
            _ => {
                return Err(Failure::usage(format!(
                    "`{word}` is not hexadecimal bytes; write them as `02 01 1e` or `02011e`"
                )));
            }
        }
    }
    if bytes.is_empty() {
        return Err(Failure::usage("give the bytes, as in `02 01 1e`"));
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bytes(text: &str) -> Option<Vec<u8>> {
        parse_hex(&[text.to_owned()]).ok()
    }

    #[test]
    fn hexadecimal_is_read_as_people_write_it() {
        let expected = Some(vec![0x02, 0x01, 0x1E, 0x21]);
        assert_eq!(bytes("02 01 1e 21"), expected);
        assert_eq!(bytes("02011E21"), expected);
        assert_eq!(bytes("0x02 0x01 0x1e 0x21"), expected);
        assert_eq!(bytes("2 1 1e:21"), expected);
        assert_eq!(bytes("021"), None);
        assert_eq!(bytes("xy"), None);
    }
}
