//! The initial inputs of the fuzzers: the wire vectors in the form of each target, and the examples
//! of the documentation.

use std::path::{Path, PathBuf};

use motorlink::slcan;
use motorlink_capture::{Captured, Direction, Format, Stamp, Wire, Writer};
use motorlink_proto::Hex;
use motorlink_proto::can::CanFrame;
use motorlink_proto::rmd::TORQUE4_ID;
use motorlink_proto::st::RegisterId;
use motorlink_sim::{rmd::RmdConfig, st::MotorConfig};
use serde_json::Value;

const PORTS: &[&str] = &[
    "/dev/ttyACM0",
    "ttyUSB1?baud=9600",
    "serial:/dev/ttyACM0?baud=1843200",
    "tcp:drive.local:4000",
    "tcp:[::1]:4000",
    "tcp:h:1?clock=h:3",
    "unix:./drive",
    "slcan:/dev/ttyACM0?bitrate=1000000&baud=115200&echo=1",
    "slcan:unix:./drive",
    "slcan:tcp:h:1?bitrate=500000",
    "slcan:serial:serial:x?echo=0",
    "socketcan:can0",
    "share:./share/st0",
    "share:/tmp/a share/rmd12",
    "sim:",
    "sim:bench.toml",
    "pty:./st0",
    "slcan-pty:./can0",
    "tcp-listen:127.0.0.1:0",
    "unix-listen:./drive",
];

