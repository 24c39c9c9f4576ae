//! The kit's readings: rows of docs/SPEC-NOTES.md that a case demands, where the document is
//! unclear.

/// A row of docs/SPEC-NOTES.md. A drive that differs from it may still fulfil its document.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Reading {
    /// The row's id.
    pub row: &'static str,
    /// The reading in a sentence.
    pub text: &'static str,
}

macro_rules! readings {
    ($( $row:ident $text:literal; )+) => {
        $(
            #[doc = $text]
            pub(crate) const $row: Reading = Reading { row: stringify!($row), text: $text };
        )+
        /// Every reading that a case demands.
        pub static READINGS: &[Reading] = &[$($row),+];
    };
}

readings! {
    S1 "Replies have the headers 0xF0 and 0xFF; sent as commands these address motor 7.";
    S5 "A register of access D can be neither read nor written; its id is a value for a DAC channel.";
    S7 "A data segment has the layout of SPEC-NOTES.";
    S10 "A length over 128 is answered with TIMEOUT after 25 ms of silence.";
    S11 "The 25 ms count from the first byte of the frame.";
    S13 "The version text is the name, a tab, \"Ver.\" and the numbers.";
    S14 "STATUS and FLAGS have the values of shipped firmware.";
    S15 "CONTROL_MODE is 0 for torque and 1 for speed, and reads the last commanded mode.";
    S18 "A message that is too short is refused and has no effect.";
    S19 "Bytes that a short value lacks keep their old value.";
    S20 "TARGET_MOTOR is the current motor, counted from 0; a missing motor is WRONG_SET.";
    S22 "IQ_SPEEDMODE is the Id reference of speed mode.";
    S23 "Temperatures and power have a sign.";
    S24 "A rev-up phase over 4 is WRONG_SET.";
    S25 "SET_CURRENT_REF changes to torque mode.";
    S26 "RAMP_FINAL_SPEED is the end of the last ramp; a write is a ramp of the last duration.";
    S28 "PFC_ACBUS_FREQ is in 0.1 Hz.";
    S29 "A byte after the 25 ms begins a new frame.";
    S34 "PFC_DISABLE disables a PFC that is enabled.";
    S35 "Bytes after a message are ignored.";
    S47 "The checksum is checked before the motor and the frame code; a damaged frame selects no motor.";
    S48 "At rest the references have their last commanded values and SPEED_REF is 0; in RUN SPEED_REF follows the ramp.";
    S49 "A register takes every value of its size.";
    S50 "PFC_ENABLED is 0 or 1; a drive with the registers of a PFC has a PFC.";
    S51 "GET_BOARD_INFO and GET_FW_VERSION have the same version.";
    S52 "A motor with a sensor keeps rev-up data, too.";
    S53 "ENCODER_ALIGN acts at rest only, is visible in STATUS and ends at rest.";
    S54 "The registers of a feature exist together; registers without a feature always exist.";

    R4 "NULL bytes of a request are ignored, and an echo repeats them.";
    R8 "An offset written with 0x91 applies at once and is in ROM.";
    R9 "After 0x19 the old offset is read until power-on.";
    R11 "A frame of another form gets no reply.";
    R13 "With a maximum speed of 0 the motor does not turn.";
    R15 "An angle over 35999 or a direction over 1 is answered but not carried out.";
    R16 "Repeating a single-turn command starts no further turn.";
    R17 "A motion command starts a motor that is stopped or off.";
    R18 "While an error is active the motor is off.";
    R19 "An offset beyond the encoder is cut to its width.";
    R20 "The multi-turn angle modulo 360° is the single-turn angle.";
    R24 "An acceleration of 0 or a negative one means no limit and reads back as written.";
    R25 "0x88 without a stop changes nothing.";
    R26 "A held position does not move when the offset changes.";
    R30 "A command byte that chapter 2 does not list gets no reply.";
    R31 "Single-turn angle and encoder refer to the motor shaft.";
    R37 "An acceleration of any size reads back as written.";
    R38 "The sum of the phase currents is 0, and their size is about that of the torque current.";
    R39 "The acceleration of 0x34 is the Max Acceleration of the vendor's tool.";
    R40 "A move reaches its maximum speed.";
    R36 "Positive speed and torque turn clockwise.";
    R41 "Without position gains a motor does not move to a position.";
    R42 "A frame to an ID outside 1 to 32 gets no reply.";
}
