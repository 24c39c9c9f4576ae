//! Suggestions for mistyped words. No suggested command turns a motor.

use clap::Error;
use clap::error::{ContextKind, ContextValue};

/// Subcommands that are suggested for mistyped ones. They read, end motion, or need no drive.
const HARMLESS: &[&str] = &[
    "acceleration",
    "angle",
    "clear-errors",
    "completions",
    "conformance",
    "convert",
    "dbc",
    "decode",
    "demo",
    "diff",
    "dump",
    "encoder",
    "fault-ack",
    "get",
    "guard",
    "help",
    "host",
    "info",
    "json",
    "man",
    "markdown",
    "monitor",
    "off",
    "pid",
    "plot",
    "ports",
    "presets",
    "record",
    "recover",
    "replay",
    "registers",
    "revup-data",
    "rmd",
    "scan",
    "scenarios",
    "segment",
    "share",
    "sim",
    "spec",
    "st",
    "status",
    "stop",
    "stop-ramp",
    "wireshark",
    "clauses",
];

/// Options that allow motion, or that wear a motor.
const RISKY_OPTIONS: [&str; 7] =
    ["--spin", "--prove", "--full-turn", "--write-rom", "--power-cycle", "--start", "--fault-on"];

/// The error without suggestions that may turn a motor.
pub fn without_motion(mut error: Error) -> Error {
    if let Some(ContextValue::Strings(words)) = error.remove(ContextKind::SuggestedSubcommand) {
        let words: Vec<String> =
            words.into_iter().filter(|word| HARMLESS.contains(&word.as_str())).collect();
        if !words.is_empty() {
            error.insert(ContextKind::SuggestedSubcommand, ContextValue::Strings(words));
        }
    }
    let is_risky = |text: &str| RISKY_OPTIONS.iter().any(|option| text.contains(option));
    if let Some(ContextValue::String(option)) = error.get(ContextKind::SuggestedArg)
        && is_risky(option)
    {
        error.remove(ContextKind::SuggestedArg);
        // It has the option, too.
        error.remove(ContextKind::Usage);
    }
    // Such as: 'position --max-speed' exists.
    if let Some(ContextValue::StyledStrs(mut tips)) = error.remove(ContextKind::Suggested) {
        tips.retain(|tip| !tip.to_string().ends_with(" exists"));
        if !tips.is_empty() {
            error.insert(ContextKind::Suggested, ContextValue::StyledStrs(tips));
        }
    }
    error
}
