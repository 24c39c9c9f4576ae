//! The message type of a motor's signals. It is made for each motor: its fields are the signals.

use motorlink_proto::rmd::Errors;
use motorlink_proto::st::{ControlMode, Flags, RegisterId, Status};
use motorlink_telemetry::signal::{Quantity, Signal, Source};

use super::cdr::{self, Malformed};
use super::message::{Time, with_dependencies};
use super::name::{camel_case, snake_case};

/// The package of our types.
pub const PACKAGE: &str = "motorlink/msg/";
const STAMP: &str = "builtin_interfaces/Time stamp";
const SPAN: &str = "float64 span_s";

/// A field of a [`SignalsType`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SignalField {
    /// The name of the field: `speed_meas`.
    pub field: String,
    /// The name of the signal: `SPEED_MEAS`.
    pub signal: String,
    /// The symbol of the unit; empty without one.
    pub unit: String,
    /// The meaning; may be empty.
    pub doc: String,
}

/// The message type of signals that are read at the same instants.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SignalsType {
    name: String,
    fields: Vec<SignalField>,
    constants: Vec<String>,
}

/// The values of one instant.
#[derive(Debug, Clone, PartialEq)]
pub struct SignalsRow {
    /// The middle between the first request and the last reply.
    pub stamp: Time,
    /// The time between the two, s.
    pub span_s: f64,
    /// The values, in the order of the fields. NaN: no value at this instant.
    pub values: Vec<f64>,
}

impl SignalsType {
    /// The type of these signals of one motor. `topic` is that of its messages: the type is named after
    /// it.
    pub fn new(topic: &str, signals: &[Signal]) -> Self {
        let constants = signals.iter().flat_map(|signal| constants(signal.source)).collect();
        let fields = signals.iter().map(|signal| SignalField::new(signal.source)).collect();
        SignalsType { name: format!("{PACKAGE}{}", camel_case(topic)), fields, constants }
    }

    /// The type of any values. `topic` is that of its messages.
    pub fn of_fields(topic: &str, fields: Vec<SignalField>) -> Self {
        SignalsType { name: format!("{PACKAGE}{}", camel_case(topic)), fields, constants: vec![] }
    }

    /// The type that a recording has under this name; `None` if it is none of ours.
    pub fn parse(name: &str, definition: &str) -> Option<Self> {
        let own = definition.split("\n====").next()?;
        let mut lines = own.lines().map(str::trim);
        lines.find(|line| line.starts_with(STAMP))?;
        lines.next().filter(|line| line.starts_with(SPAN))?;
        let (mut fields, mut constants) = (Vec::new(), Vec::new());
        for line in lines.filter(|line| !line.is_empty() && !line.starts_with('#')) {
            match line.contains('=') && !line.starts_with(SignalField::TYPE) {
                true => constants.push(line.to_owned()),
                false => fields.push(SignalField::parse(line)?),
            }
        }
        name.starts_with(PACKAGE).then(|| SignalsType { name: name.to_owned(), fields, constants })
    }

    /// The name of the type: `motorlink/msg/St0Motor1Signals`.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The fields of the values.
    pub fn fields(&self) -> &[SignalField] {
        &self.fields
    }

    /// The fields in the language of `.msg` files, with the types that they use.
    pub fn definition(&self) -> String {
        let mut text = String::new();
        let mut add = |line: &str| text.extend([line, "\n"]);
        add("# Values of one instant. NaN: no value.");
        add(&format!("{STAMP} # the middle between the first request and the last reply"));
        add(&format!("{SPAN} # [s] the time between the two"));
        self.fields.iter().for_each(|field| add(&field.line()));
        self.constants.iter().for_each(|constant| add(constant));
        with_dependencies(&text, &[Time::DEPENDENCY])
    }

    /// A row as CDR.
    pub fn encode(&self, row: &SignalsRow) -> Vec<u8> {
        debug_assert_eq!(row.values.len(), self.fields.len());
        let mut message = cdr::encode(&(row.stamp, row.span_s));
        row.values.iter().for_each(|value| message.extend(value.to_le_bytes()));
        message
    }

    /// The row that this CDR is.
    ///
    /// # Errors
    /// It is a message of another type.
    pub fn decode(&self, bytes: &[u8]) -> Result<SignalsRow, Malformed> {
        let ((stamp, span_s), values) = cdr::decode(bytes)?;
        let (values, _) = values.as_chunks();
        let values = values.get(..self.fields.len()).ok_or(Malformed::Short)?;
        let values = values.iter().copied().map(f64::from_le_bytes).collect();
        Ok(SignalsRow { stamp, span_s, values })
    }
}

impl SignalField {
    const TYPE: &str = "float64";

    fn new(source: Source) -> Self {
        let signal = source.to_string();
        SignalField {
            field: snake_case(&signal),
            signal,
            unit: source.unit().to_owned(),
            doc: doc(source),
        }
    }

    /// `float64 speed_meas # SPEED_MEAS [rpm] Mechanical speed, averaged`
    fn line(&self) -> String {
        let unit = if self.unit.is_empty() { String::new() } else { format!(" [{}]", self.unit) };
        let line = format!("{} {} # {}{unit} {}", Self::TYPE, self.field, self.signal, self.doc);
        line.trim_end().to_owned()
    }

