//! Frames of ST drives.

use motorlink_proto::st::register::{Shape, Type, Unit, Writing};
use motorlink_proto::st::{
    BoardInfo, Command, CurrentReference, ErrorCode, Features, FirmwareVersion, Flags, Frame,
    FrameCode, HEADER_ACK, HEADER_ATR, HEADER_NACK, MAX_FRAME, MAX_PAYLOAD, OVERHEAD, Parse,
    PositionMove, Profile, REVUP_PHASES, Ramp, Reading, RegisterId, Reply, Request, RevupPhase,
    Status, TorqueRamp, segment_values,
};
use serde_json::{Map, Value, json};

use crate::out::{hex, line};

pub fn frames() {
    for profile in Profile::ALL {
        St { set: format!("st {}", profile.name()), profile }.frames();
    }
}

struct St {
    set: String,
    profile: Profile,
}

/// The numbers of a register's type that are at its bounds, and mixed ones.
fn bounds(ty: Type) -> Vec<i32> {
    let bits = [0, 1, -1, 239, i32::MAX, i32::MIN, 0x7FFF, -0x8000, 0x7F, 0x80, 0xFF, 0x1234_5678];
    let floats =
        [0.0, 1.5, -0.1, f32::MAX, f32::MIN_POSITIVE, 3.0e-5].map(|f: f32| f.to_bits() as i32);
    match ty {
        Type::F32 => floats.to_vec(),
        _ => bits.map(|bits| ty.fit(bits)).to_vec(),
    }
}

impl St {
    fn frames(&self) {
        for register in RegisterId::all().chain([RegisterId(0xC0), RegisterId(0xFF)]) {
            self.register(register);
        }
        for number in 0..=u8::MAX {
            self.ask(2, &Request::ExecuteCommand(Command::from(number)));
            self.reply(HEADER_NACK, &[number], |fields, notes| {
                fields.insert("motorlink.st.error".into(), number.into());
                notes.push("refused");
            });
        }
        self.ask(0, &Request::GetRegister(RegisterId::STATUS));
        self.reply(HEADER_NACK, &[], |_, notes| notes.push("refused"));
        self.numbers();
        self.texts();
        if self.profile == Profile::Spec {
            self.segments();
        }
        for code in 0..32 {
            for motor in [0, 7] {
                self.raw(code, motor);
            }
        }
        self.prefixes();
    }

    fn register(&self, register: RegisterId) {
        self.ask(1, &Request::GetRegister(register));
        let built = register.shape().map(|shape| Features::NONE.with(shape.feature));
        let ty = register.shape().map_or(Type::U32, |shape| shape.ty(self.profile));
        let size = match register.shape().zip(built) {
            Some((shape, built)) => shape.read_size(self.profile, built),
            None => Some(4),
        };
        let size = usize::from(size.unwrap_or(ty.size()));
        for bits in bounds(ty) {
            let payload = &bits.to_le_bytes()[..size];
            self.ask(1, &Request::GetRegister(register));
            self.reply(HEADER_ACK, payload, |fields, notes| {
                let bits = register.decode(self.profile, payload);
                let value =
                    bits.and_then(|bits| register.value_of_other_profile(self.profile, bits));
                match value {
                    Some(_) => notes.push("other_profile"),
                    None => self.value(register, payload, fields, notes),
                }
            });
            let size = usize::from(register.write_size(self.profile));
            let value = &bits.to_le_bytes()[..size];
            self.ask(0, &Request::SetRegister { register, value });
            self.reply(HEADER_ACK, &[], |_, _| {});
        }
        // A reply of another size is damage.
        let takes = Request::GetRegister(register).reply_size(self.profile);
        for size in [0, 1, 2, 3, 4, 5] {
            if !takes.takes(size) {
                self.ask(1, &Request::GetRegister(register));
                self.reply(HEADER_ACK, &[1, 2, 3, 4, 5][..size.into()], |_, notes| {
                    notes.push("wrong_size");
                });
            }
        }
    }

