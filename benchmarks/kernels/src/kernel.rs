//! Small kernels, timed here and counted by callgrind.

use std::env::current_exe;
use std::hint::black_box;
use std::process::{Child, Command, Stdio};
use std::time::Instant;

use crate::result::Result;

const BATCHES: usize = 201;
/// Repetitions in a batch.
const BATCH: u32 = 1_000;
/// Repetitions in the shorter of the two counted runs.
const COUNTED: u32 = 1_000;

/// The text of [`Cost::show`] in place of a count without valgrind.
pub const NOT_COUNTED: &str = "not measured: install valgrind";

/// Work that can be repeated.
pub struct Kernel {
    /// Its name in tables.
    pub name: String,
    run: Box<dyn FnMut(u32)>,
}

impl Kernel {
    /// A kernel whose repetition is `work`.
    pub fn new(name: impl Into<String>, mut work: impl FnMut() + 'static) -> Self {
        let run = move |count| (0..count).for_each(|_| work());
        Kernel { name: name.into(), run: Box::new(run) }
    }

    /// Repeats the work.
    pub fn repeat(&mut self, count: u32) {
        (self.run)(black_box(count));
    }

    /// Measures the time, and the instructions if there is a counter.
    pub fn cost(mut self, counter: Option<&Counter>) -> Result<Cost> {
        self.repeat(BATCH);
        let mut batches: Vec<f64> = (0..BATCHES)
            .map(|_| {
                let began = Instant::now();
                self.repeat(BATCH);
                began.elapsed().as_nanos() as f64 / f64::from(BATCH)
            })
            .collect();
        batches.sort_by(f64::total_cmp);
        let instructions = counter.map(|counter| counter.count(&self.name)).transpose()?;
        Ok(Cost { least_ns: batches[0], median_ns: batches[BATCHES / 2], instructions })
    }
}

/// The cost of one repetition.
pub struct Cost {
    least_ns: f64,
    median_ns: f64,
    /// `None` without a counter.
    pub instructions: Option<f64>,
}

impl Cost {
    /// Cells: nanoseconds (least, median over batches) and instructions.
    pub fn show(&self) -> [String; 3] {
        let instructions = self.instructions.map(|count| format!("{count:.0}"));
        [
            format!("{:.1}", self.least_ns),
            format!("{:.1}", self.median_ns),
            instructions.unwrap_or_else(|| NOT_COUNTED.to_owned()),
        ]
    }
}

/// Counts instructions in user space: this program under callgrind.
pub struct Counter(());

impl Counter {
    /// `None` with a warning if valgrind is not installed.
    pub fn find() -> Option<Self> {
        let valgrind = Command::new("valgrind").arg("--version").stdout(Stdio::null()).status();
        if valgrind.is_ok_and(|status| status.success()) {
            return Some(Counter(()));
        }
        eprintln!("WARNING: instructions are {NOT_COUNTED} (apt-get install valgrind)");
        None
    }

    /// Instructions of one repetition: the difference of a run with twice the repetitions and a run
    /// with one, so that start and end cancel.
    pub fn count(&self, kernel: &str) -> Result<f64> {
        let once = Self::spawn(kernel, COUNTED)?;
        let twice = Self::spawn(kernel, 2 * COUNTED)?;
        let (once, twice) = (collected(once)?, collected(twice)?);
        let count = (twice as f64 - once as f64) / f64::from(COUNTED);
        if count >= 1.0 {
            Ok(count)
        } else {
            Err(format!("{kernel}: callgrind counts nothing").into())
        }
    }

    fn spawn(kernel: &str, count: u32) -> Result<Child> {
        let child = Command::new("valgrind")
            .args(["--command-line-only=yes", "--tool=callgrind", "--callgrind-out-file=/dev/null"])
            .arg(current_exe()?)
            .args(["kernel", kernel, &count.to_string()])
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()?;
        Ok(child)
    }
}

fn collected(run: Child) -> Result<u64> {
    let output = run.wait_with_output()?;
    let log = String::from_utf8_lossy(&output.stderr);
    let count = total(&log).filter(|_| output.status.success());
    count.ok_or_else(|| format!("callgrind gave no count:\n{log}").into())
}

/// The count in callgrind's last output: `==PID== Collected : 126651`.
fn total(log: &str) -> Option<u64> {
    let (_, count) = log.lines().find_map(|line| line.split_once("Collected : "))?;
    count.trim().parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::Cell;
    use std::rc::Rc;

    #[test]
    fn a_kernel_repeats_its_work() {
        let done = Rc::new(Cell::new(0));
        let work = Rc::clone(&done);
        Kernel::new("counting", move || work.set(work.get() + 1)).repeat(7);
        assert_eq!(done.get(), 7);
    }

    #[test]
    fn the_count_is_found_in_the_log() {
        let log = "==3299== Events    : Ir\n==3299== Collected : 126651\n==3299==\n";
        assert_eq!(total(log), Some(126_651));
        assert_eq!(total("valgrind: failed to start"), None);
    }
}
