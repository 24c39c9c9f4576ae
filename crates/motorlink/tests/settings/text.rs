//! The text of a file, and errors with their line.

use std::fmt::Debug;

use motorlink::settings::{FileError, SettingsFile, Tunable};

use super::{bench, rmd, st, text};
use crate::cut::Cut;

/// The error of a text for motor 1 of the bench's ST drive.
fn st_error(text: &str) -> FileError {
    let bench = bench();
    let (client, _) = st(&bench, Cut::Never);
    let motor = client.motor(1).unwrap();
    SettingsFile::parse(text, &motor.tuning()).unwrap_err()
}

/// The same with these lines of settings.
fn in_settings(lines: &str) -> FileError {
    st_error(&format!("[st]\nprofile = \"spec\"\n[st.settings]\n{lines}\n"))
}

#[test]
fn the_text_has_names_units_and_headings_in_a_fixed_order() {
    let bench = bench();
    let (client, _) = st(&bench, Cut::Never);
    let written = text(&client.motor(2).unwrap());
    let (head, settings) = written.split_once("[st.settings]\n").unwrap();
    assert!(head.contains("# board: "), "{head}");
    assert!(head.contains("[st]\nprofile = \"spec\"\nmotor = 2 "), "{head}");
    let first = settings.lines().take(2).collect::<Vec<_>>();
    assert_eq!(first[0], "# Registers of every drive");
    assert!(first[1].starts_with("SPEED_KP = "), "{}", first[1]);
    assert!(first[1].ends_with("# s16A/unit; Speed regulator Kp, numerator"), "{}", first[1]);
    assert!(settings.contains("they cannot be written\nSPEED_KP_DIV = 16 "), "{settings}");
    assert!(settings.contains("\n# state observer with CORDIC\nOBSERVER_CR_C1 = "), "{settings}");
    assert!(settings.contains("# The drive refuses to read:\n# OBSERVER_C1 "), "{settings}");
    assert!(!settings.contains("CONTROL_MODE") && !settings.contains("TORQUE_REF"));
    assert_eq!(text(&client.motor(2).unwrap()), written);
    assert!(written.lines().all(|line| line.chars().count() <= 100), "{written}");

    let (client, _) = rmd(&bench, Cut::Never);
    let written = text(&client.motor(4).unwrap());
    assert!(written.contains("[rmd]\nmotor = 4 "), "{written}");
    assert!(written.contains("\nposition_kp = "), "{written}");
    assert!(written.contains("# °/s²\n"), "{written}");
    assert!(written.contains("\nencoder_offset = 0\n"), "{written}");
}

/// Cuts a dump anywhere, and removes a setting.
fn every_cut_is_refused<M: Tunable<Error: Debug>>(motor: &M) {
    let (whole, tuning) = (text(motor), motor.tuning());
    let file = SettingsFile::parse(&whole, &tuning).unwrap();
    for at in (0..whole.len()).filter(|at| whole.is_char_boundary(*at)) {
        // Only what is behind the first digit of the number may be missing.
        if let Ok(part) = SettingsFile::parse(&whole[..at], &tuning) {
            assert!(
                part == file
                    && !whole[at..].trim().contains('\n')
                    && whole[..at].contains("# End: "),
                "{at}"
            );
        }
    }
    let why = |text: &str| SettingsFile::parse(text, &tuning).unwrap_err().to_string();
    let (settings, end) = whole.trim_end().rsplit_once('\n').unwrap();
    assert!(end.starts_with("# End: ") && end.contains(" settings; correct the number"), "{end}");
    assert!(why(settings).contains("the last line, such as `# End: 57 settings`, is missing"));
    let last = settings.lines().rfind(|line| line.contains(" = ")).unwrap();
    let fewer = why(&whole.replace(last, ""));
    assert!(fewer.contains("lines are missing; correct the number if that is meant"), "{fewer}");
}

#[test]
fn a_dump_that_was_cut_off_anywhere_is_refused() {
    let bench = bench();
    every_cut_is_refused(&st(&bench, Cut::Never).0.motor(1).unwrap());
    every_cut_is_refused(&rmd(&bench, Cut::Never).0.motor(1).unwrap());
}

#[test]
fn a_name_that_is_unknown_has_the_nearest_one() {
    let error = in_settings("SPEED_KP = 1\nSPEED_KII = 2");
    assert_eq!(
        error.to_string(),
        "line 5: there is no setting `SPEED_KII`; did you mean `SPEED_KI`?"
    );
    let error = in_settings("speed_kp = 1");
    assert!(error.to_string().ends_with("did you mean `SPEED_KP`?"), "{error}");
}

#[test]
fn a_register_that_is_not_a_setting_is_refused_with_the_reason() {
    let why = |line: &str| in_settings(line).problem.to_string();
    for acts in ["CONTROL_MODE", "TORQUE_REF", "PFC_DCBUS_REF", "RAMP_FINAL_SPEED"] {
        let said = format!(
            "{acts} is a register but not a setting: a write could turn the motor or charge a bus"
        );
        assert_eq!(why(&format!("{acts} = 1")), said);
    }
    assert!(why("DAC_OUT1 = 1").ends_with("it belongs to one measurement"));
    assert!(why("STATUS = 1").ends_with("it cannot be both read and written"));
}

