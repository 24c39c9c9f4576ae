//! Queries about motors, without a session: what drives are, their registers and their settings.

use std::io;
use std::sync::Arc;

use motorlink::settings::fact;
use motorlink_proto::st::ErrorCode;
use motorlink_telemetry::share::client::{Program, Refusal};
use motorlink_telemetry::share::drive_protocol::DriveProtocol;
use motorlink_telemetry::share::message::{Line, MotorName, Reason};
use motorlink_telemetry::share::motor_exchange::{Exchanges, Target};
use motorlink_telemetry::share::{drive_settings, drive_values};
use serde::Serialize;
use tokio::runtime::Handle;
use tokio::sync::Semaphore;
use tokio::task::block_in_place;
use zenoh::Wait;
use zenoh::bytes::Encoding;
use zenoh::key_expr::keyexpr;
use zenoh::query::Query;

use super::node_state::{Common, covers, refuse, reply_with};
use crate::key::{self, MotorQuery};
use crate::message::{Identity, NoAnswer};

/// Queries that are carried out at one time.
const MOST: usize = 4;
/// The longest name of a register that is looked for, in bytes.
const LONGEST: usize = 64;
/// The format of a file of settings.
const TOML: &str = "application/toml";

/// What answers queries about motors.
struct Queries {
    common: Arc<Common>,
    /// All queries are one program at the share, so that they take no more of a line than one.
    program: Program,
    places: Arc<Semaphore>,
}

/// A motor, and its line.
type Drive = (Line, Target);
/// The content of a reply.
type Content = (Vec<u8>, Encoding);
/// A reply with its key, or why there is none.
type Reply = (String, Result<Content, Refusal>);

/// Takes queries from now on.
pub(super) async fn open(common: &Arc<Common>) -> io::Result<()> {
    let (program, mut listener, _) = Program::connect(&common.share, "queries").await?;
    tokio::spawn(async move { while listener.next().await.is_ok() {} });
    let places = Arc::new(Semaphore::new(MOST));
    let queries = Arc::new(Queries { common: Arc::clone(common), program, places });
    for about in MotorQuery::ALL {
        let (queries, handle) = (Arc::clone(&queries), Handle::current());
        let take = move |query: Query| queries.take(about, query, &handle);
        let key = key::of_all_motors(&common.name, about.words());
        let declared = common.zenoh.declare_queryable(key).callback(take).background();
        declared.wait().map_err(io::Error::other)?;
    }
    Ok(())
}

impl Queries {
    fn take(self: &Arc<Self>, about: MotorQuery, query: Query, handle: &Handle) {
        let Ok(place) = Arc::clone(&self.places).try_acquire_owned() else {
            let message = format!("{MOST} such queries are carried out already; ask again");
            let busy = Refusal::new(Reason::Busy, message);
            return refuse(&query, &no_answer(query.key_expr(), busy));
        };
        let queries = Arc::clone(self);
        handle.spawn(async move {
            queries.answer(about, &query).await;
            drop(place);
        });
    }

    async fn answer(&self, about: MotorQuery, query: &Query) {
        self.common.refresh().await;
        let asked = query.key_expr();
        match self.drives(about, asked) {
            Ok(drives) => {
                for drive in drives {
                    let answers = self.read(about, drive, asked).await;
                    // A network that is slow must not hold up sessions.
                    block_in_place(|| say(query, answers));
                }
            }
            Err(why) => block_in_place(|| say(query, vec![(asked.to_string(), Err(why))])),
        }
    }

    /// The motors that a query is about: the one that it names, or those that have answered.
    fn drives(&self, about: MotorQuery, asked: &keyexpr) -> Result<Vec<Drive>, Refusal> {
        let lines = self.common.known_lines();
        let drive = |line: &Line, motor| {
            let speaks = DriveProtocol::of(line)?;
            Some((line.clone(), Target::of(&line.line, speaks.motor(motor)?, speaks)))
        };
        if let Some((name, number)) = key::one_motor(asked) {
            let line = lines.iter().find(|line| line.line == name).ok_or_else(|| {
                let known: Vec<_> = lines.iter().map(|line| line.line.as_str()).collect();
                Refusal::usage(format!("no line `{name}`; the lines are {}", known.join(", ")))
            })?;
            // Replies have the number as it is written elsewhere: not `01`.
            let motor = number.parse().ok().filter(|it: &u8| it.to_string() == number);
            let drive = motor.and_then(|motor| drive(line, motor)).ok_or_else(|| {
                Refusal::usage(format!("{name}: no motor can have the number `{number}`"))
            })?;
            return Ok(vec![drive]);
        }
        let all = lines.iter().flat_map(|line| line.heard.iter().map(move |motor| (line, *motor)));
        let key =
            |line: &Line, motor| key::of_motor(&self.common.name, &line.line, motor, about.words());
        let meant = all.filter(|(line, motor)| covers(asked, &key(line, *motor)));
        Ok(meant.filter_map(|(line, motor)| drive(line, motor)).collect())
    }

