//! `motorlink st registers`: the table of registers.

use clap::builder::PossibleValue;
use console::Term;
use motorlink::st::register::{Access, Origin};
use motorlink::st::{Feature, Profile, RegisterId};
use serde_json::{Value, json};

use crate::failure::Failure;
use crate::hint;
use crate::output::{Printer, print_line};
use crate::text::{flow, is_like};

/// Which registers.
#[derive(clap::Args)]
pub struct Filter {
    /// Only registers with this in their name; * and ? match any text and any letter
    #[arg(value_name = "NAME", value_parser = hint::register(), hide_possible_values = true)]
    names: Vec<String>,
    /// Only registers of this access, or of several, such as R,RW
    #[arg(long, value_name = "ACCESS", value_delimiter = ',', ignore_case = true, value_parser = accesses(),
          allow_hyphen_values = true)]
    access: Vec<String>,
    /// Only registers of drives that are built with this
    #[arg(long, value_name = "FEATURE", value_delimiter = ',', value_parser = features())]
    feature: Vec<String>,
}

fn accesses() -> clap::builder::PossibleValuesParser {
    Access::ALL.map(|access| PossibleValue::new(access.name()).help(access.doc())).into()
}

fn features() -> clap::builder::PossibleValuesParser {
    let feature = |&feature: &Feature| PossibleValue::new(feature.word()).help(feature.name());
    Feature::ALL.iter().map(feature).collect::<Vec<_>>().into()
}

impl Filter {
    fn takes(&self, name: &str, access: Access, feature: Feature) -> bool {
        let is_named = |pattern: &String| matches(&pattern.to_uppercase(), name);
        let has = |words: &[String], own: &str| {
            words.is_empty() || words.iter().any(|word| word.eq_ignore_ascii_case(own))
        };
        (self.names.is_empty() || self.names.iter().any(is_named))
            && has(&self.access, access.name())
            && has(&self.feature, &feature.word())
    }
}

/// Whether a name matches a pattern with `*` and `?`, or has it in it where it has neither.
fn matches(pattern: &str, name: &str) -> bool {
    match pattern.contains(['*', '?']) {
        true => is_like(pattern, name),
        false => name.contains(pattern),
    }
}

/// Where the meaning of a register begins.
const MEANING: usize = 55;

pub fn list(output: Printer, filter: &Filter) -> Result<(), Failure> {
    let mut shown = 0;
    let mut has_profile = false;
    for id in RegisterId::all() {
        let (Some(shape), Some(text)) = (id.shape(), id.text()) else { continue };
        let (access, name) = (shape.access, text.name);
        if !filter.takes(name, access, shape.feature) {
            continue;
        }
        if shown == 0 && !output.json {
            print_line(&row(["id", "name", "type", "access", "unit"], "meaning"))?;
        }
        shown += 1;
        let is_firmware = shape.origin == Origin::Firmware;
        let mcsdk_profile = Profile::Mcsdk54.name();
        let (unit, access) = (shape.unit.symbol(), access.name());
        let [ty, mcsdk] = [Profile::Spec, Profile::Mcsdk54].map(|profile| shape.ty(profile).name());
        let mut meaning = text.doc.to_owned();
        if is_firmware {
            meaning += &format!(" ({mcsdk_profile})");
        }
        if ty != mcsdk {
            meaning += &format!(" ({mcsdk_profile}: {mcsdk})");
        }
        has_profile |= is_firmware || ty != mcsdk;
        output.result(
            row([&format!("{:#04x}", id.0), name, ty, access, unit], &meaning),
            json!({
                "id": id.0, "name": name, "type": ty, "mcsdk_type": mcsdk, "access": access, "unit": unit,
                "feature": shape.feature.name(), "doc": text.doc,
                "profile": if is_firmware { mcsdk_profile.into() } else { Value::Null },
            }),
        )?;
    }
    if shown == 0 {
        return Err(Failure::usage("no register matches")
            .trying("`motorlink st registers` without a filter lists all"));
    }
    if output.json { Ok(()) } else { legend(has_profile) }
}

/// A line of the table; the meaning is wrapped in its own column on a terminal.
fn row([id, name, ty, access, unit]: [&str; 5], meaning: &str) -> String {
    let columns = Term::stdout().size_checked().map_or(usize::MAX, |(_, columns)| columns.into());
    let room = columns.saturating_sub(MEANING);
    let meaning = flow(meaning.split(' '), " ", "", room).join(&format!("\n{:MEANING$}", ""));
    format!("{id:<4}  {name:<21}  {ty:<4}  {access:<6}  {unit:<10}  {meaning}")
}

fn legend(has_profile: bool) -> Result<(), Failure> {
    print_line(&"\nAccess:")?;
    for access in Access::ALL {
        print_line(&format!("  {:<2}  {}", access.name(), access.doc()))?;
    }
    if has_profile {
        let profile = Profile::Mcsdk54.name();
        print_line(&format!("({profile}): only with --profile {profile}"))?;
        print_line(&format!("({profile}: i16): with that profile the type is i16"))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pattern_is_a_part_of_a_name_or_a_glob_for_all_of_it() {
        for pattern in ["SPEED", "_MEAS", "*_MEAS", "SPEED*", "S?EED_*S", "*", "*SPEED_MEAS*"] {
            assert!(matches(pattern, "SPEED_MEAS"), "{pattern}");
        }
        for pattern in ["TORQUE", "*SPEED", "?SPEED_MEAS", "SPEED?", "SPEED_MEAS_"] {
            assert!(!matches(pattern, "SPEED_MEAS"), "{pattern}");
        }
    }

    #[test]
    fn every_line_but_its_meaning_fits_its_columns() {
        for id in RegisterId::all() {
            let (shape, text) = (id.shape().unwrap(), id.text().unwrap());
            let line = row(["0x00", text.name, "u32", "RW", shape.unit.symbol()], text.doc);
            let meaning = line.chars().skip(MEANING).collect::<String>();
            assert_eq!(meaning, text.doc, "{line}");
        }
    }
}