    /// The fields of a register's value.
    fn value(
        &self,
        register: RegisterId,
        payload: &[u8],
        fields: &mut Map<String, Value>,
        notes: &mut Vec<&str>,
    ) {
        let Some(bits) = register.decode(self.profile, payload) else { return };
        let reading = Reading { register, bits, profile: self.profile };
        let Some((shape, text)) = register.shape().zip(register.text()) else {
            push(fields, "digits", reading.digits());
            return;
        };
        let key = format!("reg.{}", text.name.to_lowercase());
        push(fields, "digits", reading.digits());
        push(fields, "value", reading.value());
        push(fields, &key, reading.value());
        if shape.unit == Unit::Flags {
            let flags = Flags(bits as u32);
            for &(bit, name, _) in Flags::NAMES {
                let key = format!("{key}.{}", name.to_lowercase());
                push(fields, &format!("{key}.occurred"), flags.occurred() & bit != 0);
                push(fields, &format!("{key}.present"), flags.present() & bit != 0);
            }
            if bits != 0 {
                notes.push("fault");
            }
        }
        let faulty = [Status::FaultNow, Status::FaultOver];
        if shape.unit == Unit::Status && faulty.contains(&Status::from(bits as u8)) {
            notes.push("fault");
        }
    }

    fn numbers(&self) {
        for (speed_rpm, torque_s16a, duration_ms) in
            [(0, 0, 0), (-1, -1, 1), (i32::MIN, i16::MIN, u16::MAX), (i32::MAX, i16::MAX, 1000)]
        {
            let phase = RevupPhase { speed_rpm, torque_s16a, duration_ms };
            let currents = CurrentReference { iq_s16a: torque_s16a, id_s16a: !torque_s16a };
            let mut requests = vec![
                Request::SetRamp(Ramp { speed_rpm, duration_ms }),
                Request::SetRevupData(REVUP_PHASES, phase),
                Request::SetCurrentReference(currents),
            ];
            if self.profile == Profile::Mcsdk54 {
                let ramp = TorqueRamp { torque_s16a: speed_rpm, duration_ms };
                requests.push(Request::SetTorqueRamp(ramp));
                let (angle_rad, duration_s) = (speed_rpm as f32 / 3.0, duration_ms.into());
                requests.push(Request::SetPosition(PositionMove { angle_rad, duration_s }));
            }
            for request in requests {
                self.ask(3, &request);
                self.reply(HEADER_ACK, &[], |_, _| {});
                self.ask(3, &request);
                self.reply(HEADER_ACK, &[1], |_, notes| notes.push("wrong_size"));
            }
            self.ask(1, &Request::GetRevupData(duration_ms as u8));
            let payload = phase.to_bytes();
            self.reply(HEADER_ACK, &payload, |fields, _| {
                let phase = RevupPhase::decode(&payload).expect("it is whole");
                revup(fields, phase);
            });
            self.ask(1, &Request::GetRevupData(0));
            self.reply(HEADER_ACK, &payload[..7], |_, notes| notes.push("wrong_size"));
        }
        if self.profile == Profile::Mcsdk54 {
            self.ask(1, &Request::GetProfilerInfo(&[1, 2]));
            self.reply(HEADER_ACK, &[3, 4], |_, _| {});
        }
    }

