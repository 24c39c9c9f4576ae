//! The terminal: raw mode and the alternate screen, and their restoration.

use std::io::{IsTerminal, stdin, stdout};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use ratatui::backend::CrosstermBackend;
use ratatui::crossterm::event::{self, Event, KeyEvent, KeyEventKind};
use ratatui::crossterm::execute;
use ratatui::crossterm::terminal::{Clear, ClearType, EnterAlternateScreen, enable_raw_mode};
use ratatui::{DefaultTerminal, Terminal};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};
use signal_hook::consts::{SIGCONT, SIGHUP, SIGTSTP};

use crate::failure::Failure;
use crate::output;

/// Time to end the view and the stops in progress.
const END: Duration = Duration::from_secs(10);

/// A terminal that is restored on drop. A panic restores it, too.
pub struct Screen {
    pub terminal: DefaultTerminal,
    /// Whether SIGTSTP was received.
    suspend: Arc<AtomicBool>,
    /// Whether SIGCONT was received.
    go_on: Arc<AtomicBool>,
}

/// Returns an error if stdin or stdout is no terminal, or if it cannot show a view of this command. `tip` is
/// what to do without one.
pub fn require_terminal_of(command: &str, tip: &str) -> Result<(), Failure> {
    let is_dumb = std::env::var_os("TERM").is_none_or(|term| term.is_empty() || term == "dumb");
    let why = match stdin().is_terminal() && stdout().is_terminal() {
        true if is_dumb => "TERM names a terminal that cannot place text",
        true => return Ok(()),
        false => "stdin or stdout is none",
    };
    Err(Failure::usage(format!("{command} needs a terminal, and {why}")).trying(tip.to_owned()))
}

impl Screen {
    pub fn enter() -> Result<Self, Failure> {
        let flag = |signal| {
            let flag = Arc::new(AtomicBool::new(false));
            signal_hook::flag::register(signal, Arc::clone(&flag)).map(|_| flag)
        };
        let (suspend, go_on) = (flag(SIGTSTP)?, flag(SIGCONT)?);
        std::thread::Builder::new().name("terminal".to_owned()).spawn(end_without_terminal)?;
        output::show_view(true);
        let terminal = ratatui::try_init().inspect_err(|_| restore())?;
        Ok(Screen { terminal, suspend, go_on })
    }

    /// Suspends the process after SIGTSTP. Sets up the terminal again after SIGCONT. Returns whether
    /// the screen is empty now.
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

    /// Restores the terminal and stops the process until SIGCONT.
    pub fn suspend(&mut self) -> Result<(), Failure> {
        restore();
        signal_hook::low_level::emulate_default_handler(SIGTSTP)?;
        self.go_on.store(false, Ordering::SeqCst);
        self.take_again()
    }

    fn take_again(&mut self) -> Result<(), Failure> {
        enable_raw_mode()?;
        execute!(stdout(), EnterAlternateScreen)?;
        self.clear()
    }

    /// Clears the terminal. The next drawing is complete.
    fn clear(&mut self) -> Result<(), Failure> {
        execute!(stdout(), Clear(ClearType::All))?;
        // `Terminal::clear` would ask for the position of the cursor. Some terminals do not reply.
        self.terminal = Terminal::new(CrosstermBackend::new(stdout()))?;
        Ok(())
    }

    /// Waits for input, at most this time. Gives each key to `press`, which returns whether the view goes
    /// on. Returns whether there is something new to draw; `None` at the end of the view or of the
    /// terminal.
    pub fn input(
        &mut self,
        time: Duration,
        mut press: impl FnMut(&mut Self, KeyEvent) -> Result<bool, Failure>,
    ) -> Result<Option<bool>, Failure> {
        let Some(is_readable) = self.wait(time)? else { return Ok(None) };
        let (mut came, mut is_new) = (false, false);
        // A resize is an event without input on stdin.
        while event::poll(Duration::ZERO)? {
            came = true;
            match event::read()? {
                Event::Key(key) if key.kind != KeyEventKind::Release => {
                    if !press(self, key)? {
                        return Ok(None);
                    }
                }
                // Needed even if the size is as before: the terminal may have lost text meanwhile.
                Event::Resize(..) => self.clear()?,
                _ => continue,
            }
            is_new = true;
        }
        if is_readable && !came {
            self.announce_again()?;
        }
        Ok(Some(is_new))
    }

