//! The demands of the document "Motor Control Protocol".

use crate::clause::Clause;

/// A row: id, text, tests of a host, why no drive is tested.
macro_rules! clauses {
    ($( $id:literal $text:literal $(host [$($test:ident),+])? $(untested $why:literal)?; )+) => {
        &[$( Clause::new($id, $text)$(.host(&[$(stringify!($test)),+]))?$(.untested($why))?, )+]
    };
}

/// Every sentence of the document that contains a demand, in its order. The rows of its tables are
/// in their paragraphs. If the document is unclear or contradicts itself, the row of
/// docs/SPEC-NOTES.md follows in brackets.
pub static CLAUSES: &[Clause] = clauses! {
    "ST-2-01" "The master begins every exchange; a slave sends nothing without a command (S9: SDK 4.x does once, at start-up)."
        host [an_unasked_identification_is_skipped];
    "ST-2-02" "A frame carries one message.";
    "ST-2-03" "An exchange is one command and one response.";
    "ST-2-04" "A master sends the next command after it received the response to the last."
        host [only_one_exchange_is_under_way] untested "demands something of a master";

    "ST-3-01" "A frame is header, length, payload, checksum, in this order."
        host [every_request_encodes_to_its_bytes_and_decodes_from_them];
    "ST-3-02" "The low 5 bits of the header are the frame code."
        host [every_header_and_length_parses_as_the_document_says];
    "ST-3-03" "The high 3 bits of a command's header select the motor."
        host [every_request_encodes_to_its_bytes_and_decodes_from_them];
    "ST-3-04" "A drive with one motor may ignore the motor bits. But 4.1 demands that it refuses a missing motor, too; the kit follows 4.1 (S36).";
    "ST-3-05" "The length is the number of payload bytes, 0 to 128 (shipped firmware: 127).";
    "ST-3-06" "The contents of the payload depend on the frame code."
        untested "the clauses of 4.4 to 4.12 define the contents";
    "ST-3-07" "Longer payloads do not exist: such a length is answered with TIMEOUT after 25 ms of silence; shipped firmware drops it with its header (S10)."
        host [a_payload_over_128_bytes_or_a_short_buffer_is_not_encoded];

    "ST-3.1-01" "0x01 is SET_REG.";
    "ST-3.1-02" "0x02 is GET_REG.";
    "ST-3.1-03" "0x03 is EXECUTE_CMD.";
    "ST-3.1-04" "0x06 is GET_BOARD_INFO.";
    "ST-3.1-05" "0x07 is SET_RAMP.";
    "ST-3.1-06" "0x08 is GET_REVUP_DATA.";
    "ST-3.1-07" "0x09 is SET_REVUP_DATA.";
    "ST-3.1-08" "0x0A is SET_CURRENT_REF.";
    "ST-3.1-09" "0x0C is GET_FW_VERSION.";
    "ST-3.1-10" "0x0D is GET_DATA_ELEMENT, which reads a data segment (S7: a layout of our own; in shipped firmware SET_TORQUE_RAMP).";
    "ST-3.1-11" "0x0E is CONFIG_DYN_STRUCT, which chooses the registers of a data segment (S7: a layout of our own; unknown to shipped firmware).";
    "ST-3.1-12" "A positive acknowledge has the header 0xF0 (S1).";
    "ST-3.1-13" "A negative acknowledge has the header 0xFF (S1).";
    "ST-3.1-14" "Only a slave sends acknowledges. Sent as commands they address motor 7 (S1).";
    "ST-3.1-15" "Only a master sends the other codes: a slave sends only acknowledges.";
    "ST-3.1-16" "Codes outside the table are unknown (S4, S6, S8: shipped firmware has GET_MP_INFO and SET_POSITION_CMD).";

    "ST-3.2-01" "Motor bits have a meaning in commands only."
        host [a_refusal_keeps_its_code_and_the_line_unless_the_frame_was_damaged]
        untested "a reply's header is one of two whole bytes, ST-3.1-12 and ST-3.1-13";
    "ST-3.2-02" "The motor bits of a reply have no meaning: its header is 0xF0 or 0xFF for every motor (S1).";
    "ST-3.2-03" "Motors are numbered from 1 without gaps.";
    "ST-3.2-04" "Motor number 0 addresses the current motor.";
    "ST-3.2-05" "After power-on and reset the current motor is motor 1.";
    "ST-3.2-06" "A number from 1 upwards addresses that motor.";
    "ST-3.2-07" "An addressed motor becomes the current one.";
    "ST-3.2-08" "A command to a motor that does not exist is not processed.";
    "ST-3.2-09" "It is answered with BAD_MOTOR_SELECTED.";

    "ST-3.3-01" "Every frame has a checksum, commands and replies alike."
        host [every_single_bit_flip_outside_the_length_is_refused];
    "ST-3.3-02" "It includes header and length, in a sum of 16 bits."
        host [the_checksum_is_that_of_the_document];
    "ST-3.3-03" "It includes every payload byte."
        host [the_checksum_is_that_of_the_document];
    "ST-3.3-04" "High and low byte of the sum are added; the low byte of the result is the checksum."
        host [the_checksum_folds_the_high_byte_in];

    "ST-4.1-01" "A command has a code of table 1 other than the acknowledges."
        host [every_request_encodes_to_its_bytes_and_decodes_from_them];
    "ST-4.1-02" "A slave receives header and length, then the number of bytes in the length, then the checksum."
        host [every_prefix_means_more];
    "ST-4.1-03" "A master starts a timer of one second after it sent the checksum byte."
        host [the_timer_starts_when_the_request_is_out_and_lasts_a_second]
        untested "demands something of a master";
    "ST-4.1-04" "If the reply does not come in this time, the master raises an error."
        host [the_timer_starts_when_the_request_is_out_and_lasts_a_second];
    "ST-4.1-05" "After that the communication is closed; the document does not say how it opens again (S16)."
        host [a_late_reply_is_never_matched_to_another_exchange, without_recovery_a_lost_line_sends_nothing_until_it_is_reopened]
        untested "demands something of a master";
    "ST-4.1-06" "A slave compares the checksum of the received bytes with the received checksum.";
    "ST-4.1-07" "If they differ it answers BAD_CRC, and the exchange is over.";
    "ST-4.1-08" "A command that is not complete within 25 ms of its first byte is answered with TIMEOUT, and the exchange is over (S11: shipped firmware waits; S29: a byte after that starts a new command)."
        host [a_frame_that_is_not_whole_after_25_ms_is_answered_with_timeout];
    "ST-4.1-09" "The motor is checked after the whole command was received with a correct checksum.";
    "ST-4.1-10" "This check may change the current motor, for every frame code.";
    "ST-4.1-11" "Number 0 means the current motor, any other number the motor of that number.";
    "ST-4.1-12" "A motor that does not exist is answered with BAD_MOTOR_SELECTED, on a drive with one motor, too.";
    "ST-4.1-13" "A valid number other than 0 makes its motor the current one.";
    "ST-4.1-14" "At start-up the current motor is motor 1.";
    "ST-4.1-15" "The frame code is checked after the motor.";
    "ST-4.1-16" "An unknown frame code is answered with BAD_FRAME_ID, and the exchange is over.";
    "ST-4.1-17" "A known one is processed; success is answered with ACK, failure with NACK.";
    "ST-4.1-18" "Both end the exchange: the next command is accepted at once.";
    "ST-4.1-19" "The payload of an ACK and the codes of a NACK depend on the command."
        untested "the clauses of 4.4 to 4.12 define them";
    "ST-4.1-20" "Numbers are little endian."
        host [every_reply_decodes_to_its_fields_and_encodes_from_them];

    "ST-4.2-01" "A positive acknowledge is a frame with header 0xF0.";
    "ST-4.2-02" "It is sent as the answer to a command.";
    "ST-4.2-03" "It says that the command was processed successfully.";
    "ST-4.2-04" "It carries the data that the command requested, if any.";

    "ST-4.3-01" "A negative acknowledge is a frame with header 0xFF; the document's \"ACK\" is a slip.";
    "ST-4.3-02" "It is sent as the answer to a command.";
    "ST-4.3-03" "It says that the command was not processed.";
    "ST-4.3-04" "It carries one byte, the error code.";
    "ST-4.3-05" "NONE (0x00) is never sent.";
    "ST-4.3-06" "BAD_FRAME_ID (0x01): the frame code is unknown.";
    "ST-4.3-07" "SET_READ_ONLY (0x02): a register that cannot be written or is unknown.";
    "ST-4.3-08" "GET_WRITE_ONLY (0x03): a register that cannot be read or is unknown.";
    "ST-4.3-09" "WRONG_SET (0x05): a value that is not valid.";
    "ST-4.3-10" "WRONG_CMD (0x07): an unknown command, which is not executed.";
    "ST-4.3-11" "OVERRUN (0x08): bytes came faster than the drive could receive them (S30)."
        host [any_sequence_is_answered_as_the_model_does]
        untested "no sequence of bytes makes a receiver lose bytes for certain";
    "ST-4.3-12" "TIMEOUT (0x09): the frame was not complete in time.";
    "ST-4.3-13" "BAD_CRC (0x0A): the checksum was wrong.";
    "ST-4.3-14" "BAD_MOTOR_SELECTED (0x0B): there is no such motor.";
    "ST-4.3-15" "MP_NOT_ENABLED (0x0C): there is no motor profiler (S4: only shipped firmware has such commands).";
    "ST-4.3-16" "Other codes are not defined (S3)."
        host [a_refusal_keeps_its_code_and_the_line_unless_the_frame_was_damaged]
        untested "the cases of every refusal demand one code, which is a defined one";

    "ST-4.4-01" "SET_REG (0x01) writes a register.";
    "ST-4.4-02" "It carries the register's id, then the value.";
    "ST-4.4-03" "A value has 8, 16 or 32 bits, depending on the register."
        host [a_typed_write_has_the_size_that_the_profile_wants];
    "ST-4.4-04" "A slave first checks whether the register can be written.";
    "ST-4.4-05" "If so, the register gets the value, and an ACK without payload is sent.";
    "ST-4.4-06" "The size of the value is not checked: a register that can be written is written.";
    "ST-4.4-07" "Of a value that is too long the low bytes are written.";
    "ST-4.4-08" "A value that is too short leaves the other bytes undefined: its bytes are written, the others keep their old value; shipped firmware refuses it (S19).";
    "ST-4.4-09" "Both are acknowledged.";
    "ST-4.4-10" "A register that cannot be written or does not exist is answered with SET_READ_ONLY.";
    "ST-4.4-11" "Some registers exist in some builds only, those of a feature together (S27, S54)."
        host [every_register_command_and_segment_does_as_the_model_does];
    "ST-4.4-12" "Table 3, access RW: such a register is written, and read back.";
    "ST-4.4-13" "Table 3, access R: such a register is read, refuses to be written, and does not change.";
    "ST-4.4-14" "Table 3, access W: such a register refuses to be read.";
    "ST-4.4-15" "Table 3, access D: such a register can be neither read nor written, only selected for a DAC (S5).";
    "ST-4.4-16" "Table 3, types: values have the table's size and sign (S17: shipped firmware's own; S23)."
        host [every_code_register_size_and_error_has_a_vector];
    "ST-4.4-17" "Table 3, units: speeds are rpm (S12: shipped firmware keeps tenths of a hertz)."
        host [values_are_shown_with_their_unit_or_their_name];
    "ST-4.4-18" "TARGET_MOTOR is the current motor, counted from 0; a motor that does not exist is WRONG_SET (S20).";
    "ST-4.4-19" "CONTROL_MODE is 0 in torque mode and 1 in speed mode; other values change nothing (S15).";
    "ST-4.4-20" "STATUS is the state of the motor's state machine (S14)."
        host [values_are_shown_with_their_unit_or_their_name];
    "ST-4.4-21" "FLAGS are the faults: occurred in the low half, present in the high half (S14).";
    "ST-4.4-22" "DAC_OUT1 and DAC_OUT2 are ids of registers of access D; others are refused, or ignored by shipped firmware (S5).";
    "ST-4.4-23" "RAMP_FINAL_SPEED is the end of the ramp; writing it is a ramp of the last duration (S26).";
    "ST-4.4-24" "A SET_REG without a register is refused (S18).";
    "ST-4.4-25" "IQ_SPEEDMODE is the Id reference of speed mode (S22).";
    "ST-4.4-26" "Table 3, units: BUS_VOLTAGE is in V."
        host [values_are_shown_with_their_unit_or_their_name];
    "ST-4.4-27" "Table 3, units: HEATS_TEMP is in °C (S23)."
        host [values_are_shown_with_their_unit_or_their_name];
    "ST-4.4-28" "Table 3, units: MOTOR_POWER is in W (S23)."
        host [values_are_shown_with_their_unit_or_their_name];
    "ST-4.4-29" "Table 3, units: FLUXWK_BUS and FLUXWK_BUS_MEAS are in % (S12: shipped firmware has tenths)."
        host [values_are_shown_with_their_unit_or_their_name];
    "ST-4.4-30" "Table 3, units: MAX_APP_SPEED and MIN_APP_SPEED are in rpm, without a sign.";
    "ST-4.4-31" "TORQUE_REF is the Iq reference, FLUX_REF the Id reference, in s16A; at rest both have their last commanded values (S48).";
    "ST-4.4-32" "Table 3, synonyms: I_Q, I_D, I_Q_REF and I_D_REF are TORQUE_MEAS, FLUX_MEAS, TORQUE_REF and FLUX_REF (S7: read in a data segment).";
    "ST-4.4-33" "PFC_ENABLED is 1 while the PFC is enabled, and 0 otherwise (S50).";
    "ST-4.4-34" "Table 3, units: PFC_DCBUS_REF and PFC_DCBUS_MEAS are in V.";
    "ST-4.4-35" "Table 3, units: PFC_ACBUS_FREQ is in tenths of a hertz (S28).";
    "ST-4.4-36" "Table 3, units: PFC_ACBUS_RMS is in V, from zero to peak (S37).";
    "ST-4.4-37" "Table 3, units: PFC_STARTUP_DURATION is in ms."
        untested "no register shows the end of a PFC's start-up";
    "ST-4.4-38" "PFC_STATUS and PFC_FAULTS are state and faults of the PFC (S28)."
        untested "the document does not list their values";
    "ST-4.4-39" "Table 3, units: s16A, s16V, s16degree, s16speed, dpp and their combinations are fractions of a full scale."
        untested "the full scale is not on the wire";

    "ST-4.5-01" "GET_REG reads a register; its code is 0x02, as table 1 has it (S2).";
    "ST-4.5-02" "It carries the register's id.";
    "ST-4.5-03" "A slave first checks whether the register can be read.";
    "ST-4.5-04" "If so its value is sent in an ACK.";
    "ST-4.5-05" "The value has 8, 16 or 32 bits, depending on the register (S17)."
        host [shipped_firmware_differs_from_table_3_in_sizes_and_access];
    "ST-4.5-06" "A register that cannot be read or does not exist is answered with GET_WRITE_ONLY.";
    "ST-4.5-07" "A GET_REG without a register is refused (S18).";

    "ST-4.6-01" "EXECUTE_CMD executes a command; its code is 0x03, as table 1 has it (S2).";
    "ST-4.6-02" "It carries the command's id.";
    "ST-4.6-03" "An unknown command is answered with WRONG_CMD.";
    "ST-4.6-04" "A known one is executed, and an ACK without payload is sent.";
    "ST-4.6-05" "If the execution fails, WRONG_CMD is sent.";
    "ST-4.6-06" "Commands take no parameters: further bytes are ignored (S35), and a message without an id is refused (S18).";
    "ST-4.6-07" "START_MOTOR starts the motor.";
    "ST-4.6-08" "START_MOTOR does nothing to a motor that is started already.";
    "ST-4.6-09" "START_MOTOR does nothing in an error state.";
    "ST-4.6-10" "START_MOTOR never fails (S31).";
    "ST-4.6-11" "STOP_MOTOR stops the motor.";
    "ST-4.6-12" "STOP_MOTOR does nothing to a motor that is at rest already; the document's \"started\" is a slip (S34).";
    "ST-4.6-13" "STOP_MOTOR never fails.";
    "ST-4.6-14" "STOP_RAMP ends the current ramp at its present speed.";
    "ST-4.6-15" "STOP_RAMP does nothing without a ramp.";
    "ST-4.6-16" "STOP_RAMP never fails.";
    "ST-4.6-17" "START_STOP starts a motor that is idle.";
    "ST-4.6-18" "START_STOP stops a turning motor.";
    "ST-4.6-19" "START_STOP does nothing in an error state.";
    "ST-4.6-20" "START_STOP never fails.";
    "ST-4.6-21" "FAULT_ACK acknowledges past faults if none is present.";
    "ST-4.6-22" "FAULT_ACK does nothing while a fault is present, or without a past one.";
    "ST-4.6-23" "FAULT_ACK never fails (S31).";
    "ST-4.6-24" "ENCODER_ALIGN aligns the encoder.";
    "ST-4.6-25" "ENCODER_ALIGN does nothing in a state that does not allow it.";
    "ST-4.6-26" "ENCODER_ALIGN never fails.";
    "ST-4.6-27" "IQDREF_CLEAR sets the current references to their defaults.";
    "ST-4.6-28" "IQDREF_CLEAR never fails.";
    "ST-4.6-29" "PFC_ENABLE enables a power factor correction that is not enabled.";
    "ST-4.6-30" "PFC_ENABLE does nothing to one that is enabled.";
    "ST-4.6-31" "PFC_ENABLE fails only without power factor correction.";
    "ST-4.6-32" "PFC_DISABLE disables one that is enabled; the document's \"not started\" is a slip (S34).";
    "ST-4.6-33" "PFC_DISABLE does nothing to one that is off.";
    "ST-4.6-34" "PFC_DISABLE fails only without power factor correction.";
    "ST-4.6-35" "PFC_FAULT_ACK acknowledges past faults of the power factor correction if none is present."
        host [the_pfc_faults_when_the_mains_fail_and_takes_an_acknowledge]
        untested "the kit cannot make mains fail";
    "ST-4.6-36" "PFC_FAULT_ACK does nothing while one is present, or without a past one.";
    "ST-4.6-37" "PFC_FAULT_ACK fails only without power factor correction.";
    "ST-4.6-38" "Commands outside table 4 are unknown; shipped firmware acknowledges RESET, PING and SC_STOP and needs a profiler for SC_START (S21)."
        host [commands_are_acknowledged_as_table_4_says];

    "ST-4.7-01" "GET_BOARD_INFO (0x06) asks for the version of the SDK; it carries nothing.";
    "ST-4.7-02" "GET_BOARD_INFO never fails.";
    "ST-4.7-03" "The ACK has 32 bytes.";
    "ST-4.7-04" "Three bytes are major, minor and patch version, as unsigned integers (S13: in shipped firmware digits).";
    "ST-4.7-05" "The other bytes are the name of the SDK, followed by a NUL.";
    "ST-4.7-06" "The reply does not show whether the release is a candidate."
        untested "the reply has no field for it";

    "ST-4.8-01" "SET_RAMP (0x07) programs a speed ramp of the addressed motor.";
    "ST-4.8-02" "The ramp has the speed and the duration of the message.";
    "ST-4.8-03" "In RUN it is executed at once.";
    "ST-4.8-04" "Otherwise it waits until the motor runs.";
    "ST-4.8-05" "A motor in torque mode is in speed mode when the ramp is executed (S15).";
    "ST-4.8-06" "The mode can be changed back with SET_REG.";
    "ST-4.8-07" "The speed at the end is in rpm, 32 bits with a sign.";
    "ST-4.8-08" "The duration is in ms, 16 bits without a sign.";
    "ST-4.8-09" "SET_RAMP never fails: an ACK without payload is sent.";
    "ST-4.8-10" "A message that is too short is refused and changes nothing (S18).";

    "ST-4.9-01" "GET_REVUP_DATA (0x08) asks for a phase of the rev-up.";
    "ST-4.9-02" "It carries the phase, 0 to 4; any other phase is WRONG_SET (S24).";
    "ST-4.9-03" "The speed at the end of the phase is in rpm, 32 bits with a sign.";
    "ST-4.9-04" "The torque is in s16A, 16 bits with a sign.";
    "ST-4.9-05" "The duration is in ms, 16 bits without a sign.";
    "ST-4.9-06" "GET_REVUP_DATA never fails: the ACK carries these three, in this order."
        host [every_reply_decodes_to_its_fields_and_encodes_from_them];
    "ST-4.9-07" "It is answered for motors with and without a sensor.";
    "ST-4.9-08" "A message without a phase is refused (S18).";

    "ST-4.10-01" "SET_REVUP_DATA (0x09) sets a phase of the rev-up.";
    "ST-4.10-02" "The data apply to the phase of the message only.";
    "ST-4.10-03" "The phase is 0 to 4; any other phase is WRONG_SET (S24).";
    "ST-4.10-04" "The speed is in rpm, 32 bits with a sign.";
    "ST-4.10-05" "The torque is in s16A, 16 bits with a sign.";
    "ST-4.10-06" "The duration is in ms, 16 bits without a sign.";
    "ST-4.10-07" "SET_REVUP_DATA never fails: an ACK without payload is sent.";
    "ST-4.10-08" "A message that is too short is refused and changes nothing (S18).";

    "ST-4.11-01" "SET_CURRENT_REF sets the Iq and Id references; its code is 0x0A, as table 1 has it (S2).";
    "ST-4.11-02" "The references have the values of the message.";
    "ST-4.11-03" "In RUN they are applied at once (S25).";
    "ST-4.11-04" "Otherwise they wait until the motor runs.";
    "ST-4.11-05" "Iq comes first, then Id, 16 bits with a sign each.";
    "ST-4.11-06" "SET_CURRENT_REF never fails: an ACK without payload is sent.";
    "ST-4.11-07" "A message that is too short is refused and changes nothing (S18).";

    "ST-4.12-01" "GET_FW_VERSION (0x0C) asks for the version of the firmware.";
    "ST-4.12-02" "It carries nothing and never fails.";
    "ST-4.12-03" "The ACK has 32 bytes.";
    "ST-4.12-04" "They are a text followed by a NUL.";
    "ST-4.12-05" "The text is the firmware's name, a tab, \"Ver.\" and three numbers separated by points (S13).";
    "ST-4.12-06" "The major version is 1 or more.";
    "ST-4.12-07" "The minor version is 0 or more.";
    "ST-4.12-08" "The patch number is 0 or more.";
    "ST-4.12-09" "A pre-release follows a hyphen: A, B or RC.";
    "ST-4.12-10" "It is followed by a number of 1 or more.";
};
