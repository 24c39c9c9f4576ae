//! Examples of every command. The tests run each of them on simulated drives.

/// What an example begins with.
pub const PROGRAM: &str = "motorlink ";

/// The examples of a command, such as `st get`.
pub fn of(path: &str) -> impl Iterator<Item = &'static str> {
    EXAMPLES.iter().filter(move |(own, _)| *own == path).map(|(_, example)| *example)
}

/// A command and a command line of it.
const EXAMPLES: &[(&str, &str)] = &[
    ("", "sim --st pty:./st0 --rmd slcan-pty:./can0"),
    ("", "st -p ./st0 status"),
    ("", "rmd -p slcan:./can0 scan"),
    ("demo", "demo"),
    ("sim", "sim --st pty:./st0 --rmd slcan-pty:./can0"),
    ("sim run", "sim run scenarios/position-moves.toml --csv run.csv"),
    ("sim run", "sim run scenarios/position-moves.toml --mcap run.mcap"),
    ("sim presets", "sim presets"),
    ("guard", "guard st -p ./st0 --serve pty:./drive"),
    ("guard st", "guard st -p ./st0 --serve pty:./drive"),
    ("guard st", "guard st -p ./st0 --serve pty:./drive --silence 2s"),
    ("guard rmd", "guard rmd -p slcan:./can0 --serve slcan-pty:./bus"),
    ("guard rmd", "guard rmd -p slcan:./can0 --prove --spin 100"),
    ("watch", "watch -p ./st0 -p slcan:./can0"),
    ("watch", "watch -p slcan:./can0 --id 1-4 --rate 50 --gear-ratio 6"),
    ("watch", "watch -p ./st0 --motor 1 --full-scale 16.5"),
    ("record", "record -p ./st0 -p slcan:./can0 -o run.mcap --duration 3s"),
    ("record", "record -p ./st0 -o run.mcap SPEED_MEAS --duration 2s"),
    ("record", "record -p ./st0 -o run.mcap --rotate 100MB --duration 1s"),
    ("decode", "decode rmd 141#9A1900F000000009"),
    ("decode st", "decode st 22 01 1e 41 f0 04 ce 07 00 00 ca"),
    ("decode st", "decode st capture.pcapng --profile mcsdk-5.4"),
    ("decode rmd", "decode rmd 141#9A1900F000000009"),
    ("decode rmd", "decode rmd --id 1 9a 19 00 f0 00 00 00 09"),
    ("decode rmd", "decode rmd can0.log --csv"),
    ("info", "info run.mcap"),
    ("info", "info run.mcap --settings st0/motor1"),
    ("recover", "recover run.mcap"),
    ("recover", "recover run.mcap -o fixed.mcap"),
    ("convert", "convert run.mcap run.csv"),
    ("convert", "convert run.mcap - --signals SPEED_MEAS --unix"),
    ("plot", "plot run.mcap -o run.svg"),
    ("plot", "plot run.mcap --signals SPEED_MEAS --to 1.5 -o run.svg"),
    ("share", "share -p ./st0 -p slcan:./can0 --at unix:./share"),
    ("share", "share -p ./st0 --at unix:./share --json"),
    ("share", "share -p sim: --at unix:./share"),
    ("share stop", "share stop --at unix:./share"),
    ("share latch", "share latch --at unix:./share"),
    ("share release", "share release --at unix:./share"),
    ("node", "node -p ./st0 -p slcan:./can0 --name arm1"),
    ("node", "node -p sim: --name arm1 --json"),
    ("node", "node -p sim: --name arm1 --ros2"),
    ("fleet", "fleet list"),
    ("fleet", "fleet stop-all"),
    ("fleet list", "fleet list"),
    ("fleet list", "fleet list --json"),
    ("fleet watch", "fleet watch --once"),
    ("fleet watch", "fleet watch --once --by-node"),
    ("fleet record", "fleet record -o fleet.mcap --duration 1s"),
    ("fleet command", "fleet command -- st get SPEED_MEAS"),
    ("fleet command", "fleet command -- rmd clear-errors"),
    ("fleet settings", "fleet settings diff --name /rmd0/"),
    ("fleet settings diff", "fleet settings diff --name /rmd0/"),
    ("fleet stop-all", "fleet stop-all"),
    ("fleet stop-all", "fleet stop-all --node arm1"),
    ("fleet latch", "fleet latch"),
    ("fleet release", "fleet release"),
    ("fleet init", "fleet init plant --router localhost:7450 --node arm1"),
    ("fleet init", "fleet init plant --operator alice --viewer bob"),
    ("fleet router", "fleet router --network plant/router.json5"),
    ("monitor", "monitor"),
    ("monitor", "monitor -p ./st0 -p slcan:./can0"),
    ("monitor", "monitor --share unix:./share"),
    #[cfg(feature = "fleet")]
    ("monitor", "monitor --fleet"),
    ("ports", "ports"),
    ("ports", "ports --json"),
    ("st", "st -p ./st0 info"),
    ("st", "st -p ./st0 get SPEED_MEAS FLAGS"),
    ("st info", "st -p ./st0 info"),
    ("st status", "st -p ./st0 status"),
    ("st status", "st -p ./st0 --motor 2 status --json"),
    ("st registers", "st registers"),
    ("st registers", "st registers '*_KP' --access RW"),
    ("st registers", "st registers --feature pfc"),
    ("st get", "st -p ./st0 get SPEED_MEAS BUS_VOLTAGE 0x1f"),
    ("st get", "st -p ./st0 get SPEED_MEAS --every 100ms"),
    ("st get", "st -p ./st0 get SPEED_MEAS --every 10ms --count 9 --csv run.csv"),
    ("st segment", "st -p ./st0 segment I_A I_B SPEED_MEAS"),
    ("st segment", "st -p ./st0 segment I_A I_B --every 10ms --count 9 --csv -"),
    ("st dump", "st -p ./st0 dump"),
    ("st dump", "st -p ./st0 --motor 2 dump motor2.toml --overwrite"),
    ("st diff", "st -p ./st0 --motor 2 diff motor2.toml"),
    ("st restore", "st -p ./st0 --motor 2 restore motor2.toml --dry-run"),
    ("st restore", "st -p ./st0 --motor 2 restore motor2.toml"),
    ("st scan", "st -p ./st0 scan"),
    ("st scan", "st -p ./st0 scan 115200 9600"),
    ("st set", "st -p ./st0 set SPEED_KP 800"),
    ("st set", "st -p ./st0 set SPEED_KP 800 --verify"),
    ("st set", "st -p ./st0 set DAC_OUT1 I_ALPHA"),
    ("st start", "st -p ./st0 start"),
    ("st start", "st -p ./st0 start --ramp 900 500 --speed-limit 1000"),
    ("st stop", "st -p ./st0 stop"),
    ("st start-stop", "st -p ./st0 start-stop"),
    ("st stop-ramp", "st -p ./st0 stop-ramp"),
    ("st ramp", "st -p ./st0 ramp 1500 1000"),
    ("st ramp", "st -p ./st0 ramp -1500 2000"),
    ("st revup-data", "st -p ./st0 revup-data"),
    ("st revup-data", "st -p ./st0 revup-data 1 500 200 250"),
    ("st current-reference", "st -p ./st0 current-reference 1000 0"),
    ("st torque-ramp", "st -p ./st0 --profile mcsdk-5.4 torque-ramp 1000 500"),
    ("st position", "st -p ./st0 --profile mcsdk-5.4 position 90deg 2s"),
    ("st fault-ack", "st -p ./st0 fault-ack"),
    ("st encoder-align", "st -p ./st0 encoder-align"),
    ("st iqdref-clear", "st -p ./st0 iqdref-clear"),
    ("st pfc", "st -p ./st0 pfc enable"),
    ("st raw", "st -p ./st0 raw 02 1e"),
    ("rmd", "rmd -p slcan:./can0 scan"),
    ("rmd", "rmd -p slcan:./can0 --id 2 status"),
    ("rmd scan", "rmd -p slcan:./can0 scan"),
    ("rmd scan", "rmd -p slcan:./can0 scan 1 2"),
    ("rmd status", "rmd -p slcan:./can0 --id 2 status"),
    ("rmd status", "rmd -p slcan:./can0 status --every 100ms"),
    ("rmd angle", "rmd -p slcan:./can0 angle"),
    ("rmd angle", "rmd -p slcan:./can0 angle --every 10ms --count 9 --csv run.csv"),
    ("rmd dump", "rmd -p slcan:./can0 dump"),
    ("rmd dump", "rmd -p slcan:./can0 --id 2 dump motor2.toml --overwrite"),
    ("rmd diff", "rmd -p slcan:./can0 --id 2 diff motor2.toml"),
    ("rmd restore", "rmd -p slcan:./can0 --id 2 restore motor2.toml --dry-run"),
    ("rmd restore", "rmd -p slcan:./can0 --id 2 restore motor2.toml --write-rom"),
    ("rmd pid", "rmd -p slcan:./can0 pid"),
    ("rmd pid", "rmd -p slcan:./can0 pid speed_kp=120 speed_ki=20"),
    ("rmd pid", "rmd -p slcan:./can0 pid 100 100 120 20 100 100 --write-rom"),
    ("rmd acceleration", "rmd -p slcan:./can0 acceleration"),
    ("rmd acceleration", "rmd -p slcan:./can0 acceleration 2000"),
    ("rmd encoder", "rmd -p slcan:./can0 encoder"),
    ("rmd encoder-offset", "rmd -p slcan:./can0 encoder-offset 1024 --write-rom"),
    ("rmd zero", "rmd -p slcan:./can0 zero --write-rom"),
    ("rmd off", "rmd -p slcan:./can0 --id 2 off"),
    ("rmd stop", "rmd -p slcan:./can0 stop --all"),
    ("rmd run", "rmd -p slcan:./can0 run"),
    ("rmd torque", "rmd -p slcan:./can0 torque 0.5"),
    ("rmd speed", "rmd -p slcan:./can0 speed 360"),
    ("rmd speed", "rmd -p slcan:./can0 speed 360 --speed-limit 720"),
    ("rmd position", "rmd -p slcan:./can0 position 90 --max-speed 360"),
    ("rmd position", "rmd -p slcan:./can0 position 90 --max-speed 360 --wait"),
    ("rmd single-turn-position", "rmd -p slcan:./can0 single-turn-position 90 cw"),
    ("rmd clear-errors", "rmd -p slcan:./can0 clear-errors"),
    ("rmd torque4", "rmd -p slcan:./can0 torque4 0.1 0.1 0 0"),
    ("rmd torque4", "rmd -p slcan:./can0 torque4 0.1 0.1 0 0 --expect 1,2"),
    ("rmd raw", "rmd -p slcan:./can0 raw 9a"),
    ("replay", "replay run.mcap --serve pty:./replayed"),
    ("replay", "replay run.mcap --serve st0=pty:./replayed --speed max --strict"),
    ("conformance st", "conformance st -p ./st0 --only ST-4.5"),
    ("conformance rmd", "conformance rmd -p slcan:./can0 --only RMD-33"),
    (
        "conformance host",
        "conformance host st --serve pty:./st1 --only late -- \\\n    motorlink st get SPEED_MEAS --every 20ms --count 4",
    ),
    ("conformance scenarios", "conformance scenarios st"),
    ("conformance clauses", "conformance clauses rmd"),
    ("spec dbc", "spec dbc --id 1-4 -o motors.dbc"),
    ("spec dbc", "spec dbc --id 1-4 --direction request -o commands.dbc"),
    ("spec json", "spec json -o tables.json"),
    ("spec markdown", "spec markdown -o tables.md"),
    ("spec wireshark", "spec wireshark -o motorlink.lua"),
    ("completions", "completions bash > motorlink.bash"),
    ("man", "man ./manual"),
];

#[cfg(test)]
mod tests {
    use clap::Command;

    use super::*;

    /// The paths of the commands that do something.
    fn leaves(command: &Command, path: &str, found: &mut Vec<String>) {
        let commands = command.get_subcommands().filter(|command| !command.is_hide_set());
        let mut is_leaf = true;
        for command in commands.filter(|command| command.get_name() != "help") {
            is_leaf = false;
            leaves(command, format!("{path} {}", command.get_name()).trim_start(), found);
        }
        if is_leaf {
            found.push(path.to_owned());
        }
    }

    #[test]
    fn every_command_has_an_example_of_its_own() {
        let mut paths = Vec::new();
        leaves(&crate::command(), "", &mut paths);
        assert!(paths.len() > 40);
        for path in &paths {
            assert!(of(path).next().is_some(), "`motorlink {path}` has no example in its help");
        }
        for (path, example) in EXAMPLES {
            let mut words = example.split_whitespace();
            let is_named = path.split(' ').filter(|word| !word.is_empty());
            assert!(
                is_named.clone().all(|word| words.any(|other| other == word)),
                "{path}: {example}"
            );
        }
    }
}
