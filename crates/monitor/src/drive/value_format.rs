//! Values that were read, as a page gets them.

use motorlink::settings::Setting;
use motorlink_proto::rmd::{Field, Meaning};
use motorlink_proto::st::Reading;
use motorlink_proto::units::Scale;

use crate::message::Value;

/// A value of a register of an ST drive.
pub(super) fn of_register(name: &str, reading: Reading) -> Value {
    let name = name.to_owned();
    match reading.plausible() {
        Err(why) => Value { name, value: None, text: why.to_string() },
        Ok(reading) => {
            let value = reading.value();
            let text = reading.name().unwrap_or_else(|| match reading.decimals() {
                Some(decimals) => format!("{value:.*}", usize::from(decimals)),
                None => (value as f32).to_string(),
            });
            Value { name, value: Some(value), text }
        }
    }
}

/// A value of a reply of an RMD motor.
pub(super) fn of_field(name: String, field: &Field, data: &[u8; 8]) -> Value {
    let text = match field.meaning {
        Meaning::Number => number(&field.scale, field.raw(data)),
        Meaning::Words(_) | Meaning::Bits(_) => field.shown(data).to_string(),
    };
    Value { name, value: Some(field.value(data)), text }
}

/// A setting.
pub(super) fn of_setting(setting: &Setting, digits: i64) -> Value {
    let (name, text) = (setting.name.clone(), setting.number(digits));
    Value { name, value: Some(setting.scale.value(digits)), text }
}

/// A text without a number.
pub(super) fn text(name: &str, text: impl Into<String>) -> Value {
    Value { name: name.to_owned(), value: None, text: text.into() }
}

fn number(scale: &Scale, digits: i64) -> String {
    format!("{:.*}", usize::from(scale.decimals), scale.value(digits))
}

/// The least and the most value of a request, and the step between values.
pub(super) fn range(scale: &Scale) -> [f64; 3] {
    [scale.value(scale.least), scale.value(scale.most), scale.digit]
}
