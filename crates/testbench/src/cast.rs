//! The drives of a bench, and their signals.

use motorlink_proto::rmd::MotorId;
use motorlink_proto::st::MotorNumber;

use crate::config::BenchConfig;
use crate::signals::{RMD, ST, Signal};

/// The drives of a bench.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Cast {
    pub(crate) config: BenchConfig,
    /// Whether there is an ST drive.
    pub(crate) st: bool,
    /// Whether there is a bus of RMD motors.
    pub(crate) rmd: bool,
}

impl Cast {
    /// The motors, in the order of their signals.
    pub(crate) fn targets(&self) -> Vec<Target> {
        let st = (1..).map_while(MotorNumber::new).take(self.config.st_motors()).map(Target::St);
        let ids = self.config.rmd_motors().iter().filter_map(|motor| MotorId::new(motor.id));
        let mut ids: Vec<MotorId> = ids.collect();
        ids.sort_unstable();
        let rmd = ids.into_iter().map(Target::Rmd);
        st.filter(|_| self.st).chain(rmd.filter(|_| self.rmd)).collect()
    }

    /// The signals of all motors.
    pub(crate) fn signals(&self) -> Vec<Signal> {
        let of = |target: Target| -> Vec<Signal> {
            let name = target.to_string();
            match target {
                Target::St(_) => ST.iter().map(|row| row.signal(&name)).collect(),
                Target::Rmd(_) => RMD.iter().map(|row| row.signal(&name)).collect(),
            }
        };
        self.targets().into_iter().flat_map(of).collect()
    }
}

/// A motor of the cast.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Target {
    /// By number, from 1.
    St(MotorNumber),
    Rmd(MotorId),
}

impl std::fmt::Display for Target {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Target::St(motor) => write!(f, "st{}", motor.number()),
            Target::Rmd(id) => write!(f, "rmd{id}"),
        }
    }
}
