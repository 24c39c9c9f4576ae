//! Files that results are written to: none is an input or another output, and none is destroyed by a
//! command that fails.

use std::fs::{self, File, Metadata, OpenOptions};
use std::io::{self, BufWriter, Error, ErrorKind, Write, stdout};
use std::os::fd::AsFd;
use std::os::unix::fs::{FileTypeExt, MetadataExt, OpenOptionsExt, PermissionsExt};
use std::path::{Path, PathBuf};

use motorlink_link::printable;

use crate::failure::Failure;
use crate::interrupt::{self, interrupted};

/// The name of stdout.
const STDOUT: &str = "-";
/// As many symbolic links as Linux follows.
const MOST_LINKS: usize = 40;

/// Where one output goes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Output {
    Stdout,
    /// A regular file, which is replaced as a whole, or a name that is free.
    File(OutputPath),
    /// A device, a FIFO: it is written as it is.
    Stream(OutputPath),
}

/// A file by its name on the command line, and by the name behind all symbolic links.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OutputPath {
    named: PathBuf,
    real: PathBuf,
}

/// Looks up where outputs go, each with its option. `inputs` are the files that were read.
///
/// # Errors
/// Two outputs are the same file, or one is an input; a folder does not exist.
pub fn resolve(
    outputs: &[(&str, Option<&Path>)],
    inputs: &[&Path],
) -> Result<Vec<Option<Output>>, Failure> {
    let mut used: Vec<(String, Identity)> = Vec::new();
    for input in inputs {
        let words = format!("`{}`, which is read", input.display());
        used.extend(Identity::of(input).map(|identity| (words, identity)));
    }
    if let Ok(out) = stdout().as_fd().try_clone_to_owned()
        && let Some(identity) = File::from(out).metadata().ok().and_then(Identity::unique)
    {
        used.push(("stdout: write `-` instead of the name".to_owned(), identity));
    }
    let mut found = Vec::new();
    for (option, path) in outputs {
        let Some(path) = path else {
            found.push(None);
            continue;
        };
        if *path == Path::new(STDOUT) {
            if found.contains(&Some(Output::Stdout)) {
                return Err(Failure::usage("only one output can go to stdout"));
            }
            found.push(Some(Output::Stdout));
            continue;
        }
        let place = OutputPath::find(path).map_err(|error| Failure::file(path, &error))?;
        let identity = place.identity();
        let same = used.iter().find(|(_, other)| identity.as_ref() == Some(other));
        if let Some((words, _)) = same {
            let why = format!("{option} `{}` is the same file as {words}", path.display());
            return Err(Failure::usage(why));
        }
        used.extend(identity.map(|identity| (format!("{option} `{}`", path.display()), identity)));
        found.push(Some(place.output()));
    }
    Ok(found)
}

/// Where the only output of a command goes, given with `option`. `inputs` are the files that were read;
/// `replace` is the option that allows to replace a file, and whether it was given.
///
/// # Errors
/// The folder does not exist, or the file exists, or it is an input.
pub fn one(
    option: &str,
    path: &Path,
    inputs: &[&Path],
    replace: (&str, bool),
) -> Result<Output, Failure> {
    let found = resolve(&[(option, Some(path))], inputs)?;
    let output = found.into_iter().flatten().next().expect("an output was given");
    match (&output, replace) {
        (Output::File(place), (option, false)) if place.real.exists() => {
            let name = printable(&place.named.display().to_string());
            Err(Failure::usage(format!("`{name}` exists; nothing was written"))
                .trying(format!("add {option} to replace it")))
        }
        _ => Ok(output),
    }
}

/// Two names with the same identity are one file.
#[derive(Debug, PartialEq, Eq)]
enum Identity {
    /// Device and number of a file that exists.
    Existing(u64, u64),
    /// The name of one that does not.
    Free(PathBuf),
}

impl Identity {
    fn of(path: &Path) -> Option<Self> {
        fs::metadata(path).ok().and_then(Self::unique)
    }

