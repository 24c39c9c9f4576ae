//! Command lines that are invalid: each error says what to write, and no suggestion turns a motor.

use std::ffi::OsString;

/// What turns a motor, lets it turn, or wears it.
const MOVING: &str = "start start-stop ramp torque-ramp current-reference current position move set raw \
    encoder-align torque torque4 speed single-turn-position run zero encoder-offset --full-turn --spin \
    --prove --write-rom --start --max-speed --power-cycle --fault-on";

const NO_UNIT: &str = "the unit is missing: write 100ms or 100s";

/// The error of a command line.
fn message(line: &str) -> String {
    let words = std::iter::once("motorlink").chain(line.split(' ')).map(OsString::from);
    match crate::parse(words.collect()) {
        Ok(_) => panic!("`{line}` is valid"),
        Err(error) => {
            assert_eq!(error.exit_code(), 2, "{line}");
            error.to_string()
        }
    }
}

/// Each command line is answered with these words.
fn all_say(lines: &[(&str, &str)]) {
    for (line, words) in lines {
        let message = message(line);
        assert!(message.contains(words), "{line}: {message}");
    }
}

#[test]
fn an_invalid_command_line_is_answered_with_what_to_write() {
    all_say(&[
        ("-p sim: st status", "write options behind the protocol: motorlink st -p PORT status"),
        ("st ./st0 status", "write the port as -p ./st0"),
        ("guard st /dev/ttyACM0", "write the port as -p /dev/ttyACM0"),
        ("status", "write the protocol first"),
        ("scan", "write the protocol first"),
        ("version", "`motorlink --help` lists the commands"),
        ("st -p sim: speed 1500", "`speed` is for RMD motors"),
        ("rmd -p sim: start", "`start` is for ST drives"),
        ("rmd -p sim: 2 status", "write --id 2"),
        ("rmd -p sim: status 2", "write --id 2"),
        ("st -p sim: status 2", "write --motor 2"),
        ("st -p sim: -motor 2 status", "write --motor with two dashes"),
        ("rmd -p sim: -id 2 status", "write --id with two dashes"),
        ("rmd -p sim: position 90deg", "without a unit; DEGREES is: Angle, degrees"),
        ("rmd -p sim: speed 100rpm", "without a unit; DPS is: Speed, °/s"),
        ("rmd -p sim: position 90 --max-speed 5dps", "DPS is: Maximum speed, °/s"),
        ("st -p sim: ramp 1500rpm 1s", "without a unit; RPM is: Speed at the end, rpm"),
        ("st -p sim: --baud 9600 status", "-p '/dev/ttyUSB0?baud=9600'"),
        ("rmd -p sim: --bitrate=500000 scan", "-p 'slcan:/dev/ttyACM0?bitrate=500000'"),
        ("guard st -p sim: --profile mcsdk-5.4", "a guard needs no profile"),
    ]);
}

#[test]
fn values_of_options_are_refused_with_those_that_are_valid() {
    all_say(&[
        ("st get STATUS --every 100", NO_UNIT),
        ("st --timeout 100 get STATUS", NO_UNIT),
        ("st get STATUS --every 0", "it must be 1ms to 86400s"),
        ("st get STATUS --every 10ms --count 0", "0 is not in 1.."),
        ("rmd angle --every 100", NO_UNIT),
        ("rmd --timeout 100 angle", NO_UNIT),
        ("guard st --silence 100", NO_UNIT),
        ("conformance host st --serve pty:./st0 --timeout 100 -- true", NO_UNIT),
        ("conformance host st --serve pty:./st0 --limit 100 -- true", NO_UNIT),
        ("st position 90 1s", "write 90deg or 90rad"),
        ("st position 90deg 2", "write 2ms or 2s"),
        ("st ramp 1500 70s", "give a whole number of ms"),
        ("st ramp 1000 65536", "give a whole number of ms"),
        ("st --motor 0 start", "the first motor is 1"),
        ("st --motor 0 start", "write 1"),
        ("st --motor 8 start", "motor numbers are 1 to 7"),
        ("st --full-scale=0 info", "give the current of digit 32767"),
        ("st --full-scale=x info", "such as 16.5"),
        ("st --speed-limit=-1 status", "give a number without a unit, 0 or more"),
        ("st --current-limit=nan status", "give a number without a unit, 0 or more"),
        ("rmd --speed-limit=-1 speed 1", "give a number without a unit, 0 or more"),
        ("rmd --current-limit=nan torque 1", "give a number without a unit, 0 or more"),
        ("rmd --id=0 off", "1 to 32"),
        ("rmd --id=33 off", "1 to 32"),
        ("rmd torque4 0 0 0 0 --expect 0", "1 to 32"),
        ("rmd --gear-ratio=-6 angle", "0.001 to 10000"),
        ("rmd --gear-ratio=6:1 angle", "for a gear of 6:1"),
        ("rmd --encoder-bits=19 encoder", "12 to 18 bits"),
        ("rmd --encoder-bits=14.5 encoder", "12 to 18 bits"),
        ("rmd pid 1 2 3 4 5 6 7", "no more were expected"),
        ("rmd single-turn-position 90 left", "counterclockwise (ccw)"),
        ("rmd single-turn-position 9 cw --full-turn --tolerance 1", "cannot be used"),
        ("rmd position 90 --full-turn", "--full-turn"),
        ("rmd position 90 --wait-timeout 1s", "--wait"),
        ("rmd position 90 --wait --wait-tolerance=-1", "0 or more"),
    ]);
}

#[test]
fn no_suggestion_turns_a_motor() {
    let moving: Vec<&str> = MOVING.split(' ').collect();
    let lines = "rmd set-id 2; rmd speedd 3; rmd torqe 3; rmd runn; rmd positon 3; rmd rawr 9a; rmd mov 3; \
        st startt; st rampp 3 3; st sett; st encoder-aling; st torqe-ramp 3 3; st curent 3 3; st positio 3 3; \
        rmd off --max-speed 3; rmd single-turn-position 3 cw --full-turns; rmd --write-ro zero; \
        conformance st --spinn; guard st --prov; conformance host --star x";
    for line in lines.split("; ") {
        let message = message(line);
        // Words that were typed are repeated.
        let is_of_word = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
        let suggested = message.split(|c| !is_of_word(c)).filter(|word| moving.contains(word));
        let mut suggested = suggested.filter(|word| !line.split(' ').any(|typed| typed == *word));
        assert_eq!(suggested.next(), None, "{line}: {message}");
    }
}

#[test]
fn suggestions_that_turn_no_motor_are_kept() {
    all_say(&[
        ("st statu", "'status'"),
        ("st gett SPEED_MEAS", "'get'"),
        ("rmd scn", "'scan'"),
        ("rmd stopp", "'stop'"),
        ("rmd of", "'off'"),
        ("st -p sim: get STATUS --evry 5ms", "'--every'"),
        ("portss", "'ports'"),
        ("st --jsn info", "'--json'"),
    ]);
}
