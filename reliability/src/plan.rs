//! The tested lines, and the lengths of the tests.

use motorlink_link::fault::{FaultError, Faults};
use motorlink_proto::st::{Profile, Recovery};

use crate::life::Life;
use crate::st::Setup;
use crate::tally::Tally;
use crate::{rmd, st};

/// The protocol and its configuration.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Speaks {
    St(Setup),
    Rmd(Life),
}

/// A line.
#[derive(Debug, Clone, Copy)]
pub struct Trial {
    pub speaks: Speaks,
    /// The faults, as text for `--fault`.
    pub faults: &'static str,
    /// Whether the line has faults that the protocol cannot handle: replies later than the protocol
    /// can distinguish.
    pub beyond: bool,
    pub exchanges: u64,
}

/// Trials with the same protocol and configuration.
pub struct Group {
    pub title: &'static str,
    pub speaks: Speaks,
    rows: &'static [(&'static str, u64)],
    beyond: &'static [(&'static str, u64)],
}

/// Number of parts of each trial. Their seeds start at 1.
pub const SEEDS: u64 = 8;

pub const SPEC: Setup =
    Setup { profile: Profile::Spec, recovery: Recovery::Drain, life: Life::Long };
const FIRMWARE: Setup =
    Setup { profile: Profile::Mcsdk54, recovery: Recovery::Pad, life: Life::Long };

/// The lines of both profiles.
const SERIAL: &[(&str, u64)] = &[
    ("flip=1e-6", 8_000_000),
    ("flip=1e-5", 4_000_000),
    ("flip=1e-4", 3_000_000),
    ("flip=1e-3", 1_500_000),
    ("flip=1e-2", 400_000),
    ("drop=1e-4", 1_000_000),
    ("drop=1e-2", 300_000),
    ("dup=1e-4", 1_000_000),
    ("dup=1e-2", 300_000),
    ("insert=1e-4", 1_000_000),
    ("insert=1e-2", 300_000),
    ("delay=0ms..60ms", 200_000),
    ("delay=450ms..550ms", 200_000),
    ("delay=0ms..990ms", 200_000),
    ("pause=24ms..26ms@1e-3", 500_000),
    ("pause=40ms..60ms@1e-3", 500_000),
    ("pause=900ms..990ms@1e-3", 500_000),
    ("cut=100ms@1e-4", 500_000),
    ("cut=3s@1e-4", 500_000),
    ("flood=300@1e-4", 500_000),
    ("stuck0=300ms@1e-4", 500_000),
    ("stuck1=300ms@1e-4", 500_000),
    ("flip=1e-4,drop=1e-4,dup=1e-4,insert=1e-4,pause=30ms..1s@1e-4,cut=200ms@1e-5", 1_000_000),
];

/// Faults that a protocol without sequence numbers cannot handle reliably.
const SERIAL_BEYOND: &[(&str, u64)] = &[("delay=0ms..3s", 200_000), ("pause=2s..9s@1e-3", 500_000)];

/// Lines for tests where the recovery is off, or does not fit the drive.
const SHORT: &[(&str, u64)] = &[
    ("flip=1e-4", 500_000),
    ("flip=1e-3", 500_000),
    ("drop=1e-3", 500_000),
    ("insert=1e-3", 500_000),
    ("cut=100ms@1e-4", 500_000),
];

const BUS: &[(&str, u64)] = &[
    ("flip=1e-6", 8_000_000),
    ("flip=1e-5", 4_000_000),
    ("flip=1e-4", 3_000_000),
    ("flip=1e-3", 1_500_000),
    ("flip=1e-2", 400_000),
    ("drop=1e-4", 1_000_000),
    ("drop=1e-2", 1_000_000),
    ("dup=1e-4", 1_000_000),
    ("dup=1e-2", 1_000_000),
    ("insert=1e-2", 1_000_000),
    ("delay=0ms..20ms", 500_000),
    ("delay=24ms..26ms", 500_000),
    ("delay=0ms..74ms", 500_000),
    ("pause=49ms..51ms@1e-3", 1_000_000),
    ("pause=99ms..101ms@1e-3", 1_000_000),
    ("pause=140ms..149ms@1e-3,only=received", 1_000_000),
    ("pause=100ms..600ms@1e-3", 1_000_000),
    ("cut=300ms@1e-4", 1_000_000),
    ("flood=100@1e-3", 1_000_000),
    ("corrupt=1e-6", 1_000_000),
    ("corrupt=1e-4", 1_000_000),
    ("corrupt=1e-2", 500_000),
    ("flip=1e-5,drop=1e-4,dup=1e-4,insert=1e-3,pause=30ms..70ms@1e-4,cut=50ms@1e-5", 1_000_000),
];

/// Replies of a motor that differ in delay by more than the quarantine time.
const BUS_BEYOND: &[(&str, u64)] = &[("delay=0ms..200ms", 500_000)];

