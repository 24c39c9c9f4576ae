//! `motorlink demo`: simulated drives of both kinds, driven through real ports.

mod bench;
mod screen;
mod story;
mod table;

use std::time::Duration;

use motorlink::{rmd, st};

use bench::Drives;
use screen::Screen;
use story::Story;

use crate::failure::Failure;
use crate::interrupt::{self, interrupted};
use crate::output::note;

#[derive(clap::Args)]
pub struct Args {
    /// Print plain lines even on a terminal (also with TERM=dumb or NO_COLOR)
    #[arg(long)]
    plain: bool,
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
    let mut screen = Screen::new(args.plain);
    screen.title(&[
        "Two ST motors and four RMD motors, all simulated, on two ports of this machine:",
        &format!("  {}  a serial line: the ST drive", drives.st),
        &format!("  {}  a CAN adapter: the RMD motors", drives.rmd),
        "The demo holds both ports until it ends. `motorlink sim` gives you your own.",
    ]);
    let mut story = Story::new(&drives, &st, &bus, &mut screen);
    let told = story.tell();
    let summary = story.summary();
    screen.end();
    match told {
        Err(Failure::Interrupted) => Err(Failure::Interrupted),
        Err(_) if interrupted() => Err(Failure::Interrupted),
        Err(failure) => Err(failure),
        Ok(()) => summary.print(),
    }
}
