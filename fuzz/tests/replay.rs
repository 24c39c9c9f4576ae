//! Runs every target with its seeds and with earlier findings.

use std::fs;
use std::path::Path;

use motorlink_fuzz::{TARGETS, run, seeds};

/// Each target needs its program and its line in Cargo.toml to be fuzzed.
#[test]
fn every_target_has_a_fuzzer() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzzers");
    let manifest = fs::read_to_string(root.join("Cargo.toml")).expect("it can be read");
    let programs = fs::read_dir(root.join("fuzz_targets")).expect("it can be listed");
    for (target, _) in TARGETS {
        let program = fs::read_to_string(root.join(format!("fuzz_targets/{target}.rs")))
            .unwrap_or_else(|error| panic!("the program of {target}: {error}"));
        assert!(program.contains(&format!("motorlink_fuzz::run(\"{target}\", data)")), "{target}");
        assert!(manifest.contains(&format!("path = \"fuzz_targets/{target}.rs\"")), "{target}");
    }
    assert_eq!(programs.count(), TARGETS.len(), "a program in fuzz_targets is not a target");
}

#[test]
fn every_target_stands_its_seeds() {
    for (target, _) in TARGETS {
        let seeds = seeds::of(target);
        assert!(!seeds.is_empty(), "{target} has no seeds");
        for seed in &seeds {
            run(target, seed);
            // Shortened and damaged seeds are seeds as well.
            for at in (0..seed.len()).step_by(seed.len() / 8 + 1) {
                run(target, &seed[..at]);
                let mut damaged = seed.clone();
                damaged[at] ^= 0x11;
                run(target, &damaged);
            }
        }
    }
}

#[test]
fn every_target_stands_what_was_found() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("regressions");
    for entry in fs::read_dir(folder).expect("the folder is in the repository") {
        let path = entry.expect("it can be listed").path();
        let target = path.file_name().and_then(|name| name.to_str()).expect("a target's name");
        for found in fs::read_dir(&path).expect("it can be listed") {
            let file = found.expect("it can be listed").path();
            println!("{}", file.display());
            run(target, &fs::read(&file).expect("it can be read"));
        }
    }
}

/// A single extreme number is too rare for a fuzzer to find.
#[test]
fn a_configuration_with_an_extreme_value_is_refused_or_runs() {
    let extremes = ["inf", "nan", "-1e38", "1e-38", "0.0", "0", "-1", "65535"];
    // The example, an RMD motor, and an ST motor: the other ST motor has the same members.
    for seed in seeds::of("sim_config").into_iter().take(3) {
        let text = String::from_utf8(seed).expect("a configuration is text");
        let lines: Vec<&str> = text.lines().collect();
        for (n, line) in lines.iter().enumerate() {
            let Some((key, _)) = line.split_once(" = ") else { continue };
            for value in extremes {
                let changed = format!("{key} = {value}");
                let mut lines = lines.clone();
                lines[n] = &changed;
                println!("{changed}");
                run("sim_config", lines.join("\n").as_bytes());
            }
        }
    }
}
