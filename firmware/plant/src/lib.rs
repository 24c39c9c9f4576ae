//! The motors that both boards have, from `motorlink-sim` with the firmware of their control loops:
//! two behind the ST drive, four on the RMD bus, those of `motorlink sim` without a configuration.
//!
//! The simulation runs on the board itself. Where that cannot keep up with a time that runs, the
//! motors' time falls behind the board's, which only the protocols go by.
#![no_std]
#![forbid(unsafe_code)]

use motorlink_proto::rmd::{Drive, DriveConfig, MotorId, Settings};
use motorlink_proto::time::{Instant, Micros};
use motorlink_sim::plant::OutOfRange;
use motorlink_sim::rmd::{RmdConfig, RmdMotor};
use motorlink_sim::st::{StDrive, StMotor};

/// The IDs of the RMD motors.
pub const RMD_IDS: [u8; 4] = [1, 2, 3, 4];

/// Motors advance by so much between two looks at the ports.
const SLICE: Micros = Micros(500);
/// What the motors' time may be behind the board's before it stays behind.
const LAG: Micros = Micros(20_000);

/// The motors and their time.
pub struct Plant {
    /// The drive behind ST's protocol.
    pub st: StDrive<[StMotor; 2]>,
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
        let [one, two, three, four] = RmdConfig::demo().map(RmdMotor::new);
        Ok(Plant {
            st: StDrive::demo(Instant(0)),
            rmd: [one?, two?, three?, four?],
            reached: Instant(0),
            at: now,
        })
    }

    /// The drives of the RMD motors, not yet powered on.
    pub fn rmd_drives() -> [Drive; RMD_IDS.len()] {
        RMD_IDS.map(|id| {
            let id = MotorId::new(id).expect("IDs 1 to 4 exist");
            Drive::new(DriveConfig::new(id), Self::rmd_rom())
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
            self.at += Micros(behind.0 - LAG.0);
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
