//! Where the frames come from: arguments, a file, stdin.

use std::fs::File;
use std::io::{Cursor, IsTerminal, Read, stdin};
use std::path::Path;

use motorlink_capture::{Format, Plain};

use crate::failure::Failure;
use crate::output::note;
use crate::terminal::safe;

pub struct Input {
    pub content: Box<dyn Read>,
    pub format: Option<Format>,
    /// Whether it is a regular file, which is never waited for.
    pub is_file: bool,
    /// Whether it is from the command line.
    pub is_hex: bool,
    /// For messages.
    pub name: String,
}

/// Opens what the words of the command line name.
pub fn open(words: &[String], format: Option<Format>, plain: Plain) -> Result<Input, Failure> {
    match words {
        [] => Ok(standard(format)),
        [word] if word == "-" => Ok(standard(format)),
        [path] if Path::new(path).exists() || !is_hex(path) => file(path, format),
        words => {
            if let Some(word) = words.iter().find(|word| !is_hex(word)) {
                let word = safe(word);
                return Err(Failure::usage(format!("`{word}` is not hexadecimal"))
                    .trying("give one file, or frames in hexadecimal"));
            }
            // Frames of a bus, of which each is a word, or the bytes of one.
            let is_frames = matches!(plain, Plain::Can(_)) && words[0].contains('#');
            let text = words.join(if is_frames { "\n" } else { " " });
            let content: Box<dyn Read> = Box::new(Cursor::new(text.into_bytes()));
            let name = "the command line".to_owned();
            Ok(Input { content, format: Some(Format::Hex), is_file: true, is_hex: true, name })
        }
    }
}

fn standard(format: Option<Format>) -> Input {
    if stdin().is_terminal() {
        note("reads frames from the terminal; Ctrl-D ends the input");
    }
    let is_file = File::from(rustix::io::dup(stdin()).expect("stdin is open"))
        .metadata()
        .is_ok_and(|found| found.is_file());
    Input { content: Box::new(stdin()), format, is_file, is_hex: false, name: "stdin".to_owned() }
}

fn file(path: &str, format: Option<Format>) -> Result<Input, Failure> {
    let name = format!("`{}`", safe(path));
    let failed = |error| Failure::usage(format!("cannot read {name}: {error}"));
    let file = File::open(path).map_err(failed)?;
    let is_file = file.metadata().map_err(failed)?.is_file();
    Ok(Input { content: Box::new(file), format, is_file, is_hex: false, name })
}

/// Whether a word may be hexadecimal bytes, or a CAN frame.
fn is_hex(word: &str) -> bool {
    let is_digit = |c: char| c.is_ascii_hexdigit() || " #xXRr:,-._".contains(c);
    !word.is_empty() && word.chars().all(is_digit) && word.contains(|c: char| c.is_ascii_hexdigit())
}
