//! The motors, and what is read of them.

/// Buses with RMD motors, each behind an slcan adapter.
pub(super) const BUSES: usize = 2;
pub(super) const MOTORS_OF_BUS: u8 = 16;
/// Lines to ST drives.
pub(super) const ST_LINES: usize = 2;
pub(super) const MOTORS_OF_LINE: u8 = 2;
/// What is read of an RMD motor. The temperature is in both replies.
pub(super) const QUANTITIES: [&str; 6] =
    ["temperature_celsius", "iq_amps", "speed_dps", "encoder", "voltage_volts", "errors"];
/// What is read of a motor of an ST drive.
pub(super) const REGISTERS: [&str; 8] = [
    "STATUS",
    "FLAGS",
    "SPEED_REF",
    "SPEED_MEAS",
    "TORQUE_REF",
    "TORQUE_MEAS",
    "BUS_VOLTAGE",
    "HEATS_TEMP",
];
