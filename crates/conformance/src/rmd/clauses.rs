//! What the document "Motor control protocol (CAN bus) V1.62" demands.

use crate::clause::Clause;

/// Every command and reply with its fields: bytes to values and back.
const VECTORS: &[&str] = &["every_vector_decodes_and_encodes_to_its_fields"];
/// The same, and the bytes of a request between its fields.
const REQUESTS: &[&str] = &[
    "every_vector_decodes_and_encodes_to_its_fields",
    "null_bytes_of_a_request_are_ignored_and_sent_as_zero",
];
/// The bytes of a reply between its fields.
const REPLIES: &[&str] = &["every_reply_keeps_its_values_and_leaves_null_bytes_zero"];
/// The codes and their commands.
const LIST: &[&str] = &["the_table_has_every_command_once"];
/// Why settings of the vendor's tool are not tested.
const TOOL: &str = "depends on a setting of the vendor's tool, which the wire cannot read";

/// Every sentence of the document that contains a demand, in its order.
#[rustfmt::skip]
pub static CLAUSES: &[Clause] = &[
    Clause::new("RMD-1-01", "A command to one motor and its reply both have the identifier 0x140 + ID.")
        .host(&["every_vector_has_the_identifier_of_its_motor"]),
    Clause::new("RMD-1-02", "IDs are 1 to 32.")
        .host(&["ids_are_1_to_32_and_keep_their_identifiers"])
        .untested("a drive cannot be given another ID through the bus"),
    Clause::new("RMD-1-03", "Commands and replies are data frames.")
        .host(VECTORS),
    Clause::new("RMD-1-04", "They are standard frames, with an identifier of 11 bits.")
        .host(VECTORS),
    Clause::new("RMD-1-05", "They have eight bytes.")
        .host(VECTORS),
    Clause::new("RMD-1-06", "A frame with another identifier or of another form is not a command to this motor: it has no effect and no reply (SPEC-NOTES R11)."),

    Clause::new("RMD-2-01", "The command byte 0x30 reads the gains.")
        .host(LIST),
    Clause::new("RMD-2-02", "The command byte 0x31 writes the gains to RAM.")
        .host(LIST),
    Clause::new("RMD-2-03", "The command byte 0x32 writes the gains to ROM.")
        .host(LIST),
    Clause::new("RMD-2-04", "The command byte 0x33 reads the acceleration.")
        .host(LIST),
    Clause::new("RMD-2-05", "The command byte 0x34 writes the acceleration to RAM.")
        .host(LIST),
    Clause::new("RMD-2-06", "The command byte 0x90 reads the encoder.")
        .host(LIST),
    Clause::new("RMD-2-07", "The command byte 0x91 writes the encoder offset.")
        .host(LIST),
    Clause::new("RMD-2-08", "The command byte 0x19 makes the current position the zero, in ROM.")
        .host(LIST),
    Clause::new("RMD-2-09", "The command byte 0x92 reads the multi-turn angle.")
        .host(LIST),
    Clause::new("RMD-2-10", "The command byte 0x94 reads the single-turn angle.")
        .host(LIST),
    Clause::new("RMD-2-11", "The command byte 0x9A reads status 1 with the error flags.")
        .host(LIST),
    Clause::new("RMD-2-12", "The command byte 0x9B clears the error flags.")
        .host(LIST),
    Clause::new("RMD-2-13", "The command byte 0x9C reads status 2.")
        .host(LIST),
    Clause::new("RMD-2-14", "The command byte 0x9D reads status 3.")
        .host(LIST),
    Clause::new("RMD-2-15", "The command byte 0x80 switches the motor off.")
        .host(LIST),
    Clause::new("RMD-2-16", "The command byte 0x81 stops the motor.")
        .host(LIST),
    Clause::new("RMD-2-17", "The command byte 0x88 lets the motor run.")
        .host(LIST),
    Clause::new("RMD-2-18", "The command byte 0xA1 closes the torque loop.")
        .host(LIST),
    Clause::new("RMD-2-19", "The command byte 0xA2 closes the speed loop.")
        .host(LIST),
    Clause::new("RMD-2-20", "The command byte 0xA3 closes the position loop, command 1.")
        .host(LIST),
    Clause::new("RMD-2-21", "The command byte 0xA4 closes the position loop, command 2.")
        .host(LIST),
    Clause::new("RMD-2-22", "The command byte 0xA5 closes the position loop, command 3.")
        .host(LIST),
    Clause::new("RMD-2-23", "The command byte 0xA6 closes the position loop, command 4.")
        .host(LIST),
    Clause::new("RMD-2-24", "A command byte outside the list is not a command: it has no effect and no reply (SPEC-NOTES R30).")
        .host(&["an_unknown_code_is_sent_and_times_out"]),

    Clause::new("RMD-30-01", "The host requests the gains with DATA[0] = 0x30 and NULL in all other bytes; NULL is sent as 0 and ignored (SPEC-NOTES R4).")
        .host(REQUESTS),
    Clause::new("RMD-30-02", "The motor answers with one frame, DATA[0] = 0x30.")
        .host(VECTORS),
    Clause::new("RMD-30-03", "DATA[1] of the reply is 0.")
        .host(REPLIES),
    Clause::new("RMD-30-04", "DATA[2] and DATA[3] of the reply are Kp and Ki of the position loop.")
        .host(VECTORS),
    Clause::new("RMD-30-05", "DATA[4] and DATA[5] of the reply are Kp and Ki of the speed loop.")
        .host(VECTORS),
    Clause::new("RMD-30-06", "DATA[6] and DATA[7] of the reply are Kp and Ki of the torque loop.")
        .host(VECTORS),
    Clause::new("RMD-30-07", "The gains that are read are the present ones."),

    Clause::new("RMD-31-01", "The host writes gains with DATA[0] = 0x31, NULL in DATA[1] and the six gains in DATA[2] to DATA[7], in the order of 0x30.")
        .host(REQUESTS),
    Clause::new("RMD-31-02", "The gains apply at once."),
    Clause::new("RMD-31-03", "They are lost at power-off."),
    Clause::new("RMD-31-04", "The motor answers with one frame, a copy of the request.")
        .host(VECTORS),

    Clause::new("RMD-32-01", "The host writes gains to ROM with DATA[0] = 0x32, NULL in DATA[1] and the six gains in DATA[2] to DATA[7], in the order of 0x30.")
        .host(REQUESTS),
    Clause::new("RMD-32-02", "The gains are kept over a power cycle."),
    Clause::new("RMD-32-03", "The motor answers with one frame, a copy of the request.")
        .host(VECTORS),

    Clause::new("RMD-33-01", "The host requests the acceleration with DATA[0] = 0x33 and NULL in all other bytes; NULL is sent as 0 and ignored (SPEC-NOTES R4).")
        .host(REQUESTS),
    Clause::new("RMD-33-02", "The motor answers with one frame, DATA[0] = 0x33.")
        .host(VECTORS),
    Clause::new("RMD-33-03", "DATA[1] to DATA[3] of the reply are 0.")
        .host(REPLIES),
    Clause::new("RMD-33-04", "DATA[4] to DATA[7] of the reply are the acceleration, int32, low byte first, 1 °/s² a digit (SPEC-NOTES R5).")
        .host(VECTORS),

    Clause::new("RMD-34-01", "The host writes the acceleration with DATA[0] = 0x34, NULL in DATA[1] to DATA[3] and the acceleration in DATA[4] to DATA[7], int32, low byte first (SPEC-NOTES R5).")
        .host(REQUESTS),
    Clause::new("RMD-34-02", "The acceleration applies at once; 0 and negative values mean no limit (SPEC-NOTES R24)."),
    Clause::new("RMD-34-03", "One digit is 1 °/s²."),
    Clause::new("RMD-34-04", "It is lost at power-off."),
    Clause::new("RMD-34-05", "The motor answers with one frame, a copy of the request.")
        .host(VECTORS),

    Clause::new("RMD-90-01", "The host requests the encoder with DATA[0] = 0x90 and NULL in all other bytes; NULL is sent as 0 and ignored (SPEC-NOTES R4).")
        .host(REQUESTS),
    Clause::new("RMD-90-02", "The motor answers with one frame, DATA[0] = 0x90.")
        .host(VECTORS),
    Clause::new("RMD-90-03", "DATA[1] of the reply is 0.")
        .host(REPLIES),
    Clause::new("RMD-90-04", "DATA[2] and DATA[3] of the reply are the encoder position, uint16, low byte first.")
        .host(VECTORS),
    Clause::new("RMD-90-05", "The position is the original position minus the offset, within a turn."),
    Clause::new("RMD-90-06", "DATA[4] and DATA[5] of the reply are the original position, uint16, low byte first.")
        .host(VECTORS),
    Clause::new("RMD-90-07", "DATA[6] and DATA[7] of the reply are the offset, uint16, low byte first.")
        .host(VECTORS),
    Clause::new("RMD-90-08", "Each of the three is within the encoder's width: 0 to 16383 with 14 bits."),

    Clause::new("RMD-91-01", "The host writes the offset with DATA[0] = 0x91, NULL in DATA[1] to DATA[5] and the offset in DATA[6] and DATA[7], uint16, low byte first.")
        .host(REQUESTS),
    Clause::new("RMD-91-02", "The offset applies at once (SPEC-NOTES R8); a held position does not move (SPEC-NOTES R26)."),
    Clause::new("RMD-91-03", "An offset is within the encoder's width; a larger one is cut, and the reply has the cut value (SPEC-NOTES R19)."),
    Clause::new("RMD-91-04", "The motor answers with one frame, DATA[0] = 0x91.")
        .host(VECTORS),
    Clause::new("RMD-91-05", "DATA[1] to DATA[5] of the reply are 0.")
        .host(REPLIES),
    Clause::new("RMD-91-06", "DATA[6] and DATA[7] of the reply are the new offset, uint16, low byte first.")
        .host(VECTORS),
    Clause::new("RMD-91-07", "The offset is kept over a power cycle (SPEC-NOTES R8)."),

    Clause::new("RMD-19-01", "The host makes the current position the zero with DATA[0] = 0x19 and NULL in all other bytes; NULL is sent as 0 and ignored (SPEC-NOTES R4).")
        .host(REQUESTS),
    Clause::new("RMD-19-02", "The new zero takes effect with the next power-on, and not before (SPEC-NOTES R9)."),
    Clause::new("RMD-19-03", "The new zero is the position at the moment of the command, and is in ROM."),
    Clause::new("RMD-19-04", "Each use wears the ROM, so it is not for frequent use.")
        .host(&["test_rom_is_written_only_on_an_explicit_word"])
        .untested("a demand on the user; the wire does not show how often a ROM was written"),
    Clause::new("RMD-19-05", "The motor answers with one frame, DATA[0] = 0x19.")
        .host(VECTORS),
    Clause::new("RMD-19-06", "DATA[1] to DATA[5] of the reply are 0.")
        .host(REPLIES),
    Clause::new("RMD-19-07", "DATA[6] and DATA[7] of the reply are the new offset, uint16, low byte first.")
        .host(VECTORS),

    Clause::new("RMD-92-01", "The host requests the multi-turn angle with DATA[0] = 0x92 and NULL in all other bytes; NULL is sent as 0 and ignored (SPEC-NOTES R4).")
        .host(REQUESTS),
    Clause::new("RMD-92-02", "The motor answers with one frame, DATA[0] = 0x92.")
        .host(VECTORS),
    Clause::new("RMD-92-03", "DATA[1] to DATA[7] of the reply are the low seven bytes of the angle, int64, low byte first, sign included (SPEC-NOTES R2).")
        .host(&["a_multi_turn_angle_of_seven_bytes_has_its_sign_extended"]),
    Clause::new("RMD-92-04", "The angle counts over turns: clockwise up, counterclockwise down."),
    Clause::new("RMD-92-05", "One digit is 0.01°."),

    Clause::new("RMD-94-01", "The host requests the single-turn angle with DATA[0] = 0x94 and NULL in all other bytes; NULL is sent as 0 and ignored (SPEC-NOTES R4).")
        .host(REQUESTS),
    Clause::new("RMD-94-02", "The motor answers with one frame, DATA[0] = 0x94.")
        .host(VECTORS),
    Clause::new("RMD-94-03", "DATA[1] to DATA[5] of the reply are 0.")
        .host(REPLIES),
    Clause::new("RMD-94-04", "DATA[6] and DATA[7] of the reply are the angle, uint16, low byte first, 0.01° a digit.")
        .host(VECTORS),
    Clause::new("RMD-94-05", "The angle is counted from the encoder's zero point."),
    Clause::new("RMD-94-06", "It grows clockwise and is 0 again after a turn: the multi-turn angle within the turn (SPEC-NOTES R20)."),

    Clause::new("RMD-80-01", "The host switches the motor off with DATA[0] = 0x80 and NULL in all other bytes; NULL is sent as 0 and ignored (SPEC-NOTES R4).")
        .host(REQUESTS),
    Clause::new("RMD-80-02", "The motor is off."),
    Clause::new("RMD-80-03", "The motion and its command are discarded: there is nothing to resume (SPEC-NOTES R7)."),
    Clause::new("RMD-80-04", "The motor answers with one frame, a copy of the request.")
        .host(VECTORS),

    Clause::new("RMD-81-01", "The host stops the motor with DATA[0] = 0x81 and NULL in all other bytes; NULL is sent as 0 and ignored (SPEC-NOTES R4).")
        .host(REQUESTS),
    Clause::new("RMD-81-02", "The motor comes to a standstill."),
    Clause::new("RMD-81-03", "The motion and its command are kept."),
    Clause::new("RMD-81-04", "The motor answers with one frame, a copy of the request.")
        .host(VECTORS),

    Clause::new("RMD-88-01", "The host lets the motor run with DATA[0] = 0x88 and NULL in all other bytes; NULL is sent as 0 and ignored (SPEC-NOTES R4).")
        .host(REQUESTS),
    Clause::new("RMD-88-02", "After a stop the motor resumes its motion (SPEC-NOTES R7)."),
    Clause::new("RMD-88-03", "Without a stop 0x88 changes nothing (SPEC-NOTES R25)."),
    Clause::new("RMD-88-04", "The motor answers with one frame, a copy of the request.")
        .host(VECTORS),

    Clause::new("RMD-9A-01", "The host requests status 1 with DATA[0] = 0x9A and NULL in all other bytes; NULL is sent as 0 and ignored (SPEC-NOTES R4).")
        .host(REQUESTS),
    Clause::new("RMD-9A-02", "The motor answers with one frame, DATA[0] = 0x9A.")
        .host(VECTORS),
    Clause::new("RMD-9A-03", "DATA[1] of the reply is the motor temperature, int8, 1 °C a digit.")
        .host(VECTORS),
    Clause::new("RMD-9A-04", "DATA[3] and DATA[4] of the reply are the voltage, uint16, low byte first, 0.1 V a digit.")
        .host(VECTORS),
    Clause::new("RMD-9A-05", "DATA[7] of the reply is the error state.")
        .host(VECTORS),
    Clause::new("RMD-9A-06", "DATA[2], DATA[5] and DATA[6] of the reply are 0.")
        .host(REPLIES),
    Clause::new("RMD-9A-07", "Bit 0 of the error state is low voltage protection: set is active.")
        .host(&["invalid_error_bits_are_shown_and_ignored"]),
    Clause::new("RMD-9A-08", "Bit 3 of the error state is over temperature protection: set is active.")
        .host(&["invalid_error_bits_are_shown_and_ignored"]),
    Clause::new("RMD-9A-09", "The other bits of the error state have no meaning.")
        .host(&["invalid_error_bits_are_shown_and_ignored"])
        .untested("a bit without meaning can have either value"),
    Clause::new("RMD-9A-10", "While a protection is active the motor is off; motion commands are answered but not carried out (SPEC-NOTES R18)."),

    Clause::new("RMD-9B-01", "The host clears the errors with DATA[0] = 0x9B and NULL in all other bytes; NULL is sent as 0 and ignored (SPEC-NOTES R4).")
        .host(REQUESTS),
    Clause::new("RMD-9B-02", "The error state is cleared."),
    Clause::new("RMD-9B-03", "The motor answers with one frame; DATA[0] is printed as 0x9A, and 0x9B is accepted as well (SPEC-NOTES R1).")
        .host(&["the_reply_to_clear_errors_may_have_either_code"]),
    Clause::new("RMD-9B-04", "DATA[1] of the reply is the motor temperature, int8, 1 °C a digit.")
        .host(VECTORS),
    Clause::new("RMD-9B-05", "DATA[3] and DATA[4] of the reply are the voltage, uint16, low byte first, 0.1 V a digit.")
        .host(VECTORS),
    Clause::new("RMD-9B-06", "DATA[7] of the reply is the error state.")
        .host(VECTORS),
    Clause::new("RMD-9B-07", "DATA[2], DATA[5] and DATA[6] of the reply are 0.")
        .host(REPLIES),
    Clause::new("RMD-9B-08", "Bit 0 of the error state is low voltage protection: set is active.")
        .host(&["invalid_error_bits_are_shown_and_ignored"]),
    Clause::new("RMD-9B-09", "Bit 3 of the error state is over temperature protection: set is active.")
        .host(&["invalid_error_bits_are_shown_and_ignored"]),
    Clause::new("RMD-9B-10", "The other bits of the error state have no meaning.")
        .host(&["invalid_error_bits_are_shown_and_ignored"])
        .untested("a bit without meaning can have either value"),
    Clause::new("RMD-9B-11", "A flag whose cause is present cannot be cleared (SPEC-NOTES R10)."),

    Clause::new("RMD-9C-01", "The host requests status 2 with DATA[0] = 0x9C and NULL in all other bytes; NULL is sent as 0 and ignored (SPEC-NOTES R4).")
        .host(REQUESTS),
    Clause::new("RMD-9C-02", "The motor answers with one frame, DATA[0] = 0x9C.")
        .host(VECTORS),
    Clause::new("RMD-9C-03", "DATA[1] of the reply is the motor temperature, int8, 1 °C a digit.")
        .host(VECTORS),
    Clause::new("RMD-9C-04", "DATA[2] and DATA[3] of the reply are the torque current, int16, low byte first, ±2048 digits for ±33 A.")
        .host(VECTORS),
    Clause::new("RMD-9C-05", "DATA[4] and DATA[5] of the reply are the speed, int16, low byte first, 1 °/s a digit.")
        .host(VECTORS),
    Clause::new("RMD-9C-06", "DATA[6] and DATA[7] of the reply are the encoder position, uint16, low byte first, within the encoder's width.")
        .host(VECTORS),

    Clause::new("RMD-9D-01", "The host requests status 3 with DATA[0] = 0x9D and NULL in all other bytes; NULL is sent as 0 and ignored (SPEC-NOTES R4).")
        .host(REQUESTS),
    Clause::new("RMD-9D-02", "The motor answers with one frame, DATA[0] = 0x9D.")
        .host(VECTORS),
    Clause::new("RMD-9D-03", "DATA[1] of the reply is 0.")
        .host(REPLIES),
    Clause::new("RMD-9D-04", "DATA[2] to DATA[7] of the reply are the currents of phases A, B and C, int16 each, low byte first.")
        .host(VECTORS),
    Clause::new("RMD-9D-05", "64 digits are 1 A."),

    Clause::new("RMD-A1-01", "The host commands a torque current with DATA[0] = 0xA1 and the current in DATA[4] and DATA[5], int16, low byte first; the other bytes are NULL.")
        .host(REQUESTS),
    Clause::new("RMD-A1-02", "A digit is 16 mA: 2000 digits for 32 A.")
        .host(VECTORS),
    Clause::new("RMD-A1-03", "The range is ±2000 digits; a drive clamps larger values to it (SPEC-NOTES R3).")
        .host(&["torque_beyond_the_range_of_the_document_is_refused_without_any_limit"])
        .untested("would put 32 A into a motor with unknown rating"),
    Clause::new("RMD-A1-04", "Max Torque Current of the vendor's tool does not limit it.")
        .untested(TOOL),
    Clause::new("RMD-A1-05", "The motor answers with one frame, DATA[0] = 0xA1.")
        .host(VECTORS),
    Clause::new("RMD-A1-06", "DATA[1] of the reply is the motor temperature, int8, 1 °C a digit.")
        .host(VECTORS),
    Clause::new("RMD-A1-07", "DATA[2] and DATA[3] of the reply are the torque current, int16, low byte first, ±2048 digits for ±33 A.")
        .host(VECTORS),
    Clause::new("RMD-A1-08", "DATA[4] and DATA[5] of the reply are the speed, int16, low byte first, 1 °/s a digit.")
        .host(VECTORS),
    Clause::new("RMD-A1-09", "DATA[6] and DATA[7] of the reply are the encoder position, uint16, low byte first, within the encoder's width.")
        .host(VECTORS),

    Clause::new("RMD-A2-01", "The host commands a speed with DATA[0] = 0xA2 and the speed in DATA[4] to DATA[7], int32, low byte first; the other bytes are NULL.")
        .host(REQUESTS),
    Clause::new("RMD-A2-02", "One digit is 0.01 °/s.")
        .host(VECTORS),
    Clause::new("RMD-A2-03", "Max Torque Current of the vendor's tool limits the torque current.")
        .untested(TOOL),
    Clause::new("RMD-A2-04", "The acceleration limit applies."),
    Clause::new("RMD-A2-05", "The motor answers with one frame, DATA[0] = 0xA2.")
        .host(VECTORS),
    Clause::new("RMD-A2-06", "DATA[1] of the reply is the motor temperature, int8, 1 °C a digit.")
        .host(VECTORS),
    Clause::new("RMD-A2-07", "DATA[2] and DATA[3] of the reply are the torque current, int16, low byte first, ±2048 digits for ±33 A.")
        .host(VECTORS),
    Clause::new("RMD-A2-08", "DATA[4] and DATA[5] of the reply are the speed, int16, low byte first, 1 °/s a digit.")
        .host(VECTORS),
    Clause::new("RMD-A2-09", "DATA[6] and DATA[7] of the reply are the encoder position, uint16, low byte first, within the encoder's width.")
        .host(VECTORS),

    Clause::new("RMD-A3-01", "The host commands a multi-turn position with DATA[0] = 0xA3 and the angle in DATA[4] to DATA[7], int32, low byte first (SPEC-NOTES R5); the other bytes are NULL.")
        .host(REQUESTS),
    Clause::new("RMD-A3-02", "One digit is 0.01°, counted as 0x92 does.")
        .host(VECTORS),
    Clause::new("RMD-A3-03", "The motor turns in the direction of the difference between target and present angle."),
    Clause::new("RMD-A3-04", "Max Angle of the vendor's tool limits the angle (SPEC-NOTES R27).")
        .untested(TOOL),
    Clause::new("RMD-A3-05", "Max Speed of the vendor's tool limits the speed.")
        .host(&["a_command_without_a_speed_is_refused_while_speed_is_limited"])
        .untested(TOOL),
    Clause::new("RMD-A3-06", "The acceleration limit applies."),
    Clause::new("RMD-A3-07", "Max Torque Current of the vendor's tool limits the torque current.")
        .untested(TOOL),
    Clause::new("RMD-A3-08", "The motor answers with one frame, DATA[0] = 0xA3.")
        .host(VECTORS),
    Clause::new("RMD-A3-09", "DATA[1] of the reply is the motor temperature, int8, 1 °C a digit.")
        .host(VECTORS),
    Clause::new("RMD-A3-10", "DATA[2] and DATA[3] of the reply are the torque current, int16, low byte first, ±2048 digits for ±33 A.")
        .host(VECTORS),
    Clause::new("RMD-A3-11", "DATA[4] and DATA[5] of the reply are the speed, int16, low byte first, 1 °/s a digit.")
        .host(VECTORS),
    Clause::new("RMD-A3-12", "DATA[6] and DATA[7] of the reply are the encoder position, uint16, low byte first, within the encoder's width.")
        .host(VECTORS),

    Clause::new("RMD-A4-01", "The host commands a multi-turn position with DATA[0] = 0xA4, NULL in DATA[1], a maximum speed in DATA[2] and DATA[3], uint16, and the angle in DATA[4] to DATA[7], int32, low byte first (SPEC-NOTES R5).")
        .host(&["position_limited_is_laid_out_by_the_first_column"]),
    Clause::new("RMD-A4-02", "One digit of the angle is 0.01°, counted as 0x92 does.")
        .host(VECTORS),
    Clause::new("RMD-A4-03", "The motor turns in the direction of the difference between target and present angle."),
    Clause::new("RMD-A4-04", "It does not exceed the maximum speed, 1 °/s a digit; with 0 it does not turn (SPEC-NOTES R13)."),
    Clause::new("RMD-A4-05", "Max Angle of the vendor's tool limits the angle (SPEC-NOTES R27).")
        .untested(TOOL),
    Clause::new("RMD-A4-06", "The acceleration limit applies."),
    Clause::new("RMD-A4-07", "Max Torque Current of the vendor's tool limits the torque current.")
        .untested(TOOL),
    Clause::new("RMD-A4-08", "The motor answers with one frame, DATA[0] = 0xA4.")
        .host(VECTORS),
    Clause::new("RMD-A4-09", "DATA[1] of the reply is the motor temperature, int8, 1 °C a digit.")
        .host(VECTORS),
    Clause::new("RMD-A4-10", "DATA[2] and DATA[3] of the reply are the torque current, int16, low byte first, ±2048 digits for ±33 A.")
        .host(VECTORS),
    Clause::new("RMD-A4-11", "DATA[4] and DATA[5] of the reply are the speed, int16, low byte first, 1 °/s a digit.")
        .host(VECTORS),
    Clause::new("RMD-A4-12", "DATA[6] and DATA[7] of the reply are the encoder position, uint16, low byte first, within the encoder's width.")
        .host(VECTORS),

    Clause::new("RMD-A5-01", "The host commands a single-turn position with DATA[0] = 0xA5, the direction in DATA[1] and the angle in DATA[4] and DATA[5], uint16, low byte first; the other bytes are NULL.")
        .host(REQUESTS),
    Clause::new("RMD-A5-02", "One digit of the angle is 0.01°, counted as 0x94 does; the range is 0 to 35999, and a larger angle is answered but not carried out (SPEC-NOTES R15).")
        .host(&["a_single_turn_command_outside_the_range_of_the_document_is_refused"]),
    Clause::new("RMD-A5-03", "With direction 0x00 the motor turns clockwise.")
        .host(VECTORS),
    Clause::new("RMD-A5-04", "With direction 0x01 the motor turns counterclockwise; any other direction is answered but not carried out (SPEC-NOTES R15).")
        .host(VECTORS),
    Clause::new("RMD-A5-05", "Repeating the command starts no further turn (SPEC-NOTES R16)."),
    Clause::new("RMD-A5-06", "Max Speed of the vendor's tool limits the speed.")
        .host(&["a_command_without_a_speed_is_refused_while_speed_is_limited"])
        .untested(TOOL),
    Clause::new("RMD-A5-07", "The acceleration limit applies."),
    Clause::new("RMD-A5-08", "Max Torque Current of the vendor's tool limits the torque current.")
        .untested(TOOL),
    Clause::new("RMD-A5-09", "The motor answers with one frame, DATA[0] = 0xA5.")
        .host(VECTORS),
    Clause::new("RMD-A5-10", "DATA[1] of the reply is the motor temperature, int8, 1 °C a digit.")
        .host(VECTORS),
    Clause::new("RMD-A5-11", "DATA[2] and DATA[3] of the reply are the torque current, int16, low byte first, ±2048 digits for ±33 A.")
        .host(VECTORS),
    Clause::new("RMD-A5-12", "DATA[4] and DATA[5] of the reply are the speed, int16, low byte first, 1 °/s a digit.")
        .host(VECTORS),
    Clause::new("RMD-A5-13", "DATA[6] and DATA[7] of the reply are the encoder position, uint16, low byte first, within the encoder's width.")
        .host(VECTORS),

    Clause::new("RMD-A6-01", "The host commands a single-turn position with DATA[0] = 0xA6, the direction in DATA[1], a maximum speed in DATA[2] and DATA[3], uint16, low byte first and the angle in DATA[4] and DATA[5], uint16, low byte first; the other bytes are NULL.")
        .host(REQUESTS),
    Clause::new("RMD-A6-02", "One digit of the angle is 0.01°, counted as 0x94 does; the range is 0 to 35999, and a larger angle is answered but not carried out (SPEC-NOTES R15).")
        .host(&["a_single_turn_command_outside_the_range_of_the_document_is_refused"]),
    Clause::new("RMD-A6-03", "With direction 0x00 the motor turns clockwise.")
        .host(VECTORS),
    Clause::new("RMD-A6-04", "With direction 0x01 the motor turns counterclockwise; any other direction is answered but not carried out (SPEC-NOTES R15).")
        .host(VECTORS),
    Clause::new("RMD-A6-05", "Repeating the command starts no further turn (SPEC-NOTES R16)."),
    Clause::new("RMD-A6-06", "It does not exceed the maximum speed, 1 °/s a digit."),
    Clause::new("RMD-A6-07", "The acceleration limit applies."),
    Clause::new("RMD-A6-08", "Max Torque Current of the vendor's tool limits the torque current.")
        .untested(TOOL),
    Clause::new("RMD-A6-09", "The motor answers with one frame, DATA[0] = 0xA6.")
        .host(VECTORS),
    Clause::new("RMD-A6-10", "DATA[1] of the reply is the motor temperature, int8, 1 °C a digit.")
        .host(VECTORS),
    Clause::new("RMD-A6-11", "DATA[2] and DATA[3] of the reply are the torque current, int16, low byte first, ±2048 digits for ±33 A.")
        .host(VECTORS),
    Clause::new("RMD-A6-12", "DATA[4] and DATA[5] of the reply are the speed, int16, low byte first, 1 °/s a digit.")
        .host(VECTORS),
    Clause::new("RMD-A6-13", "DATA[6] and DATA[7] of the reply are the encoder position, uint16, low byte first, within the encoder's width.")
        .host(VECTORS),

    Clause::new("RMD-280-01", "The frame for several motors has the identifier 0x280; it is a standard data frame of eight bytes.")
        .host(&["the_four_torques_go_to_the_motors_one_to_four"]),
    Clause::new("RMD-280-02", "It has the torque currents of motors 1 to 4 in this order, int16 each, low byte first.")
        .host(&["the_four_torques_go_to_the_motors_one_to_four"]),
    Clause::new("RMD-280-03", "A digit is 16 mA, as in RMD-A1-02 and with the range of RMD-A1-03.")
        .host(&["four_torques_are_refused_as_a_whole"]),
    Clause::new("RMD-280-04", "It reaches motors 1 to 4 and no other.")
        .host(&["an_unexpected_reply_to_four_torques_is_not_matched_to_another_exchange"]),
    Clause::new("RMD-280-05", "Each of them answers with a standard data frame of eight bytes on 0x140 + ID.")
        .host(&["four_torques_in_one_frame_reach_their_motors_and_all_answer"]),
    Clause::new("RMD-280-06", "They answer in the order of their IDs, the smallest first.")
        .host(&["four_torques_in_one_frame_reach_their_motors_and_all_answer"]),
    Clause::new("RMD-280-07", "Each reply has the form of the reply to 0xA1.")
        .host(&["four_torques_in_one_frame_reach_their_motors_and_all_answer"]),
    Clause::new("RMD-280-08", "Encoders have 12 to 18 bits, which give the range of their values; of more than 16 bits the upper 16 are sent (SPEC-NOTES R6).")
        .host(&["there_are_seven_widths_and_14_is_the_default"]),
];
