//! `motorlink demo`: simulated drives of both kinds, driven through real ports.

mod bench;
mod screen;
mod story;

use motorlink::{rmd, st};

use bench::Drives;
use screen::Screen;
use story::Story;

use crate::failure::Failure;
use crate::interrupt::{self, interrupted};
use crate::output::note;

#[derive(clap::Args)]
pub struct Args {
    /// Print plain lines even on a terminal
    #[arg(long)]
    plain: bool,
}

pub fn run(args: Args) -> Result<(), Failure> {
    interrupt::take_over();
    let drives = Drives::start()?;
    let st = st::Client::open(&drives.st.parse()?, st::Options::default())?;
    let bus = rmd::Client::open(
        &drives.rmd.parse()?,
        rmd::Options {
            // A loaded machine may hold the simulator up for longer than a motor would take.
            timeout: std::time::Duration::from_millis(500),
            ..rmd::Options::default()
        },
    )?;
    // Whatever happens below, these stop the motors.
    let _st_guard = st.stop_on_drop().reporting(|stopped| match &stopped.result {
        Ok(()) => note(format!("ST {} is stopped", stopped.motor)),
        Err(error) => note(format!("ST {} may still turn: {error}", stopped.motor)),
    });
    let _rmd_guard = bus.stop_on_drop().reporting(|stopped| match &stopped.result {
        Ok(()) => note(format!("RMD motor {} is off", stopped.id)),
        Err(error) => note(format!("RMD motor {} may still turn: {error}", stopped.id)),
    });
    let mut screen = Screen::new(args.plain);
    screen.title(&[
        "Two ST motors on a serial line and four RMD motors on a CAN bus, all simulated.",
        "This program talks to them as to real drives, through these ports:",
        &format!("  {}", drives.st),
        &format!("  {}", drives.rmd),
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