    /// The answers about a motor.
    async fn read(&self, about: MotorQuery, drive: Drive, asked: &keyexpr) -> Vec<Reply> {
        let MotorName { line, motor } = drive.1.name.clone();
        let answers = self.try_read(about, drive, asked).await;
        answers.unwrap_or_else(|why| {
            // What waited for a port that is lost has expired.
            let is_old = why.reason == Reason::Expired;
            let why = self.lost(&line).filter(|_| is_old).unwrap_or(why);
            let key = match key::one_motor(asked) {
                Some(_) => asked.to_string(),
                None => key::of_motor(&self.common.name, &line, motor, about.words()),
            };
            vec![(key, Err(why))]
        })
    }

    async fn try_read(
        &self,
        about: MotorQuery,
        (line, target): Drive,
        asked: &keyexpr,
    ) -> Result<Vec<Reply>, Refusal> {
        let motor = target.name.motor;
        let key = key::of_motor(&self.common.name, &line.line, motor, about.words());
        let of = |name: &String| key::register(&self.common.name, &line.line, motor, name);
        let mut registers = match about {
            MotorQuery::Registers => drive_values::all(target.speaks),
            MotorQuery::Identity | MotorQuery::Settings => Vec::new(),
        };
        registers.retain(|it| it.readable && covers(asked, &of(&it.name)));
        let mut names: Vec<_> = registers.into_iter().map(|it| it.name).collect();
        if about == MotorQuery::Registers && names.is_empty() {
            // A number, or a name that is refused with those that are alike.
            let Some(name) = key::one_register(asked) else { return Ok(vec![]) };
            if name.len() > LONGEST {
                return Err(Refusal::usage(format!(
                    "the name of a register has up to {LONGEST} bytes"
                )));
            }
            names.push(name.to_owned());
        }
        if let Some(why) = self.lost(&line.line) {
            return Err(why);
        }
        let exchanges = Exchanges::new(&self.program, &target);
        Ok(match about {
            MotorQuery::Identity => {
                let facts = drive_settings::identity(&exchanges).await?;
                let facts = facts.iter().map(|line| fact(line));
                let drive = facts.map(|(what, is)| (what.to_owned(), is.to_owned())).collect();
                let Line { line, protocol, profile, .. } = line;
                vec![(key, Ok(json(&Identity { line, motor, protocol, profile, drive })))]
            }
            MotorQuery::Settings => {
                let text = drive_settings::dump(&exchanges).await?.text();
                vec![(key, Ok((text.into_bytes(), Encoding::from(TOML))))]
            }
            MotorQuery::Registers => {
                let keys: Vec<_> = names.iter().map(of).collect();
                let values = drive_values::read_each(&exchanges, &names).await?.into_iter();
                keys.into_iter().zip(values.map(|value| value.map(|it| json(&it)))).collect()
            }
        })
    }

    /// Why nothing can be read of a line whose port is lost.
    fn lost(&self, line: &str) -> Option<Refusal> {
        self.common.lost(line).map(|message| Refusal::new(Reason::Line, message))
    }
}

/// Replies to a query.
fn say(query: &Query, answers: Vec<Reply>) {
    for (key, answer) in answers {
        match answer {
            Ok((bytes, encoding)) => reply_with(query, &key, bytes, encoding),
            Err(why) => refuse(query, &no_answer(&key, why)),
        }
    }
}

fn json(value: &impl Serialize) -> Content {
    (serde_json::to_vec(value).unwrap_or_default(), Encoding::APPLICATION_JSON)
}

fn no_answer(key: &str, mut why: Refusal) -> NoAnswer {
    // The drive itself says that it has no such motor.
    if why.code.map(ErrorCode::from) == Some(ErrorCode::BadMotorSelected) {
        why.reason = Reason::Unheard;
    }
    NoAnswer { key: key.to_owned(), why }
}