    /// Waits at most this time. Returns whether there is input; `None` if the terminal was closed, for
    /// example its window.
    fn wait(&self, time: Duration) -> Result<Option<bool>, Failure> {
        let stdin = stdin();
        let mut fds = [PollFd::new(&stdin, PollFlags::IN)];
        let timeout = Timespec::try_from(time).ok();
        match poll(&mut fds, timeout.as_ref()) {
            Ok(0) | Err(Errno::INTR) => return Ok(Some(false)),
            Ok(_) => {}
            Err(error) => return Err(std::io::Error::from(error).into()),
        }
        // At the end of a terminal crossterm would read without end.
        let is_gone =
            fds[0].revents().intersects(PollFlags::HUP | PollFlags::ERR | PollFlags::NVAL);
        Ok((!is_gone).then_some(true))
    }

    /// Makes crossterm read keys that it has left. It leaves keys behind a resize, and those behind 1024
    /// bytes, until the next key comes. Setting the mode of the terminal anew counts as a key.
    fn announce_again(&self) -> Result<(), Failure> {
        let stdin = stdin();
        let mode = tcgetattr(&stdin).map_err(std::io::Error::from)?;
        tcsetattr(&stdin, OptionalActions::Now, &mode).map_err(std::io::Error::from)?;
        Ok(())
    }
}

/// Ends the process some time after its terminal was closed. Normally the view detects this first. If
/// the terminal is closed while crossterm reads keys, crossterm reads without end.
fn end_without_terminal() {
    let stdin = stdin();
    let mut fds = [PollFd::new(&stdin, PollFlags::empty())];
    // Without requested events this waits only for the end of the terminal.
    while poll(&mut fds, None) == Err(Errno::INTR) {}
    std::thread::sleep(END);
    std::process::exit(128 + SIGHUP);
}

impl Drop for Screen {
    fn drop(&mut self) {
        restore();
    }
}

/// Errors are ignored: the terminal may be closed.
fn restore() {
    let _ = ratatui::try_restore();
    output::show_view(false);
}

#[cfg(test)]
mod tests {
    use std::fs::File;
    use std::io::Read;
    use std::os::unix::fs::OpenOptionsExt;
    use std::process::Command;

    use rustix::fs::OFlags;
    use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
    use rustix::termios::tcgetattr;

    use super::*;

    /// Set in the process that panics.
    const PANICS: &str = "MOTORLINK_TEST_PANICS_IN_THE_VIEW";

    #[test]
    fn a_panic_restores_the_terminal_before_its_message() {
        if std::env::var_os(PANICS).is_some() {
            let _screen = Screen::enter().unwrap();
            panic!("a defect of the view");
        }
        let ours = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
        grantpt(&ours).unwrap();
        unlockpt(&ours).unwrap();
        let name = ptsname(&ours, Vec::new()).unwrap().into_string().unwrap();
        let flags = OFlags::NOCTTY.bits() as i32;
        let theirs = File::options().read(true).write(true).custom_flags(flags).open(name).unwrap();
        let modes = || {
            let now = tcgetattr(&theirs).unwrap();
            (now.input_modes, now.output_modes, now.local_modes)
        };
        let before = modes();
        let end = || theirs.try_clone().unwrap();
        let test = "watch::screen::tests::a_panic_restores_the_terminal_before_its_message";
        let status = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", test, "--nocapture"])
            .envs([(PANICS, "1"), ("TERM", "xterm-256color"), ("RUST_BACKTRACE", "0")])
            .stdin(end())
            .stdout(end())
            .stderr(end())
            .status()
            .unwrap();
        assert!(!status.success());
        assert_eq!(modes(), before);
        drop(theirs);
        let mut said = Vec::new();
        // The end of a pty is an error.
        let _ = File::from(ours).read_to_end(&mut said);
        let said = String::from_utf8_lossy(&said);
        let place = |text| said.find(text).unwrap_or_else(|| panic!("{text:?} in {said:?}"));
        assert!(place("\x1b[?1049h") < place("\x1b[?1049l"), "{said:?}");
        assert!(place("\x1b[?1049l") < place("a defect of the view"), "{said:?}");
    }
}
