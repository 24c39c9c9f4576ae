//! Generates the enums and constants of C from proto's tables.

pub mod commands;

use std::fmt::Write;

use motorlink_proto::rmd::{COMMANDS, Errors, MOTOR_BASE, SpinDirection, TORQUE4_ID};
use motorlink_proto::st::register::{Access, Origin};
use motorlink_proto::st::{
    Command, ControlMode, ErrorCode, Feature, Flags, FrameCode, Profile, Recovery, RegisterId,
    Status,
};

/// What the numbers of an enum are.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    /// Values of a byte. The enum's name is its type.
    Byte,
    /// Bits of a sum, or constants.
    Loose,
}

/// What each profile is, and each way of recovery, in the order of proto's lists.
const PROFILES: [&str; Profile::ALL.len()] =
    ["the document as written", "what firmware of MCSDK 5.4 does on the wire"];
const RECOVERIES: [&str; Recovery::ALL.len()] = [
    "waits for silence, asks a question, continues after the answer",
    "sends bytes that complete a frame for which a 5.x drive may still wait, then as DRAIN",
    "never recovers. The line counts as in sync from the start, so that a late reply to an earlier \
     program is taken for the reply to the first request. After a failure it is out of sync until \
     `motorlink_st_master_trust_line` is called",
];

pub fn text() -> String {
    let mut out = version();
    let plain = |prefix: &'static str, all: Vec<(u32, &'static str, String)>| {
        all.into_iter().map(move |(number, name, doc)| (format!("{prefix}_{name}"), number, doc))
    };
    macro_rules! listed {
        ($enum:ident, $docs:ident) => {
            $enum::ALL.iter().zip($docs).map(|(one, doc)| {
                let name = format!("{one:?}").to_uppercase();
                let prefix = concat!("MOTORLINK_ST_", stringify!($enum)).to_uppercase();
                (format!("{prefix}_{name}"), *one as u32, doc.to_owned())
            })
        };
    }
    group(
        &mut out,
        Kind::Byte,
        "motorlink_st_profile",
        "How a drive behaves where the document and shipped firmware differ.",
        listed!(Profile, PROFILES),
    );
    group(
        &mut out,
        Kind::Byte,
        "motorlink_st_recovery",
        "How a master recovers a line after it was opened, or after a failed exchange.",
        listed!(Recovery, RECOVERIES),
    );
    group(
        &mut out,
        Kind::Byte,
        "motorlink_st_reg",
        "Registers (table 3). A comment has access (D: for the DAC only), type and unit. Units: 32767 s16A \
         is full scale of the drive's current measurement, 32767 s16V full scale of its voltage, 65536 \
         s16degree one electrical turn.",
        registers(),
    );
    let frames = FrameCode::ALL.iter().map(|code| {
        let known = |profile| FrameCode::from_number(code.number(), profile) == Some(*code);
        let only = match (known(Profile::Spec), known(Profile::Mcsdk54)) {
            (true, false) => " (profile SPEC only)",
            (false, true) => " (profile MCSDK 5.4 only)",
            _ => "",
        };
        (u32::from(code.number()), code.name(), format!("{}{only}", code.doc()))
    });
    group(
        &mut out,
        Kind::Byte,
        "motorlink_st_frame_code",
        "Frame codes (table 1).",
        plain("MOTORLINK_ST_FRAME_CODE", frames.collect()),
    );
    macro_rules! named {
        ($enum:ident) => {
            $enum::ALL
                .iter()
                .map(|one| {
                    (u32::from(one.number()), one.name().expect("named"), one.doc().to_owned())
                })
                .collect()
        };
    }
    group(
        &mut out,
        Kind::Byte,
        "motorlink_st_command",
        "Commands (table 4).",
        plain("MOTORLINK_ST_COMMAND", named!(Command)),
    );
    group(
        &mut out,
        Kind::Byte,
        "motorlink_st_error_code",
        "Why a drive refused (table 2).",
        plain("MOTORLINK_ST_ERROR_CODE", named!(ErrorCode)),
    );
    group(
        &mut out,
        Kind::Byte,
        "motorlink_st_status",
        "Values of register STATUS.",
        plain("MOTORLINK_ST_STATUS", named!(Status)),
    );
    group(
        &mut out,
        Kind::Byte,
        "motorlink_st_control_mode",
        "Values of register CONTROL_MODE.",
        plain("MOTORLINK_ST_CONTROL_MODE", named!(ControlMode)),
    );
    let faults =
        Flags::NAMES.iter().map(|(bit, name, doc)| (u32::from(*bit), *name, (*doc).to_owned()));
    group(
        &mut out,
        Kind::Loose,
        "motorlink_st_fault",
        "Bits of register FLAGS: occurred; 16 bits to the left: present.",
        plain("MOTORLINK_ST_FAULT", faults.collect()),
    );
    let features =
        Feature::ALL.iter().filter(|feature| **feature != Feature::Core).map(|feature| {
            let name = screaming(&format!("{feature:?}"));
            (
                format!("MOTORLINK_ST_FEATURE_{name}"),
                1 << *feature as u32,
                feature.name().to_owned(),
            )
        });
    group(
        &mut out,
        Kind::Loose,
        "motorlink_st_feature",
        "What a motor's control may be built with.",
        features,
    );
    let codes = COMMANDS.iter().map(|row| {
        let name = screaming(&format!("{:?}", row.code));
        let rom = if row.rom { "; wears the ROM" } else { "" };
        (
            format!("MOTORLINK_RMD_CODE_{name}"),
            u32::from(row.code.number()),
            format!("{}{rom}", row.code.doc()),
        )
    });
    group(
        &mut out,
        Kind::Byte,
        "motorlink_rmd_code",
        "Commands (chapter 2): the first byte of request and reply.",
        codes,
    );
    let errors = Errors::NAMES.iter().map(|(bits, name, text)| {
        (format!("MOTORLINK_RMD_ERROR_{name}"), u32::from(bits.0), (*text).to_owned())
    });
    group(&mut out, Kind::Loose, "motorlink_rmd_error", "Bits of the error state.", errors);
    let spins = SpinDirection::ALL.iter().map(|spin| {
        let name = spin.name().expect("named").to_uppercase();
        (
            format!("MOTORLINK_RMD_SPIN_DIRECTION_{name}"),
            u32::from(spin.number()),
            spin.doc().to_owned(),
        )
    });
    group(
        &mut out,
        Kind::Byte,
        "motorlink_rmd_spin_direction",
        "Which way to turn to an angle within the turn.",
        spins,
    );
    let ids = [
        (
            "MOTORLINK_RMD_MOTOR_BASE".to_owned(),
            u32::from(MOTOR_BASE),
            "request and reply of the motor with ID n have the identifier n above this".to_owned(),
        ),
        (
            "MOTORLINK_RMD_TORQUE4_ID".to_owned(),
            u32::from(TORQUE4_ID),
            "torque currents for motors 1 to 4".to_owned(),
        ),
    ];
    group(&mut out, Kind::Loose, "motorlink_rmd_can_id", "CAN identifiers.", ids.into_iter());
    out
}

