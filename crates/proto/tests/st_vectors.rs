//! `vectors/st.json`, each in both directions.

// An interpreter takes long to read JSON.
#![cfg(not(miri))]

use motorlink_proto::st::*;
use serde_json::Value;

fn vectors() -> Vec<Value> {
    let text = include_str!("../../../vectors/st.json");
    serde_json::from_str(text).expect("the vectors are JSON")
}

fn hex(text: &Value) -> Vec<u8> {
    let text = text.as_str().expect("a hex string");
    (0..text.len()).step_by(2).map(|i| u8::from_str_radix(&text[i..i + 2], 16).unwrap()).collect()
}

fn profiles(vector: &Value) -> &'static [Profile] {
    match vector["profile"].as_str().unwrap() {
        "spec" => &[Profile::Spec],
        "mcsdk-5.4" => &[Profile::Mcsdk54],
        _ => &[Profile::Spec, Profile::Mcsdk54],
    }
}

/// The request that the vector's fields describe.
fn request<'a>(vector: &Value, bytes: &'a [u8]) -> Request<'a> {
    let fields = &vector["fields"];
    let int = |name: &str| fields[name].as_i64().unwrap_or_else(|| panic!("no {name}: {vector}"));
    match vector["code"].as_str().unwrap() {
        "SET_REG" => {
            Request::SetRegister { register: RegisterId(int("register") as u8), value: bytes }
        }
        "GET_REG" => Request::GetRegister(RegisterId(int("register") as u8)),
        "EXECUTE_CMD" => Request::ExecuteCommand(Command::from(int("command") as u8)),
        "GET_BOARD_INFO" => Request::GetBoardInfo,
        "SET_RAMP" => Request::SetRamp(Ramp {
            speed_rpm: int("speed") as i32,
            duration_ms: int("duration") as u16,
        }),
        "GET_REVUP_DATA" => Request::GetRevupData(int("phase") as u8),
        "SET_REVUP_DATA" => Request::SetRevupData(int("phase") as u8, revup(fields)),
        "SET_CURRENT_REF" => Request::SetCurrentReference(CurrentReference {
            iq_s16a: int("iq") as i16,
            id_s16a: int("id") as i16,
        }),
        "GET_MP_INFO" => Request::GetProfilerInfo(bytes),
        "GET_FW_VERSION" => Request::GetFirmwareVersion,
        "GET_DATA_ELEMENT" => Request::GetSegment(int("segment") as u8),
        "CONFIG_DYN_STRUCT" => {
            Request::ConfigureSegment { segment: int("segment") as u8, registers: bytes }
        }
        "SET_TORQUE_RAMP" => Request::SetTorqueRamp(TorqueRamp {
            torque_s16a: int("torque") as i32,
            duration_ms: int("duration") as u16,
        }),
        "SET_POSITION_CMD" => Request::SetPosition(PositionMove {
            angle_rad: fields["angle"].as_f64().unwrap() as f32,
            duration_s: fields["duration"].as_f64().unwrap() as f32,
        }),
        other => panic!("unknown code {other}"),
    }
}

fn revup(fields: &Value) -> RevupPhase {
    RevupPhase {
        speed_rpm: fields["speed"].as_i64().unwrap() as i32,
        torque_s16a: fields["torque"].as_i64().unwrap() as i16,
        duration_ms: fields["duration"].as_i64().unwrap() as u16,
    }
}

#[test]
fn every_request_encodes_to_its_bytes_and_decodes_from_them() {
    for vector in vectors() {
        let bytes = hex(&vector["request"]);
        let list = ["value", "steps", "registers"]
            .iter()
            .find_map(|name| vector["fields"].get(name))
            .map(hex)
            .unwrap_or_default();
        let expected = request(&vector, &list);
        let motor = vector["motor"].as_u64().unwrap() as u8;

        let mut out = [0xA5; MAX_FRAME + 1];
        assert_eq!(Frame::command(motor, &expected, &mut out), Some(&bytes[..]), "{vector}");
        assert!(out[bytes.len()..].iter().all(|&byte| byte == 0xA5), "wrote past the frame");

        let Parse::Frame(frame, size) = Frame::parse(&bytes) else { panic!("{vector}") };
        assert_eq!((size, frame.motor()), (bytes.len(), motor), "{vector}");
        let mut payload = [0xA5; MAX_PAYLOAD];
        assert_eq!(expected.payload(&mut payload), Some(frame.payload), "{vector}");
        let short = frame.payload.len().saturating_sub(1);
        let fits = frame.payload.is_empty();
        assert_eq!(expected.payload(&mut payload[..short]).is_some(), fits, "{vector}");
        for &profile in profiles(&vector) {
            let code = FrameCode::from_number(frame.code(), profile).map(FrameCode::name);
            assert_eq!(code, vector["code"].as_str(), "{vector}");
            assert_eq!(frame.request(profile), Ok(expected), "{vector}");
        }
    }
}

