//! Both protocols on lines with faults, on virtual time. See docs/RELIABILITY.md.

mod bench;
mod campaign;
mod life;
mod plan;
mod report;
mod rmd;
mod st;
mod tally;
mod wire;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use motorlink_link::fault::Faults;

use campaign::Failed;
use plan::{GROUPS, SEEDS, Speaks, TWICE, Trial, WRITES, seeded};
use st::Setup;
use st::twice::{self, Batches};
use st::verified::{self, Writes};
use tally::Tally;

/// Runs both protocols on lines with faults and checks Motorlink's guarantees. Fails with the seed
/// and a trace if a guarantee is violated.
#[derive(Parser)]
#[command(name = "motorlink-reliability")]
struct Args {
    /// Cut each trial to this many exchanges
    #[arg(long, default_value_t = u64::MAX)]
    most: u64,
    /// Write the tables into this file, between its marks, instead of printing them
    #[arg(long, value_name = "FILE")]
    update: Option<PathBuf>,
}

fn main() -> ExitCode {
    let args = Args::parse();
    let result = measure(args.most).map_err(describe).and_then(|tables| match args.update {
        Some(path) => report::update(&path, &tables),
        None => {
            print!("{tables}");
            Ok(())
        }
    });
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("error: {message}");
            ExitCode::FAILURE
        }
    }
}

fn measure(most: u64) -> Result<String, Failed> {
    let mut tables = String::new();
    let (mut st, mut rmd) = (0, 0);
    for group in GROUPS {
        let trials: Vec<Trial> = group.trials(most).collect();
        let tallies = campaign::run(&trials, SEEDS)?;
        let sum = tallies.iter().map(|tally| tally.exchanges).sum::<u64>();
        match group.speaks {
            Speaks::St(_) => st += sum,
            Speaks::Rmd(_) => rmd += sum,
        }
        let mut rows: Vec<(Trial, Tally)> = trials.into_iter().zip(tallies).collect();
        tables += &report::trials(group.title, &mut rows).map_err(Failed::Plan)?;
        eprintln!("{}: {sum} exchanges", group.title);
    }
    tables += &report::writes(&writes(most)?);
    tables += &report::twice(&twice(most)?);
    tables += &report::checksum();
    let version = env!("CARGO_PKG_VERSION");
    let head = format!(
        "Motorlink {version}: {st} exchanges of ST's protocol and {rmd} of RMD, each trial in \
         {SEEDS} parts with seeds 1 to {SEEDS}, and no guarantee was violated.\n\n"
    );
    Ok(head + &tables)
}

/// Plain and verified writes on the same lines.
fn writes(most: u64) -> Result<Vec<(String, [Writes; 2])>, Failed> {
    let row = |&(setup, faults, count): &(Setup, &str, u64)| {
        let kinds = compare(setup, faults, count.min(most))?;
        Ok((format!("{}, `{faults}`", setup.profile.name()), kinds))
    };
    WRITES.iter().map(row).collect()
}

/// Reads on lines with duplicate replies, without and with confirmation.
fn twice(most: u64) -> Result<Vec<(String, [Batches; 2])>, Failed> {
    let row = |&(share, faults, count): &(f64, &str, u64)| {
        let seeds: Vec<Faults> = (1..=SEEDS)
            .map(|seed| seeded(faults, seed).map_err(Failed::Plan))
            .collect::<Result<_, _>>()?;
        let count = count.min(most) / SEEDS;
        let kinds = [false, true].map(|confirms| {
            let parts = campaign::each(&seeds, |faults| twice::run(share, faults, confirms, count));
            parts.into_iter().sum()
        });
        Ok((format!("{:.0} % twice, `{faults}`", share * 100.0), kinds))
    };
    TWICE.iter().map(row).collect()
}

/// Plain writes, then verified ones.
fn compare(setup: Setup, faults: &str, count: u64) -> Result<[Writes; 2], Failed> {
    let parts: Vec<(bool, u64)> =
        (1..=SEEDS).flat_map(|seed| [(false, seed), (true, seed)]).collect();
    let results = campaign::each(&parts, |&(verified, seed)| {
        let faults = seeded(faults, seed).map_err(Failed::Plan)?;
        verified::run(setup, &faults, verified, count / SEEDS)
            .map_err(|violation| Failed::Violated { faults: faults.to_string(), seed, violation })
    });
    let mut kinds = [Writes::default(); 2];
    for ((verified, _), result) in parts.iter().zip(results) {
        kinds[usize::from(*verified)].add(&result?);
    }
    Ok(kinds)
}

fn describe(failed: Failed) -> String {
    match failed {
        Failed::Plan(error) => error.to_string(),
        Failed::Violated { faults, seed, violation } => format!(
            "{}\n{}, on a line with {faults}, seed {seed}, in exchange {}",
            violation.trace.join("\n"),
            violation.what,
            violation.exchange
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every trial of the full run, shortened.
    #[test]
    fn every_promise_is_kept_on_every_line() {
        for group in GROUPS {
            let trials: Vec<Trial> = group.trials(500).collect();
            let tallies = campaign::run(&trials, 1).map_err(describe).unwrap();
            for (trial, tally) in trials.iter().zip(tallies) {
                assert!(tally.exchanges >= 500, "{trial:?}");
                assert!(tally.detected < tally.exchanges, "{trial:?}: nothing came through");
            }
        }
    }

    #[test]
    fn a_line_without_faults_fails_nobody() {
        for group in GROUPS {
            let clean =
                Trial { faults: "drop=0", beyond: false, ..group.trials(1_000).next().unwrap() };
            let [tally] = &campaign::run(&[clean], 1).map_err(describe).unwrap()[..] else {
                panic!()
            };
            assert_eq!((tally.detected, tally.undetected, tally.misplaced), (0, 0, 0));
        }
    }

    /// The judge detects violations: very late replies are matched to other exchanges, and a run
    /// that does not expect this fails and reports where.
    #[test]
    fn a_broken_promise_is_found_and_traced() {
        for group in GROUPS {
            let Some(beyond) = group.trials(2_000).find(|trial| trial.beyond) else { continue };
            let tally = &campaign::run(&[beyond], 1).map_err(describe).unwrap()[0];
            assert!(tally.misplaced > 0, "{}", group.title);
            let promised = Trial { beyond: false, ..beyond };
            let Err(Failed::Violated { violation, .. }) = campaign::run(&[promised], 1) else {
                panic!("{}: nothing was found", group.title)
            };
            assert!(violation.trace.iter().any(|line| line.contains("VIOLATION")));
        }
    }

    #[test]
    fn verified_writes_are_right_where_plain_ones_are_not() {
        let (setup, faults, _) = WRITES[2];
        let [plain, verified] = compare(setup, faults, 8_000).map_err(describe).unwrap();
        assert!(plain.wrong > 0, "{plain:?}");
        assert_eq!(verified.wrong, 0, "{verified:?}");
        assert!(verified.done > 0);
    }

    #[test]
    fn a_reply_that_comes_twice_is_found_by_the_confirmation() {
        for (line, [plain, confirmed]) in twice(3_200).map_err(describe).unwrap() {
            assert!(plain.wrong > 0, "{line}: {plain:?}");
            assert!(confirmed.wrong * 4 <= plain.wrong, "{line}: {confirmed:?}");
            assert!(confirmed.detected < confirmed.count, "{line}: {confirmed:?}");
        }
    }
}
