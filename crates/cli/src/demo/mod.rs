//! `motorlink demo`: simulated drives of both kinds, driven through real ports.

mod bench;
mod line;
mod picture;
mod screen;
mod story;
mod table;

use std::path::PathBuf;
use std::time::Duration;

use motorlink::{rmd, st};

use bench::Drives;
use screen::Screen;
use story::Story;

use crate::failure::Failure;
use crate::interrupt::{self, interrupted};
use crate::output::note;
use crate::outputs;

/// Title of the picture, for screen readers.
const TITLE: &str =
    "motorlink demo: a table of two ST and four RMD motors; ST motor 1 has a fault, over-current";

#[derive(clap::Args)]
pub struct Args {
    /// Print plain lines even on a terminal (also with TERM=dumb or NO_COLOR)
    #[arg(long)]
    plain: bool,
    /// Draw the screen during the fault into this file; `make pictures` does
    #[arg(long, value_name = "FILE.svg", hide = true)]
    picture: Option<PathBuf>,
}

pub fn run(args: Args) -> Result<(), Failure> {
    interrupt::take_over();
    let drives = Drives::start()?;
    // On a busy machine the simulator may answer later than a drive would.
    let timeout = Duration::from_secs(3);
    let patient = st::Options { timeout, ..st::Options::default() };
    let st = st::Client::open(&drives.st.parse()?, patient)?;
    let patient = rmd::Options { timeout, ..rmd::Options::default() };
    let bus = rmd::Client::open(&drives.rmd.parse()?, patient)?;
    // These stop the motors however the demo ends.
    let _st_guard = st.stop_on_drop().reporting(|stopped| match &stopped.result {
        Ok(()) => note(format!("ST {} acknowledged its stop", stopped.motor)),
        Err(error) => note(format!("ST {} may still turn: {error}", stopped.motor)),
    });
    let _rmd_guard = bus.stop_on_drop().reporting(|stopped| match &stopped.result {
        Ok(()) => note(format!("RMD motor {} acknowledged its stop", stopped.id)),
        Err(error) => note(format!("RMD motor {} may still turn: {error}", stopped.id)),
    });
    let picture = outputs::resolve(&[("--picture", args.picture.as_deref())], &[])?;
    // A picture has 80 columns, as plain lines have.
    let mut screen = Screen::new(args.plain || args.picture.is_some());
    screen.title(&[
        "Two ST motors and four RMD motors, all simulated, on two ports of this machine:",
        &format!("  {}  a serial line: the ST drive", drives.st),
        &format!("  {}  a CAN adapter: the RMD motors", drives.rmd),
        "The demo holds both ports until it ends. `motorlink sim` gives you your own.",
    ]);
    let mut story = Story::new(&drives, &st, &bus, &mut screen);
    let told = story.tell();
    let summary = story.summary();
    let drawn = story.into_picture();
    screen.end();
    if let (Some(Some(file)), Some(lines)) = (picture.first(), drawn) {
        let svg = picture::draw(TITLE, &lines);
        file.write(|out| out.write_all(svg.as_bytes()))?;
    }
    match told {
        Err(Failure::Interrupted) => Err(Failure::Interrupted),
        Err(_) if interrupted() => Err(Failure::Interrupted),
        Err(failure) => Err(failure),
        Ok(()) => summary.print(),
    }
}