/// The lines for several programs one after the other.
const SERIAL_TURNS: &[(&str, u64)] = &[
    ("drop=0", 200_000),
    ("delay=0ms..60ms", 200_000),
    ("delay=75ms..75ms", 200_000),
    ("delay=0ms..490ms", 200_000),
    ("drop=1e-3", 200_000),
    ("dup=1e-3", 200_000),
    ("flip=1e-4", 200_000),
    ("pause=40ms..60ms@1e-3", 200_000),
    ("pause=900ms..990ms@1e-3", 200_000),
    ("cut=100ms@1e-4", 200_000),
];
const BUS_TURNS: &[(&str, u64)] = &[
    ("drop=0", 200_000),
    ("delay=0ms..20ms", 200_000),
    ("delay=24ms..26ms", 200_000),
    ("drop=1e-2", 200_000),
    ("dup=1e-2", 200_000),
    ("flip=1e-4", 200_000),
    ("pause=49ms..51ms@1e-3", 200_000),
    ("cut=300ms@1e-4", 200_000),
];

/// Lines with duplicate replies: the fraction of duplicates, further faults, and the number of
/// reads.
pub const TWICE: &[(f64, &str, u64)] = &[
    (1e-2, "drop=0", 200_000),
    (1e-1, "drop=0", 200_000),
    (1.0, "drop=0", 50_000),
    (1e-1, "drop=1e-3", 200_000),
    (1e-1, "delay=5ms..5ms", 100_000),
];

/// All trials.
pub const GROUPS: &[Group] = &[
    Group {
        title: "ST, profile spec, recovery Drain",
        speaks: Speaks::St(SPEC),
        rows: SERIAL,
        beyond: SERIAL_BEYOND,
    },
    Group {
        title: "ST, profile mcsdk-5.4, recovery Pad",
        speaks: Speaks::St(FIRMWARE),
        rows: SERIAL,
        beyond: SERIAL_BEYOND,
    },
    Group {
        title: "ST, profile mcsdk-5.4, recovery Drain",
        speaks: Speaks::St(Setup { recovery: Recovery::Drain, ..FIRMWARE }),
        rows: SHORT,
        beyond: &[],
    },
    Group {
        title: "ST, profile spec, recovery None: opened again 3 s after each loss",
        speaks: Speaks::St(Setup { recovery: Recovery::None, ..SPEC }),
        rows: SHORT,
        beyond: &[],
    },
    Group { title: "RMD", speaks: Speaks::Rmd(Life::Long), rows: BUS, beyond: BUS_BEYOND },
    Group {
        title: "ST, profile spec, recovery Drain, programs in turn",
        speaks: Speaks::St(Setup { life: Life::Short, ..SPEC }),
        rows: SERIAL_TURNS,
        beyond: &[("delay=0ms..3s", 100_000)],
    },
    Group {
        title: "ST, profile mcsdk-5.4, recovery Pad, programs in turn",
        speaks: Speaks::St(Setup { life: Life::Short, ..FIRMWARE }),
        rows: SERIAL_TURNS,
        beyond: &[("delay=0ms..3s", 100_000)],
    },
    Group {
        title: "RMD, programs in turn",
        speaks: Speaks::Rmd(Life::Short),
        rows: BUS_TURNS,
        beyond: BUS_BEYOND,
    },
];

/// Lines for the comparison of plain and verified writes, and the number of writes.
pub const WRITES: &[(Setup, &str, u64)] = &[
    (SPEC, "flip=1e-4", 4_000_000),
    (SPEC, "flip=1e-3", 2_000_000),
    (SPEC, "flip=1e-2", 400_000),
    (SPEC, "drop=1e-2", 400_000),
    (SPEC, "insert=1e-2", 400_000),
    (FIRMWARE, "flip=1e-3", 1_000_000),
    (FIRMWARE, "drop=1e-2", 400_000),
];

impl Group {
    /// The trials, with a length for each cut to `most`.
    pub fn trials(&self, most: u64) -> impl Iterator<Item = Trial> {
        let speaks = self.speaks;
        let rows = self.rows.iter().map(|row| (false, row));
        rows.chain(self.beyond.iter().map(|row| (true, row))).map(
            move |(beyond, &(faults, exchanges))| Trial {
                speaks,
                faults,
                beyond,
                exchanges: exchanges.min(most),
            },
        )
    }
}

impl Trial {
    /// The expected number of damaged messages that pass the checksum.
    pub fn expected(&self, tally: &Tally) -> Result<f64, FaultError> {
        let faults = self.faults.parse()?;
        Ok(match self.speaks {
            Speaks::St(setup) => st::expected(setup, &faults, tally),
            Speaks::Rmd(_) => rmd::expected(&faults, tally),
        })
    }
}

/// The faults of a trial for this seed.
pub fn seeded(faults: &str, seed: u64) -> Result<Faults, FaultError> {
    Ok(Faults { seed, ..faults.parse()? })
}
