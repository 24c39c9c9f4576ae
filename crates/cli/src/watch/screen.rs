//! The terminal: raw, on its alternate screen, and as it was before whatever happens.

use std::io::{IsTerminal, stdin, stdout};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use ratatui::backend::CrosstermBackend;
use ratatui::crossterm::execute;
use ratatui::crossterm::terminal::{Clear, ClearType, EnterAlternateScreen, enable_raw_mode};
use ratatui::{DefaultTerminal, Terminal};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;
use signal_hook::consts::{SIGCONT, SIGHUP, SIGTSTP};

use crate::failure::Failure;

/// Time for the end of the view, and for stops that are under way.
const END: Duration = Duration::from_secs(10);

/// A terminal that is restored when this is dropped. A panic restores it, too.
pub struct Screen {
    pub terminal: DefaultTerminal,
    /// SIGTSTP came.
    suspend: Arc<AtomicBool>,
    /// SIGCONT came.
    go_on: Arc<AtomicBool>,
}

/// Refuses a terminal that cannot show a view.
pub fn require_terminal() -> Result<(), Failure> {
    let is_dumb = std::env::var_os("TERM").is_none_or(|term| term.is_empty() || term == "dumb");
    let why = match stdin().is_terminal() && stdout().is_terminal() {
        true if is_dumb => "TERM names a terminal that cannot place text",
        true => return Ok(()),
        false => "stdin or stdout is none",
    };
    Err(Failure::usage(format!("watch needs a terminal, and {why}")).trying(
        "for values as lines use --every: `motorlink st get SPEED_MEAS --every 100ms` or `motorlink \
         rmd status --every 100ms`",
    ))
}

impl Screen {
    pub fn enter() -> Result<Self, Failure> {
        let flag = |signal| {
            let flag = Arc::new(AtomicBool::new(false));
            signal_hook::flag::register(signal, Arc::clone(&flag)).map(|_| flag)
        };
        let (suspend, go_on) = (flag(SIGTSTP)?, flag(SIGCONT)?);
        std::thread::Builder::new().name("terminal".to_owned()).spawn(end_without_terminal)?;
        let terminal = ratatui::try_init().inspect_err(|_| restore())?;
        Ok(Screen { terminal, suspend, go_on })
    }

    /// Suspends the process if SIGTSTP came, and takes the terminal again after SIGCONT. Returns
    /// whether all has to be drawn.
    pub fn obey(&mut self) -> Result<bool, Failure> {
        if self.suspend.swap(false, Ordering::SeqCst) {
            self.suspend()?;
            return Ok(true);
        }
        // SIGSTOP cannot be handled: after it, a shell may have changed the terminal.
        let goes_on = self.go_on.swap(false, Ordering::SeqCst);
        if goes_on {
            self.take_again()?;
        }
        Ok(goes_on)
    }

    /// Gives the terminal back and stops the process, until SIGCONT.
    pub fn suspend(&mut self) -> Result<(), Failure> {
        restore();
        signal_hook::low_level::emulate_default_handler(SIGTSTP)?;
        self.go_on.store(false, Ordering::SeqCst);
        self.take_again()
    }

    fn take_again(&mut self) -> Result<(), Failure> {
        enable_raw_mode()?;
        execute!(stdout(), EnterAlternateScreen, Clear(ClearType::All))?;
        // Its picture of the screen is empty, so all is drawn again.
        self.terminal = Terminal::new(CrosstermBackend::new(stdout()))?;
        Ok(())
    }

    /// Waits for a key, or for this time. Ends with the terminal.
    pub fn wait(&self, time: Duration) -> Result<Wait, Failure> {
        let stdin = stdin();
        let mut fds = [PollFd::new(&stdin, PollFlags::IN)];
        let timeout = Timespec::try_from(time).ok();
        match poll(&mut fds, timeout.as_ref()) {
            Ok(0) | Err(Errno::INTR) => return Ok(Wait::Nothing),
            Ok(_) => {}
            Err(error) => return Err(std::io::Error::from(error).into()),
        }
        // Crossterm would read the end of a terminal again and again.
        let is_gone =
            fds[0].revents().intersects(PollFlags::HUP | PollFlags::ERR | PollFlags::NVAL);
        Ok(if is_gone { Wait::Gone } else { Wait::Keys })
    }
}

/// Ends the process some time after its terminal is gone. The view ends by itself, except if the
/// terminal goes while crossterm looks for keys: it reads the end of the terminal for ever.
fn end_without_terminal() {
    let stdin = stdin();
    let mut fds = [PollFd::new(&stdin, PollFlags::empty())];
    // Without a wanted event this waits for the end of the terminal only.
    while poll(&mut fds, None) == Err(Errno::INTR) {}
    std::thread::sleep(END);
    std::process::exit(128 + SIGHUP);
}

/// How a wait for keys ended.
pub enum Wait {
    Nothing,
    Keys,
    /// The terminal is gone, as when its window was closed.
    Gone,
}

impl Drop for Screen {
    fn drop(&mut self) {
        restore();
    }
}

/// A terminal that is gone needs no restoring.
fn restore() {
    let _ = ratatui::try_restore();
}