#[test]
fn every_reply_decodes_to_its_fields_and_encodes_from_them() {
    for vector in vectors().iter().filter(|vector| vector.get("reply").is_some()) {
        let bytes = hex(&vector["reply"]);
        let answer = &vector["answer"];
        let Parse::Frame(frame, size) = Frame::parse(&bytes) else { panic!("{vector}") };
        assert_eq!(size, bytes.len());
        let mut out = [0xA5; MAX_FRAME];
        assert_eq!(frame.encode(&mut out), Some(&bytes[..]), "{vector}");

        if let Some(error) = answer.get("error") {
            assert_eq!(frame.header, HEADER_NACK, "{vector}");
            let code = ErrorCode::from(frame.payload[0]);
            assert_eq!(u64::from(u8::from(code)), error.as_u64().unwrap(), "{vector}");
            assert_eq!(code.name(), answer["error_name"].as_str(), "{vector}");
            continue;
        }
        assert_eq!(frame.header, HEADER_ACK, "{vector}");
        match vector["code"].as_str().unwrap() {
            "GET_REG" => {
                let register = RegisterId(vector["fields"]["register"].as_u64().unwrap() as u8);
                let bits = answer["bits"].as_i64().unwrap() as i32;
                for &profile in profiles(vector) {
                    assert_eq!(register.decode(profile, frame.payload), Some(bits), "{vector}");
                    let ty = register.shape().unwrap().ty(profile);
                    assert_eq!(Some(ty.name()), answer["type"].as_str(), "{vector}");
                    assert_eq!(frame.payload, &bits.to_le_bytes()[..usize::from(ty.size())]);
                }
            }
            "GET_BOARD_INFO" => {
                let info = BoardInfo::decode(frame.payload).unwrap();
                assert_eq!(Value::from(info.version.to_vec()), answer["version"]);
                assert_eq!(answer["name"], info.name);
            }
            "GET_FW_VERSION" => {
                let version = FirmwareVersion::decode(frame.payload);
                assert_eq!(answer["name"], version.name);
                assert_eq!(answer["version"], version.version);
            }
            "GET_REVUP_DATA" => {
                assert_eq!(RevupPhase::decode(frame.payload), Some(revup(answer)));
                assert_eq!(frame.payload, revup(answer).to_bytes());
            }
            "GET_DATA_ELEMENT" => assert_eq!(frame.payload, hex(&answer["values"])),
            _ => assert!(frame.payload.is_empty(), "{vector}"),
        }
    }
}

#[test]
fn every_code_register_size_and_error_has_a_vector() {
    let vectors = vectors();
    let has = |key: &str, name: &str| vectors.iter().any(|vector| vector[key] == name);
    for code in FrameCode::ALL {
        assert!(has("code", code.name()), "no vector for {}", code.name());
    }
    let answers: Vec<&Value> = vectors.iter().filter_map(|vector| vector.get("answer")).collect();
    for code in &ErrorCode::ALL[1..] {
        assert!(
            answers.iter().any(|answer| answer["error_name"] == code.name().unwrap()),
            "{code}"
        );
    }
    for command in Command::ALL {
        let name = command.name().unwrap();
        assert!(vectors.iter().any(|vector| vector["fields"]["command_name"] == name), "{name}");
    }
    for ty in ["i8", "u8", "i16", "u16", "i32", "u32", "f32"] {
        assert!(answers.iter().any(|answer| answer["type"] == ty), "no vector for {ty}");
    }
}