    /// `None` for devices, which several outputs may have: `/dev/null`.
    fn unique(found: Metadata) -> Option<Self> {
        (!found.file_type().is_char_device()).then(|| Identity::Existing(found.dev(), found.ino()))
    }
}

impl OutputPath {
    fn find(path: &Path) -> io::Result<Self> {
        let mut real = path.to_owned();
        // A stream behind a link of /proc/self/fd has no other name.
        if fs::metadata(path).is_ok_and(|found| !found.is_file()) {
            return Ok(OutputPath { named: path.to_owned(), real });
        }
        for _ in 0..MOST_LINKS {
            let folder = match real.parent() {
                Some(folder) if folder != Path::new("") => folder.canonicalize()?,
                _ => Path::new(".").canonicalize()?,
            };
            let name = real.file_name().ok_or(ErrorKind::IsADirectory)?;
            let place = folder.join(name);
            match fs::read_link(&place) {
                Ok(target) => real = folder.join(target),
                Err(_) => return Ok(OutputPath { named: path.to_owned(), real: place }),
            }
        }
        Err(Error::other("too many symbolic links"))
    }

    fn identity(&self) -> Option<Identity> {
        match fs::metadata(&self.real) {
            Ok(found) => Identity::unique(found),
            Err(_) => Some(Identity::Free(self.real.clone())),
        }
    }

    fn output(self) -> Output {
        match fs::metadata(&self.real) {
            Ok(found) if !found.is_file() => Output::Stream(self),
            _ => Output::File(self),
        }
    }
}

impl Output {
    /// Writes a content. A regular file is replaced when the content is complete, and is not changed
    /// before.
    pub fn write(
        &self,
        content: impl FnOnce(&mut dyn Write) -> io::Result<()>,
    ) -> Result<(), Failure> {
        match self {
            Output::Stdout => {
                fill(stdout().lock(), content).map(drop).map_err(|error| Failure::output(&error))
            }
            Output::Stream(place) => {
                let stream = OpenOptions::new().write(true).open(&place.real);
                let written = stream.and_then(|stream| fill(stream, content).map(drop));
                written.map_err(|error| Failure::file(&place.named, &error))
            }
            Output::File(place) => {
                // The temporary file does not stay after Ctrl-C.
                interrupt::take_over();
                let written = replace(&place.real, content);
                written.map_err(|error| match interrupted() {
                    true => Failure::Interrupted,
                    false => Failure::file(&place.named, &error),
                })
            }
        }
    }
}

/// Writes a content to its end.
fn fill<W: Write>(out: W, content: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> io::Result<W> {
    let mut out = BufWriter::new(out);
    content(&mut out)?;
    out.flush()?;
    out.into_inner().map_err(io::IntoInnerError::into_error)
}

/// Replaces a file by a content, or leaves it as it was.
fn replace(path: &Path, content: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> io::Result<()> {
    let old = fs::metadata(path).ok();
    if old.is_some() {
        // A file that may not be written is not replaced, either.
        OpenOptions::new().write(true).open(path)?;
    }
    let mut name = std::ffi::OsString::from(".");
    name.push(path.file_name().unwrap_or_default());
    name.push(format!(".{}.new", std::process::id()));
    let new = path.with_file_name(name);
    let mut create = OpenOptions::new();
    create.write(true).create_new(true);
    if let Some(old) = &old {
        create.mode(old.permissions().mode());
    }
    let file = create.open(&new)?;
    let written = fill(Interruptible(file), content).and_then(|Interruptible(file)| {
        if let Some(old) = old {
            file.set_permissions(old.permissions())?;
        }
        file.sync_all()?;
        fs::rename(&new, path)
    });
    if written.is_err() {
        // The first error is the one to report.
        let _ = fs::remove_file(&new);
    }
    written
}

/// A file that is given up when the program is interrupted.
struct Interruptible(File);

impl Write for Interruptible {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if interrupted() {
            return Err(Error::other("interrupted"));
        }
        self.0.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.0.flush()
    }
}