/// The root folder of the project.
fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn text(path: &str) -> String {
    let path = root().join(path);
    std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// The seeds of a target.
///
/// # Panics
/// If the vectors or the documentation have an unexpected form, or if there is no such target.
pub fn of(target: &str) -> Vec<Vec<u8>> {
    match target {
        "st_frame" => st().flat_map(|(_, request, reply)| [request, reply]).collect(),
        "st_master" => st().map(|(_, request, reply)| master(&request, &reply)).collect(),
        "st_model" => st().map(|(profile, request, _)| sequence(profile, 0, &request)).collect(),
        "st_slave" => st().map(|(profile, request, _)| sequence(profile, 1, &request)).collect(),
        "rmd_frame" => rmd().map(|(id, data)| any_frame(id, data)).collect(),
        "rmd_host" => rmd().map(|(id, data)| host(id, data)).collect(),
        "rmd_drive" => rmd().map(|(id, data)| drive(id, data)).collect(),
        "ffi" => st()
            .map(|(profile, request, _)| st_through_c(profile, &request))
            .chain(rmd().map(|(id, data)| rmd_through_c(id, data)))
            .collect(),
        "slcan" => rmd().map(|(id, data)| adapter(id, data)).collect(),
        "decode" => captures(),
        "port_name" => PORTS.iter().map(|name| name.as_bytes().to_vec()).collect(),
        "st_value" => values(),
        "settings_file" => settings(),
        "sim_config" => configurations(),
        "recording" => crate::recording::seeds(),
        "sim_command" => commands(),
        _ => panic!("there is no target {target}"),
    }
}

/// The frames of the vectors in each format of captures.
fn captures() -> Vec<Vec<u8>> {
    let entry = |wire| Captured {
        place: 1,
        time: Some(Stamp::Wall(1_436_509_053_249_713_000)),
        channel: Some("can0".into()),
        direction: Some(Direction::Received),
        wire,
    };
    let frames: Vec<Captured> =
        rmd().map(|(id, data)| entry(Wire::Can(CanFrame::new(id, data)))).collect();
    let bytes: Vec<Captured> =
        st().map(|(_, request, reply)| entry(Wire::Serial([request, reply].concat()))).collect();
    let written = [
        (Format::Candump, &frames[..2]),
        (Format::Asc, &frames[..2]),
        (Format::Pcapng, &frames[..2]),
        (Format::Pcapng, &bytes[..2]),
    ];
    let mut seeds: Vec<Vec<u8>> = written
        .into_iter()
        .map(|(format, entries)| {
            let writer = Writer::new(format, Vec::new()).expect("a vector can be written");
            let mut writer = writer.expect("the format is written");
            for entry in entries {
                writer.write(entry).expect("the format has it");
            }
            writer.into_inner().expect("a vector can be written")
        })
        .collect();
    seeds.extend(st().take(4).map(|(_, request, _)| Hex(&request).to_string().into_bytes()));
    seeds
        .push(b" (1436509053.249713)  can0  RX B -  141  [08]  9A 00 00 00 00 00 00 00\n".to_vec());
    seeds.push(b"  can0  20000004   [8]  00 01 00 00 00 00 00 00   ERRORFRAME\n".to_vec());
    seeds
}

fn vectors(path: &str) -> Vec<Value> {
    serde_json::from_str(&text(path)).expect("the vectors are a JSON list")
}

fn hexadecimal(value: &Value) -> Vec<u8> {
    let digits = value.as_str().unwrap_or("");
    let pairs = (0..digits.len()).step_by(2).map(|at| &digits[at..at + 2]);
    pairs.map(|pair| u8::from_str_radix(pair, 16).expect("the vectors are hexadecimal")).collect()
}

/// Profile (as the targets take it), request and reply of each vector.
fn st() -> impl Iterator<Item = (u8, Vec<u8>, Vec<u8>)> {
    vectors("vectors/st.json").into_iter().map(|vector| {
        let profile = u8::from(vector["profile"] == "mcsdk-5.4");
        (profile, hexadecimal(&vector["request"]), hexadecimal(&vector["reply"]))
    })
}

/// Identifier and data of each vector.
fn rmd() -> impl Iterator<Item = (u16, [u8; 8])> {
    vectors("vectors/rmd.json").into_iter().map(|vector| {
        let id = vector["id"].as_str().and_then(|id| id.strip_prefix("0x")).expect("0x and digits");
        let id = u16::from_str_radix(id, 16).expect("hexadecimal");
        (id, hexadecimal(&vector["bytes"]).try_into().expect("eight bytes"))
    })
}

/// A trusted line, a request, its reply, time, and the same request again.
fn master(request: &[u8], reply: &[u8]) -> Vec<u8> {
    let mut seed = vec![1, 0xFF, 0xFF, 0xFF, 0, 10];
    let payload = &request[2..request.len() - 1];
    for _ in 0..2 {
        seed.extend([2, request[0], payload.len() as u8]);
        seed.extend(payload);
        seed.extend([3, reply.len() as u8]);
        seed.extend(reply);
        seed.extend([6, 0xFF, 0x7F]);
    }
    seed
}

/// A frame by the operation `frame`, time, and the same for the current motor.
fn sequence(profile: u8, frame: u8, request: &[u8]) -> Vec<u8> {
    let mut seed = vec![profile | 3 << 1];
    let payload = &request[2..request.len() - 1];
    for header in [request[0], request[0] & 0x1F] {
        seed.extend([frame, header, payload.len() as u8]);
        seed.extend(payload);
        seed.extend([5, 0xC8]);
    }
    seed
}

fn any_frame(id: u16, data: [u8; 8]) -> Vec<u8> {
    let (kind, base) = if id == TORQUE4_ID { (14, TORQUE4_ID) } else { (12, 0x140) };
    let mut seed = vec![kind, 0, (id - base) as u8];
    seed.extend(data);
    seed
}

/// The index of a motor; the first one for identifiers of all motors.
fn index(id: u16) -> u8 {
    id.checked_sub(0x141).filter(|index| *index < 32).unwrap_or(0) as u8
}

/// A trusted motor, a request and a reply with the same bytes, time, and the same again.
fn host(id: u16, data: [u8; 8]) -> Vec<u8> {
    let mut seed = vec![13, index(id)];
    for operation in [0, 6, 0] {
        seed.extend([operation, index(id)]);
        seed.extend(data);
    }
    seed.extend([7, 0, 0xFF, 0x7F]);
    seed
}

/// A frame, and time for the motor to turn.
fn drive(id: u16, data: [u8; 8]) -> Vec<u8> {
    let mut seed = vec![0, index(id)];
    seed.extend(data);
    seed.extend([5, 0, 0xFF, 0x3F]);
    seed
}

/// Calls for the storages 0 to 3 as the target `ffi` reads them.
const INIT: u8 = 0;
const CALL: u8 = 5 * 4;

/// A request from a master to a slave, and its reply.
fn st_through_c(profile: u8, request: &[u8]) -> Vec<u8> {
    let payload = &request[2..request.len() - 1];
    let mut seed = vec![INIT, 0, 1, profile, 0, INIT + 1, 1, 1, profile, 7];
    let trust = [CALL, 0, 17, 0, 3, 0];
    seed.extend(trust);
    seed.extend([CALL, 0, 14, 0, request[0], payload.len() as u8]);
    seed.extend(payload);
    let poll = [CALL, 0, 21, 0, 0, 0];
    let carry = [CALL + 1, 1, 5, CALL, 0, 19, 0, 0, 0];
    [&seed[..], &poll, &carry, &poll].concat()
}

/// A request from a host to a drive, and its reply.
fn rmd_through_c(id: u16, data: [u8; 8]) -> Vec<u8> {
    let motor = index(id) + 1;
    let mut seed = vec![INIT + 2, 2, 1, 0, 0, INIT + 3, 3, 1, motor, 0];
    let trust = [CALL + 2, 2, 5, 1, 0xFF, 0xFF, 0xFF, 0xFF];
    seed.extend(trust);
    seed.extend([CALL + 2, 2, 2, motor]);
    seed.extend(data);
    let poll = [CALL + 2, 2, 9, 0];
    let heard = [0; 12];
    let receive = [CALL + 3, 3, 6];
    let reply = [CALL + 2, 2, 8, 0];
    [&seed[..], &poll, &receive, &heard, &reply, &heard, &poll].concat()
}

/// An adapter is opened and sends a frame.
fn adapter(id: u16, data: [u8; 8]) -> Vec<u8> {
    let mut seed = b"\x10C\rS8\rZ1\rO\r".to_vec();
    seed.extend(slcan::encode(&CanFrame::new(id, data), &mut [0; slcan::LONGEST_FRAME]));
    seed
}

/// A value of each register, in units and in digits, and the register's name.
fn values() -> Vec<Vec<u8>> {
    let texts = ["-1500", "0x1F", "98.5", "1e39", "SPEED", "I_ALPHA"];
    let each = RegisterId::all().zip(texts.into_iter().cycle());
    each.flat_map(|(id, text)| {
        let name = id.to_string();
        [(0, text), (3, text), (1, &name[..])]
            .map(|(flags, text)| [&[id.0, flags], text.as_bytes()].concat())
    })
    .collect()
}

/// The example of docs/SIMULATOR.md, and every member of a configuration.
/// The files of settings that the pages show.
fn settings() -> Vec<Vec<u8>> {
    let files = ["docs/ST.md", "docs/RMD.md"].map(text).map(|page| {
        let file =
            page.split("```toml fragment\n").nth(1).and_then(|rest| rest.split("```").next());
        file.expect("the page shows a file").as_bytes().to_vec()
    });
    files.into()
}

fn configurations() -> Vec<Vec<u8>> {
    let page = text("docs/SIMULATOR.md");
    let shown = page.split("```toml config\n").nth(1).and_then(|rest| rest.split("```").next());
    let st = [MotorConfig::default(), MotorConfig::servo()].map(|motor| members("st", &motor));
    let shown = shown.expect("the page shows a configuration").to_owned();
    [shown, members("rmd", &RmdConfig::default())].into_iter().chain(st).map(Into::into).collect()
}

fn members(section: &str, motor: &impl serde::Serialize) -> String {
    let motor = toml::Value::try_from(motor).expect("a configuration is a table");
    let list = toml::Value::Array(vec![motor]);
    let section = [(section.to_owned(), toml::Table::from_iter([("motor".to_owned(), list)]))];
    toml::Table::from_iter(section.map(|(name, table)| (name, table.into()))).to_string()
}

/// The examples of docs/SIMULATOR.md, and one of each command.
fn commands() -> Vec<Vec<u8>> {
    let page = text("docs/SIMULATOR.md");
    let shown = page.lines().map(str::trim).filter(|line| line.starts_with("{\"command\""));
    let each = [
        r#"{"command":"power-cycle"}"#,
        r#"{"command":"power-cycle","motor":2}"#,
        r#"{"command":"supply","motor":1,"volts":6.5}"#,
        r#"{"command":"temperature","motor":2,"celsius":-40}"#,
        r#"{"command":"load","motor":1,"newton_metres":1e3}"#,
        r#"{"command":"lock-rotor","motor":1,"locked":true}"#,
        r#"{"command":"fault","motor":1,"fault":"OVER_TEMP","hold":true}"#,
        r#"{"command":"fault","motor":1,"fault":"LOW_VOLTAGE"}"#,
    ];
    shown.chain(each).map(|line| line.as_bytes().to_vec()).collect()
}
