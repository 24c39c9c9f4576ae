//! Settings of a motor, with their value before and after: gains, acceleration limit, encoder offset.

use motorlink::rmd::{Acceleration, DpsPerSecond, EncoderOffset, Error, Field, Payload, Pid};

use super::session::Session;
use crate::failure::Failure;
use crate::json::Row;
use crate::output::in_words;

/// `rmd pid`: shows the gains, or sets some or all of them.
pub fn pid(session: &Session, words: &[String]) -> Result<(), Failure> {
    let motor = session.motor()?;
    if words.is_empty() {
        return session.show(&motor.pid()?);
    }
    let change = GainChange::parse(words)?;
    let before = motor.pid().map_err(|error| unwritten(error, "the gains were"))?;
    session.confirm()?;
    let wanted = change.on(before);
    match session.write_rom {
        true => motor.write_pid_rom(wanted)?,
        false => motor.write_pid_ram(wanted)?,
    }
    let after = motor.pid().map_err(|error| unread(error, "the gains"))?;
    session.confirm()?;
    let until = if session.write_rom { "for good" } else { "until power-off" };
    let what = format!("gains {until}");
    changed(session, &what, &before, &wanted, &after)
}

/// `rmd acceleration`: shows the limit, or sets it.
pub fn acceleration(session: &Session, limit: Option<f64>) -> Result<(), Failure> {
    let motor = session.motor()?;
    let Some(limit) = limit else {
        return session.show(&Acceleration { acceleration: motor.acceleration()? });
    };
    let limit: DpsPerSecond = session.units.wanted(limit)?;
    let before = motor.acceleration().map_err(|error| unwritten(error, "the limit was"))?;
    motor.write_acceleration_ram(limit)?;
    let after = motor.acceleration().map_err(|error| unread(error, "the limit"))?;
    session.confirm()?;
    let [before, limit, after] =
        [before, limit, after].map(|acceleration| Acceleration { acceleration });
    changed(session, "acceleration limit until power-off", &before, &limit, &after)
}

/// `rmd encoder-offset`: the reply to the write has the offset that the motor took.
pub fn encoder_offset(session: &Session, offset: u16) -> Result<(), Failure> {
    session.rom("setting the encoder offset")?;
    // Refuses an offset beyond --encoder-bits before it is written.
    session.rows(&EncoderOffset { offset }).map_err(|failure| failure.then("nothing was sent"))?;
    let motor = session.motor()?;
    let before = motor.encoder().map_err(|error| unwritten(error, "the offset was"))?.offset;
    session.confirm()?;
    let after = motor.write_encoder_offset_rom(offset)?;
    let [before, offset, after] = [before, offset, after].map(|offset| EncoderOffset { offset });
    changed(session, "encoder offset for good", &before, &offset, &after)
}

/// Shows each value with the one before; fails unless the motor has what was written.
fn changed<P: Payload + PartialEq>(
    session: &Session,
    what: &str,
    before: &P,
    wanted: &P,
    after: &P,
) -> Result<(), Failure> {
    let (old, written, new) = (session.rows(before)?, session.rows(wanted)?, session.rows(after)?);
    let object = session.line(session.id).with_values("before", &old);
    let id = session.id;
    if wanted != after {
        let pairs = written.iter().zip(&new).filter(|(written, new)| written.text != new.text);
        let differences: Vec<String> = pairs
            .map(|(written, new)| {
                format!("{} is {} instead of {}", in_words(&new.name), new.text, written.text)
            })
            .collect();
        let failure = Failure::refused(format!(
            "motor {id} has other values than were written: {}",
            differences.join(", ")
        ))
        .trying(
            "either the motor does not take these values, or another program changed them; read them \
             again",
        )
        .about(&session.port, id);
        if session.output.json {
            session.output.result("", object.failed(&failure).values(&new))?;
        }
        return Err(failure);
    }
    session
        .output
        .result(format!("motor {id}, {what}:\n{}", pairs(&old, &new)), object.ok(true).values(&new))
}

/// A line for each value: what it was, what it is.
fn pairs(before: &[Row], after: &[Row]) -> String {
    let names = after.iter().map(|row| in_words(&row.name).len()).max().unwrap_or(0);
    let lines = before.iter().zip(after).map(|(before, after)| {
        let name = in_words(&after.name);
        match before.text == after.text {
            true => format!("{name:<names$}  is {}, as before", after.text),
            false => format!("{name:<names$}  was {}, is {}", before.text, after.text),
        }
    });
    lines.collect::<Vec<_>>().join("\n")
}

/// The old value could not be read, so nothing was written.
fn unwritten(error: Error, what: &str) -> Failure {
    Failure::from(error).with_fact(format!("{what} not written"))
}

/// The write was confirmed, but the new value could not be read.
fn unread(error: Error, what: &str) -> Failure {
    let fact = format!("the motor confirmed the write, but {what} could not be read back");
    Failure::from(error).with_fact(fact)
}

/// Which gains are set.
pub enum GainChange {
    /// All, in the order of the frame.
    All([u8; Pid::FIELDS.len()]),
    /// Some, by their index in [`Pid::FIELDS`].
    Some(Vec<(usize, u8)>),
}

impl GainChange {
    pub fn parse(words: &[String]) -> Result<Self, Failure> {
        if words.iter().any(|word| word.contains('=')) {
            return words
                .iter()
                .map(|word| named_gain(word))
                .collect::<Result<_, _>>()
                .map(Self::Some);
        }
        let gains: Vec<u8> = words.iter().map(|word| gain(word)).collect::<Result<_, _>>()?;
        let all = gains.as_slice().try_into().map(Self::All);
        all.map_err(|_| {
            Failure::usage(format!("{} gains are given, and a motor has six", words.len()))
                .trying(format!("give all six, or name them: {}", example()))
        })
    }

    /// The gains after the change.
    pub fn on(&self, gains: Pid) -> Pid {
        let mut data = gains.encode_as(0);
        let mut put = |index: usize, gain: u8| {
            data[usize::from(Pid::FIELDS[index].offset)] = gain;
        };
        match self {
            GainChange::All(all) => {
                all.iter().enumerate().for_each(|(index, &gain)| put(index, gain))
            }
            GainChange::Some(some) => some.iter().for_each(|&(index, gain)| put(index, gain)),
        }
        Pid::decode(&data)
    }
}

fn named_gain(word: &str) -> Result<(usize, u8), Failure> {
    let (name, value) = word.split_once('=').unwrap_or((word, ""));
    let plain = name.to_ascii_lowercase().replace('-', "_");
    let index = Pid::FIELDS.iter().position(|field| field.name == plain);
    let Some(index) = index else {
        let names: Vec<&str> = Pid::FIELDS.iter().map(|field| field.name).collect();
        return Err(Failure::usage(format!("a motor has no gain `{name}`"))
            .trying(format!("the gains are {}", names.join(", "))));
    };
    Ok((index, gain(value)?))
}

fn gain(word: &str) -> Result<u8, Failure> {
    gain_alone(word).map_err(|failure| failure.trying(format!("write it as {}", example())))
}

/// A gain without its name.
pub fn gain_alone(word: &str) -> Result<u8, Failure> {
    word.parse().map_err(|_| {
        Failure::usage(format!(
            "`{word}` is not a gain: a gain is a whole number from {}",
            range(&Pid::FIELDS[0])
        ))
    })
}

/// The range of a field, in digits.
pub fn range(field: &Field) -> String {
    format!("{} to {}", field.scale.least, field.scale.most)
}

/// How a gain is set, for advice.
fn example() -> String {
    format!("{}=120", Pid::FIELDS[2].name)
}