    fn texts(&self) {
        let boards: [&[u8]; 6] = [
            b"\x05\x04\x03ST MC SDK\0\0\0",
            b"543ST MC SDK\0rest",
            b"\xff\x00\x10",
            b"\x05\x04\x03\xc2\xb5 \xe2\x82\xac \xf0\x9f\x98\x80 \xc0\x80",
            b"\x05\x04\x03a\xed\xa0\x80",
            b"\x05\x04\x03caf\xc3",
        ];
        for payload in boards {
            self.ask(0, &Request::GetBoardInfo);
            self.reply(HEADER_ACK, payload, |fields, _| {
                let info = BoardInfo::decode(payload).expect("it is long enough");
                let [major, minor, patch] = info.version;
                push(fields, "version", format!("{major}.{minor}.{patch}"));
                if payload.len() > 3 {
                    push(fields, "name", info.name);
                }
            });
        }
        self.ask(0, &Request::GetBoardInfo);
        self.reply(HEADER_ACK, &[5, 4], |_, notes| notes.push("wrong_size"));
        let versions: [&[u8]; 5] = [
            b"ST MC SDK\tVer.5.4.4\0\0",
            b"MCSDK\0Ver.5.0.0-RC2\0",
            b"no version",
            b"\xf4\x90\x80\x80\t\xf4\x8f\xbf\xbf",
            b"\t",
        ];
        for payload in versions {
            self.ask(0, &Request::GetFirmwareVersion);
            self.reply(HEADER_ACK, payload, |fields, _| {
                let FirmwareVersion { name, version } = FirmwareVersion::decode(payload);
                push(fields, "name", name);
                if payload.iter().position(|&b| b == b'\t' || b == 0) < Some(payload.len() - 1)
                    && !payload.ends_with(b"version")
                {
                    push(fields, "version", version);
                }
            });
        }
    }

    fn segments(&self) {
        let all: Vec<RegisterId> = RegisterId::all()
            .filter(|id| {
                let shape = id.shape().expect("it is in the table");
                shape.segment_size(Features::NONE.with(shape.feature)).is_some()
            })
            .collect();
        for (at, registers) in all.chunks(9).enumerate() {
            let segment = at as u8 % 4;
            let ids: Vec<u8> = registers.iter().map(|id| id.0).collect();
            self.ask(0, &Request::ConfigureSegment { segment, registers: &ids });
            self.reply(HEADER_ACK, &[], |_, _| {});
            let size = |id: &RegisterId| id.shape().map_or(0, |it| it.ty(Profile::Spec).size());
            let size: usize = registers.iter().map(|id| usize::from(size(id))).sum();
            for byte in [0x00, 0xFF, 0x7F, 0x80, 0x0A] {
                let payload = vec![byte; size];
                self.ask(0, &Request::GetSegment(segment));
                self.reply(HEADER_ACK, &payload, |fields, notes| {
                    let values = segment_values(registers, &payload).expect("the size is right");
                    for (&id, bits) in registers.iter().zip(values) {
                        let size = id.shape().map_or(0, |it| it.ty(Profile::Spec).size());
                        let bytes = &bits.to_le_bytes()[..size.into()];
                        self.value(id, bytes, fields, notes);
                    }
                });
            }
            self.ask(0, &Request::GetSegment(segment));
            self.reply(HEADER_ACK, &vec![0; size + 1], |_, notes| notes.push("wrong_size"));
        }
    }

    /// Payloads that are too short or too long, and unknown codes.
    fn raw(&self, code: u8, motor: u8) {
        for size in [0, 1, 3, 5, 7, 9, MAX_PAYLOAD] {
            let mut room = [0; MAX_FRAME];
            let payload: Vec<u8> = (0..size as u8).map(|byte| byte.wrapping_mul(37)).collect();
            let frame = Frame { header: Frame::header(code, motor), payload: &payload };
            self.sent(frame.encode(&mut room).expect("it fits"));
        }
    }

    fn ask(&self, motor: u8, request: &Request<'_>) {
        let mut room = [0; MAX_FRAME];
        self.sent(Frame::command(motor, request, &mut room).expect("it fits"));
    }