#[test]
fn values_that_no_motor_has_are_refused_with_their_unit() {
    let why = |line: &str| in_settings(line).problem.to_string();
    assert_eq!(
        why("SPEED_KP = 32768"),
        "SPEED_KP: 32768 s16A/unit is outside -32768 to 32767 s16A/unit"
    );
    assert!(
        why("SPEED_KP = 1.5")
            .contains("between two values of the motor, which has steps of 1 s16A/unit")
    );
    assert_eq!(
        why("PFC_STARTUP_DURATION = \"1 s\""),
        "PFC_STARTUP_DURATION is \"1 s\", and not a number: write the number alone, in ms"
    );
    assert!(why("SPEED_KP = nan").contains("outside"));
    assert!(why("SPEED_KP = 0x8000").contains("32768"));
    assert!(why("SPEED_KP = true").contains("not a number"));
    assert!(why("SPEED_KP = 1e300").contains("outside"));
    assert!(why("SPEED_KP = 99999999999999999999999999").contains("outside"));
}

#[test]
fn a_file_that_was_cut_off_is_refused() {
    let begin = "[st]\nprofile = \"spec\"\n[st.settings]\n";
    // The number could have more digits.
    let said = st_error(&format!("{begin}SPEED_KI = 1\nSPEED_KP = 12")).to_string();
    assert_eq!(
        said,
        "line 5: SPEED_KP ends the file without a line end, as if the file was cut off; complete \
         the line"
    );
    assert!(st_error(begin).to_string().contains("there are no settings below `[st.settings]`"));
    let bench = bench();
    let (client, _) = st(&bench, Cut::Never);
    let motor = client.motor(1).unwrap();
    for whole in ["SPEED_KP = 12\n", "SPEED_KP = 12 # s", "SPEED_KP = 12 "] {
        SettingsFile::parse(&format!("{begin}{whole}"), &motor.tuning()).unwrap();
    }
    // Line ends and the mark of other editors.
    let text = format!("\u{feff}{begin}SPEED_KP = 12\n").replace('\n', "\r\n");
    SettingsFile::parse(&text, &motor.tuning()).unwrap();
}

#[test]
fn a_text_that_is_too_long_is_refused_at_once() {
    let text = "# x\n".repeat(SettingsFile::MAX_SIZE / 4 + 1);
    assert!(st_error(&text).to_string().contains("more than 1 MiB"));
}

#[test]
fn the_first_error_of_a_file_is_the_one_of_its_first_line() {
    let error = in_settings("SPEED_KP = 1\nZZZ = 1\nAAA = 1");
    assert_eq!((error.line, error.to_string().contains("ZZZ")), (5, true));
}

#[test]
fn a_name_that_is_there_twice_is_refused() {
    let error = in_settings("SPEED_KP = 1\nSPEED_KI = 1\nSPEED_KP = 2");
    assert_eq!(error.line, 6);
    assert!(error.to_string().contains("duplicate key"), "{error}");
}

#[test]
fn a_file_for_another_motor_is_refused() {
    let why = |text: &str| st_error(text).to_string();
    let said = why("# x\n[rmd]\nmotor = 1\n[rmd.settings]\nspeed_kp = 1\n");
    assert!(
        said.starts_with("line 2: the settings are those of a motor that speaks `rmd`"),
        "{said}"
    );
    let said = why("[st]\nprofile = \"mcsdk-5.4\"\n[st.settings]\n");
    assert!(said.starts_with("line 2: the settings are those of profile `mcsdk-5.4`"), "{said}");
    let said = why("[st]\nprofile = \"spec\"\nmotor = 2\n[st.settings]\n");
    assert!(
        said.starts_with("line 3: the settings are those of motor 2, and this is motor 1"),
        "{said}"
    );
    assert!(why("[st]\nmotor = 1\n[st.settings]\n").contains("`st.profile` is missing"));
    assert!(why("[st]\nprofile = \"spec\"\n").contains("`st.settings` is missing"));
    assert!(why("").contains("`[st]` is missing"));
    assert!(why("[st]\nprofile = 5\n").contains("`profile` has to be a text"));
    assert!(why("[st]\nprofil = \"spec\"\n").contains("did you mean `profile`?"));
    assert!(why("[st]\nprofile = \"spec\"\nsettings = 3\n").contains("has to be a table"));
    assert!(why("[st]\nprofile = \"spec\"\nmotor = \"1\"\n").contains("has to be a number"));
    assert!(why("[st\n").starts_with("line 1: "));
    assert_eq!(why("\n[[st]]\n[st.settings]\n"), "line 2: `st` has to be a table");
    assert!(
        why("[st]\nprofile = \"spec\"\n[st.settings]\n[motor]\n").contains("line 4: there is no")
    );
}

#[test]
fn an_rmd_acceleration_is_checked_as_on_the_command_line() {
    let bench = bench();
    let (client, _) = rmd(&bench, Cut::Never);
    let motor = client.motor(1).unwrap();
    let why = |line: &str| {
        let text = format!("[rmd]\n[rmd.settings]\n{line}\n");
        SettingsFile::parse(&text, &motor.tuning()).unwrap_err().to_string()
    };
    assert!(why("acceleration = -1").contains("may treat it as no limit"));
    assert!(why("acceleration = 0.2").contains("means no limit"));
    assert!(why("speed_kp = 256").contains("256 is outside 0 to 255"));
    assert!(why("profile = \"spec\"").contains("no setting `profile`"));
}
