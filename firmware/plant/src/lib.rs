//! The motors that both boards have: a servo motor behind the ST drive, two direct drives on the
//! RMD bus, with the firmware of their control loops, from `motorlink-sim`.
//!
//! The simulation runs on the board itself. Where that cannot keep up, the motors' time falls behind
//! the board's, which only the protocols go by: motors then move slowly, and every answer still comes
//! in time.
#![no_std]
#![forbid(unsafe_code)]

use motorlink_proto::rmd::{Config, Drive, MotorId, Settings};
use motorlink_proto::time::{Duration, Instant};
use motorlink_sim::plant::OutOfRange;
use motorlink_sim::rmd::{RmdConfig, RmdMotor};
use motorlink_sim::st::{MotorConfig, StDrive, StMotor};

/// The IDs of the RMD motors.
pub const RMD_IDS: [u8; 2] = [1, 2];

/// Motors advance by so much between two looks at the ports.
const SLICE: Duration = Duration(500);
/// What the motors' time may be behind the board's before it stays behind.
const LAG: Duration = Duration(20_000);

/// The motors and their time.
pub struct Plant {
    /// The drive behind ST's protocol, with one motor.
    pub st: StDrive<[StMotor; 1]>,
    /// The motors on the RMD bus.
    pub rmd: [RmdMotor; RMD_IDS.len()],
    /// Which moment the motors have reached, on their clock.
    reached: Instant,
    /// When that was, on the board's clock.
    at: Instant,
}

impl Plant {
    /// Motors at rest, powered on `now`.
    pub fn new(now: Instant) -> Result<Self, OutOfRange> {
        let [one, two] = RMD_IDS.map(|id| RmdMotor::new(RmdConfig::with_id(id)));
        let st = StDrive::new(Instant(0), [StMotor::new(MotorConfig::servo())]);
        Ok(Plant {
            st: st.expect("a drive may have one motor"),
            rmd: [one?, two?],
            reached: Instant(0),
            at: now,
        })
    }

    /// The drives of the RMD motors, not yet powered on.
    pub fn rmd_drives() -> [Drive; RMD_IDS.len()] {
        RMD_IDS.map(|id| {
            let id = MotorId::new(id).expect("IDs 1 and 2 exist");
            Drive::new(Config::new(id), Self::rmd_rom())
        })
    }

    /// What a new RMD motor has in its ROM.
    pub fn rmd_rom() -> Settings {
        RmdConfig::default().factory_rom()
    }

    /// Moves the motors on by a slice of time, at most to `now`; whether they have reached it.
    pub fn advance(&mut self, now: Instant) -> bool {
        let behind = now.since(self.at);
        if behind > LAG {
            self.at += Duration(behind.0 - LAG.0);
        }
        if now.since(self.at) < SLICE {
            return true;
        }
        self.at += SLICE;
        self.reached += SLICE;
        self.st.advance_to(self.reached);
        for motor in &mut self.rmd {
            for _ in 0..SLICE.0 / u64::from(motor.config().plant.period_us) {
                motor.step();
            }
        }
        false
    }

    /// How long the motors have run, on their clock.
    pub fn simulated(&self) -> Instant {
        self.reached
    }
}