    fn sent(&self, bytes: &[u8]) {
        let Parse::Frame(frame, _) = Frame::parse(bytes) else { panic!("a frame") };
        let (mut fields, mut notes) = (frame_fields(&frame, bytes, true), Vec::new());
        let text = match frame.request(self.profile) {
            Ok(request) => {
                push(&mut fields, "message", request.code().name());
                self.request(&request, frame.payload, &mut fields, &mut notes);
                None
            }
            Err(_) => match FrameCode::from_number(frame.code(), self.profile) {
                Some(code) => {
                    push(&mut fields, "message", code.name());
                    notes.push("too_short");
                    Some(format!("> {}, too short", code.name()))
                }
                None => {
                    notes.push("unknown_code");
                    Some(format!("> frame code {:#04x}", frame.code()))
                }
            },
        };
        let motor = frame.motor();
        let tail = if motor == 0 { String::new() } else { format!(", motor {motor}") };
        self.serial(true, bytes, fields, &notes, false, text.map(|text| text + &tail));
    }

    fn request(
        &self,
        request: &Request<'_>,
        payload: &[u8],
        fields: &mut Map<String, Value>,
        notes: &mut Vec<&str>,
    ) {
        match *request {
            Request::SetRegister { register, value } => {
                push(fields, "register", register.0);
                let is_float = register.shape().is_some_and(|it| it.ty(self.profile) == Type::F32);
                if !is_float || value.len() == 4 {
                    self.value(register, value, fields, notes);
                }
                let features = |shape: &Shape| Features::NONE.with(shape.feature);
                let takes = register.shape().map(|shape| {
                    match shape.writing(self.profile, features(&shape)) {
                        Writing::Takes(size) => size.into(),
                        _ => 0,
                    }
                });
                if takes.is_some_and(|size: usize| size != value.len()) {
                    notes.push("wrong_size");
                }
            }
            Request::GetRegister(register) => push(fields, "register", register.0),
            Request::ExecuteCommand(command) => push(fields, "command", command.number()),
            Request::SetRamp(ramp) => {
                push(fields, "speed_rpm", ramp.speed_rpm);
                push(fields, "duration_ms", ramp.duration_ms);
            }
            Request::GetRevupData(phase) => push(fields, "phase", phase),
            Request::SetRevupData(phase, data) => {
                push(fields, "phase", phase);
                revup(fields, data);
            }
            Request::SetCurrentReference(reference) => {
                push(fields, "iq_s16a", reference.iq_s16a);
                push(fields, "id_s16a", reference.id_s16a);
            }
            Request::GetSegment(segment) => push(fields, "segment", segment),
            Request::ConfigureSegment { segment, registers } => {
                push(fields, "segment", segment);
                registers.iter().for_each(|&register| push(fields, "register", register));
            }
            Request::SetTorqueRamp(ramp) => {
                push(fields, "torque_s16a", ramp.torque_s16a);
                push(fields, "duration_ms", ramp.duration_ms);
            }
            Request::SetPosition(target) => {
                push(fields, "angle_rad", target.angle_rad);
                push(fields, "duration_s", target.duration_s);
            }
            Request::GetBoardInfo | Request::GetFirmwareVersion | Request::GetProfilerInfo(_) => {}
        }
        // What the message does not need is surplus.
        let mut room = [0; MAX_PAYLOAD];
        let needed = request.payload(&mut room).map_or(0, <[u8]>::len);
        if let Some(surplus @ [_, ..]) = payload.get(needed..) {
            push(fields, "surplus", hex(surplus));
            notes.push("surplus_bytes");
        }
    }

    fn reply(
        &self,
        header: u8,
        payload: &[u8],
        fill: impl FnOnce(&mut Map<String, Value>, &mut Vec<&str>),
    ) {
        let mut room = [0; MAX_FRAME];
        let bytes = Frame { header, payload }.encode(&mut room).expect("it fits");
        let Parse::Frame(frame, _) = Frame::parse(bytes) else { panic!("a frame") };
        let (mut fields, mut notes) = (frame_fields(&frame, bytes, false), Vec::new());
        let (message, text) = match frame.reply().expect("it is a reply") {
            Reply::Acknowledged(_) => ("ACK", None),
            Reply::Refused(_) if payload.is_empty() => {
                ("NACK", Some("< NACK without a code".into()))
            }
            Reply::Refused(code) => ("NACK", Some(format!("< NACK {code}: {}", code.doc()))),
            Reply::Identification => ("ATR", None),
        };
        push(&mut fields, "message", message);
        fill(&mut fields, &mut notes);
        self.serial(false, bytes, fields, &notes, true, text);
    }