    fn parse(line: &str) -> Option<Self> {
        let (declared, comment) = line.split_once('#').unwrap_or((line, ""));
        let field = declared.trim().strip_prefix(Self::TYPE)?.trim().to_owned();
        let comment = comment.trim();
        let (signal, rest) = comment.split_once(' ').unwrap_or((comment, ""));
        let unit_and_doc = rest.trim().strip_prefix('[').and_then(|rest| rest.split_once(']'));
        let (unit, doc) = unit_and_doc.unwrap_or(("", rest));
        let signal = if signal.is_empty() { field.clone() } else { signal.to_owned() };
        Some(SignalField { field, signal, unit: unit.to_owned(), doc: doc.trim().to_owned() })
    }
}

/// The meaning of a signal.
fn doc(source: Source) -> String {
    match source {
        Source::Register(register) => {
            register.text().map_or_else(String::new, |text| text.doc.to_owned())
        }
        Source::Quantity(_) => String::new(),
    }
}

/// The names of the values of a signal, as constants of its type.
fn constants(source: Source) -> Vec<String> {
    let prefix = snake_case(&source.to_string()).to_uppercase();
    let named = |ty: &str, name: &str, value: u64| {
        format!("{ty} {prefix}_{}={value}", snake_case(name).to_uppercase())
    };
    let bytes = |names: &[(u8, &str)]| {
        names.iter().map(|(value, name)| named("uint8", name, (*value).into())).collect()
    };
    let quantity = |name| Quantity::named(name).ok().map(Source::Quantity);
    match source {
        Source::Register(RegisterId::STATUS) => bytes(Status::NAMES),
        Source::Register(RegisterId::CONTROL_MODE) => bytes(ControlMode::NAMES),
        // The low half occurred, the high half is present.
        Source::Register(RegisterId::FLAGS) => {
            let halves = [("OCCURRED", 0), ("PRESENT", 16)];
            let named = |(bit, name, _): &(u16, &str, &str)| {
                let (bit, name) = (u64::from(*bit), *name);
                halves.map(|(half, shift)| named("uint32", &format!("{half}_{name}"), bit << shift))
            };
            Flags::NAMES.iter().flat_map(named).collect()
        }
        it if Some(it) == quantity("errors") => {
            Errors::NAMES.iter().map(|(bit, name, _)| named("uint8", name, bit.0.into())).collect()
        }
        _ => Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use motorlink_proto::rmd::MotorId;
    use motorlink_proto::st::MotorNumber;
    use motorlink_telemetry::signal::Motor;

    fn st(names: &[&str]) -> SignalsType {
        let motor = Motor::St(MotorNumber::new(1).unwrap());
        let signals: Vec<_> =
            names.iter().map(|name| Signal::named(motor, name).unwrap()).collect();
        SignalsType::new("/st0/motor1/signals", &signals)
    }

    #[test]
    fn a_field_has_the_name_the_unit_and_the_meaning_of_its_signal() {
        let ty = st(&["SPEED_MEAS", "BUS_VOLTAGE"]);
        assert_eq!(ty.name(), "motorlink/msg/St0Motor1Signals");
        let text = ty.definition();
        let lines: Vec<&str> = text.lines().skip(1).take(4).collect();
        assert_eq!(
            lines,
            [
                "builtin_interfaces/Time stamp # the middle between the first request and the last reply",
                "float64 span_s # [s] the time between the two",
                "float64 speed_meas # SPEED_MEAS [rpm] Mechanical speed, averaged",
                "float64 bus_voltage # BUS_VOLTAGE [V] Bus voltage",
            ]
        );
    }

    #[test]
    fn codes_have_their_names_as_constants() {
        let text = st(&["STATUS", "CONTROL_MODE", "FLAGS"]).definition();
        for constant in [
            "uint8 STATUS_IDLE=0",
            "uint8 STATUS_FAULT_NOW=10",
            "uint8 CONTROL_MODE_SPEED=1",
            "uint32 FLAGS_OCCURRED_OVER_VOLT=2",
            "uint32 FLAGS_PRESENT_OVER_VOLT=131072",
        ] {
            assert!(text.lines().any(|line| line == constant), "{constant} in {text}");
        }
    }

    #[test]
    fn every_signal_can_be_read_from_the_definition() {
        let st = Motor::St(MotorNumber::new(1).unwrap());
        let rmd = Motor::Rmd(MotorId::new(1).unwrap());
        for motor in [st, rmd] {
            let sources = Source::all(motor).into_iter();
            let signals: Vec<_> = sources.map(|source| Signal { motor, source }).collect();
            let ty = SignalsType::new("/port/motor1/signals_2_hz", &signals);
            assert_eq!(ty.name(), "motorlink/msg/PortMotor1SignalsX2Hz");
            assert_eq!(SignalsType::parse(ty.name(), &ty.definition()), Some(ty));
        }
    }

    #[test]
    fn a_row_is_decoded_to_what_was_encoded() {
        let ty = st(&["SPEED_MEAS", "BUS_VOLTAGE"]);
        let row =
            SignalsRow { stamp: Time(3_000_000_007), span_s: 0.002, values: vec![-1.5, 24.0] };
        let bytes = ty.encode(&row);
        assert_eq!(bytes.len(), 4 + 8 + 8 + 16);
        assert_eq!(ty.decode(&bytes), Ok(row));
        assert_eq!(ty.decode(&bytes[..bytes.len() - 1]), Err(Malformed::Short));
    }

    #[test]
    fn a_type_of_another_program_is_not_taken_for_ours() {
        let ty = st(&["STATUS"]);
        assert_eq!(SignalsType::parse("other/msg/Signals", &ty.definition()), None);
        assert_eq!(SignalsType::parse("motorlink/msg/Frame", "uint8 direction\n"), None);
    }
}