fn version() -> String {
    let mut out =
        String::from("/** Version of this header. `motorlink_version` tells the library's. */\n");
    for (part, number) in [
        ("_MAJOR", env!("CARGO_PKG_VERSION_MAJOR")),
        ("_MINOR", env!("CARGO_PKG_VERSION_MINOR")),
        ("_PATCH", env!("CARGO_PKG_VERSION_PATCH")),
    ] {
        writeln!(out, "#define MOTORLINK_VERSION{part} {number}").expect("a string");
    }
    let text = env!("CARGO_PKG_VERSION");
    out + &format!("/** The same as text. */\n#define MOTORLINK_VERSION \"{text}\"\n\n")
}

fn registers() -> impl Iterator<Item = (String, u32, String)> {
    RegisterId::all().map(|id| {
        let (shape, text) = (id.shape().expect("in the table"), id.text().expect("in the table"));
        let access = match shape.access {
            Access::ReadWrite => "RW",
            Access::ReadOnly => "R",
            Access::WriteOnly => "W",
            Access::Dac => "D",
            Access::Never => "-",
        };
        let [ty, mcsdk] = [Profile::Spec, Profile::Mcsdk54].map(|profile| shape.ty(profile).name());
        let mut doc = format!("{access:<2} {ty}");
        if !shape.unit.symbol().is_empty() {
            write!(doc, " {}", shape.unit.symbol()).expect("a string");
        }
        write!(doc, ": {}", text.doc).expect("a string");
        if shape.origin == Origin::Firmware {
            doc.push_str(" (firmware only)");
        }
        let [unit, mcsdk_unit] = Profile::ALL.map(|profile| shape.unit.symbol_in(profile));
        if mcsdk_unit != unit {
            write!(doc, " (mcsdk-5.4: {mcsdk_unit})").expect("a string");
        }
        if mcsdk != ty {
            write!(doc, " (mcsdk-5.4: {mcsdk})").expect("a string");
        }
        (format!("MOTORLINK_ST_REG_{}", text.name), u32::from(id.0), doc)
    })
}

fn group(
    out: &mut String,
    kind: Kind,
    name: &str,
    doc: &str,
    rows: impl Iterator<Item = (String, u32, String)>,
) {
    let rows: Vec<_> = rows.collect();
    let wide = rows.iter().map(|(name, ..)| name.len()).max().unwrap_or(0);
    let digits = if rows.iter().any(|row| row.1 > 0xFF) { 4 } else { 2 };
    let (size, ty) = match kind {
        Kind::Byte => (SIZE, TYPE.replace("NAME", name)),
        Kind::Loose => ("", String::new()),
    };
    writeln!(out, "/** {doc} */\nenum {name}{size} {{").expect("a string");
    for (index, (name, number, doc)) in rows.iter().enumerate() {
        let comma = if index + 1 < rows.len() { "," } else { " " };
        writeln!(out, "  {name:<wide$} = 0x{number:0digits$X}{comma} /**< {doc} */")
            .expect("a string");
    }
    writeln!(out, "}};\n{ty}").expect("a string");
}

/// Fixes the size of an enum, in the languages that can.
const SIZE: &str = "
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint8_t
#endif
";

/// The enum's name as a type, of the same size in every language.
const TYPE: &str = "#if !defined(__cplusplus) && __STDC_VERSION__ >= 202311L
typedef enum NAME NAME;
#elif !defined(__cplusplus)
typedef uint8_t NAME;
#endif
";

/// `FluxWeakening` as `FLUX_WEAKENING`, `ReadStatus` as `READ_STATUS`.
fn screaming(camel: &str) -> String {
    let mut out = String::new();
    for (index, letter) in camel.char_indices() {
        if index > 0 && !letter.is_ascii_lowercase() {
            out.push('_');
        }
        out.push(letter.to_ascii_uppercase());
    }
    out
}