    /// Every beginning of a request and of both replies.
    fn prefixes(&self) {
        let mut room = [0; MAX_FRAME];
        let phase = RevupPhase { speed_rpm: 1, torque_s16a: 2, duration_ms: 3 };
        let request = Request::SetRevupData(1, phase);
        let request = Frame::command(5, &request, &mut room).expect("it fits").to_vec();
        let mut replies = Vec::new();
        let speed = 1500i32.to_le_bytes();
        for (header, payload) in [
            (HEADER_ACK, &speed[..]),
            (HEADER_NACK, &[ErrorCode::BadCrc.number()]),
            (HEADER_ATR, &[]),
        ] {
            let frame = Frame { header, payload };
            replies.push(frame.encode(&mut room).expect("it fits").to_vec());
        }
        for (is_sent, whole) in
            [(true, &request)].into_iter().chain(replies.iter().map(|reply| (false, reply)))
        {
            for size in 1..whole.len() {
                let bytes = &whole[..size];
                assert_eq!(Frame::parse(bytes), Parse::More);
                let mut fields = Map::new();
                let header = Frame { header: bytes[0], payload: &[] };
                header_fields(&mut fields, &header, is_sent);
                if let Some(length) = bytes.get(1) {
                    push(&mut fields, "length", *length);
                }
                push(&mut fields, "fragment", hex(bytes));
                line(json!({
                    "set": format!("{} prefixes", self.set),
                    "sent": is_sent,
                    "data": hex(bytes),
                    "fields": fields,
                    "notes": ["incomplete"],
                }));
            }
        }
    }

    fn serial(
        &self,
        is_sent: bool,
        bytes: &[u8],
        fields: Map<String, Value>,
        notes: &[&str],
        answers: bool,
        info: Option<String>,
    ) {
        line(json!({
            "set": self.set,
            "sent": is_sent,
            "data": hex(bytes),
            "answers": answers,
            "fields": fields,
            "notes": notes,
            "info": info,
        }));
    }
}

fn revup(fields: &mut Map<String, Value>, phase: RevupPhase) {
    push(fields, "speed_rpm", phase.speed_rpm);
    push(fields, "torque_s16a", phase.torque_s16a);
    push(fields, "duration_ms", phase.duration_ms);
}

fn header_fields(fields: &mut Map<String, Value>, frame: &Frame<'_>, is_sent: bool) {
    push(fields, "type", if is_sent { 1 } else { 2 });
    push(fields, "header", frame.header);
    if is_sent {
        push(fields, "code", frame.code());
        push(fields, "motor", frame.motor());
    }
}

fn frame_fields(frame: &Frame<'_>, bytes: &[u8], is_sent: bool) -> Map<String, Value> {
    let mut fields = Map::new();
    header_fields(&mut fields, frame, is_sent);
    push(&mut fields, "length", bytes.len() - OVERHEAD);
    if !frame.payload.is_empty() {
        push(&mut fields, "payload", hex(frame.payload));
    }
    push(&mut fields, "checksum", bytes[bytes.len() - 1]);
    push(&mut fields, "checksum.status", 1);
    fields
}

/// Adds a value. A field may have several.
fn push(fields: &mut Map<String, Value>, key: &str, value: impl Into<Value>) {
    let key = format!("motorlink.st.{key}");
    match fields.get_mut(&key) {
        Some(Value::Array(values)) => values.push(value.into()),
        Some(one) => *one = Value::Array(vec![one.take(), value.into()]),
        None => {
            fields.insert(key, value.into());
        }
    }
}
