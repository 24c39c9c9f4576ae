//! Motion of pages: the reference goes from the measured value to a target, at a rate.
//!
//! All commands of a run but the first, which reads, continue it (`continues` of a share's command): none of
//! them is sent after a stop.

use std::sync::Arc;
use std::time::Duration;

use motorlink_proto::rmd::{
    Command as _, MotionStatus, MotorId, MultiTurnAngle, Payload, ReadMotionStatus,
    ReadMultiTurnAngle, SetPositionLimited, SetSpeed, SetTorque,
};
use motorlink_proto::st::{
    Command, CurrentReference, Flags, MotorNumber, NotStarted, Profile, Ramp, RegisterId,
    Request as StRequest, Status, TorqueRamp,
};
use motorlink_proto::units::{CentiDegrees, CentiDps, IqCommand, Quantity, Scale, SpeedLimit};
use motorlink_telemetry::line::Request;
use motorlink_telemetry::share::client::{Program, Refusal};
use motorlink_telemetry::share::drive_protocol::DriveProtocol;
use motorlink_telemetry::share::message::Reason;
use motorlink_telemetry::share::motor_exchange::{ATTEMPTS, Exchanges, Target, is_worth_repeating};
use motorlink_telemetry::signal::Motor;
use tokio::sync::watch;
use tokio::time::{Instant, MissedTickBehavior, interval_at};

use super::command_execution::started;
use super::motion_control::{Control, MOTION, MotionPermit, MotionSession, Running, send};
use crate::message::{Answer, Mode, RunResult};

/// The time between two references.
const PERIOD: Duration = Duration::from_millis(20);
/// The target is sent so often: its reply may be a late one to the reference before it.
const LAST: u32 = 3;
/// References that no reply has acknowledged for so long are given up, and the motor is stopped. A motor
/// that lost its power for longer is not set moving by the next one.
const PATIENCE: Duration = Duration::from_millis(500);

/// A motion of a page.
pub(super) struct Run {
    pub(super) target: Target,
    pub(super) mode: Mode,
    pub(super) to: f64,
    pub(super) rate: f64,
    pub(super) hold: bool,
}

/// References that are sent again and again.
#[derive(Clone, Copy)]
enum Stream {
    /// The speed of an RMD motor.
    Speed(MotorId),
    /// The torque current of an RMD motor.
    Torque(MotorId),
    /// Iq of an ST motor, with this Id.
    Current(MotorNumber, i16),
}

impl Stream {
    /// The command of this reference.
    fn request(self, value: f64) -> Result<Request, Refusal> {
        Ok(match self {
            Stream::Speed(id) => Request::rmd(id, &SetSpeed { speed: wanted::<CentiDps>(value)? }),
            Stream::Torque(id) => Request::rmd(id, &SetTorque { iq: wanted::<IqCommand>(value)? }),
            Stream::Current(motor, id_s16a) => {
                let iq_s16a = current(value)?;
                let reference = CurrentReference { iq_s16a, id_s16a };
                Request::st(motor.number(), StRequest::SetCurrentReference(reference))
            }
        })
    }
}

impl Run {
    /// Begins it; gives the first reference.
    pub(super) async fn carry_out(
        self,
        control: &Arc<Control>,
        drive: &impl MotionPermit,
    ) -> Result<Answer, Refusal> {
        if !(self.rate.is_finite() && self.rate > 0.0) {
            let message = format!("the rate {} is not a positive number", self.rate);
            return Err(Refusal::unsent(message));
        }
        self.check(control)?;
        let stops = control.stops(&self.target);
        let _turn = control.turn(&self.target).await;
        control.end_run(&self.target).await;
        let permitted = MotionSession::new(drive, self.hold, stops).await?;
        let begun = Begun { run: &self, control, permitted };
        let (from, streams) = match (self.target.motor, self.target.speaks, self.mode) {
            (Motor::Rmd(id), _, Mode::Speed) => {
                let measured = begun.motion_status(id).await?.speed.dps();
                (begun.stream(Stream::Speed(id), measured).await?, true)
            }
            (Motor::Rmd(id), _, Mode::Torque) => {
                let measured = begun.motion_status(id).await?.iq.amps();
                (begun.stream(Stream::Torque(id), measured).await?, true)
            }
            (Motor::Rmd(id), _, Mode::Position) => (begun.position(id).await?, false),
            (Motor::St(motor), _, Mode::Speed) => (begun.st_speed(motor).await?, false),
            (Motor::St(motor), DriveProtocol::St(Profile::Mcsdk54), Mode::Torque) => {
                (begun.st_torque_ramp(motor).await?, false)
            }
            (Motor::St(motor), DriveProtocol::St(Profile::Spec), Mode::Torque) => {
                (begun.st_current(motor).await?, true)
            }
            (Motor::St(_), ..) => return Err(no_position()),
        };
        Ok(Answer::Run { from, streams })
    }

    /// Checks the last command before anything is sent.
    fn check(&self, control: &Control) -> Result<(), Refusal> {
        let last = match (self.target.motor, self.mode) {
            (Motor::Rmd(id), Mode::Speed) => Stream::Speed(id).request(self.to)?,
            (Motor::Rmd(id), Mode::Torque) => Stream::Torque(id).request(self.to)?,
            (Motor::Rmd(id), Mode::Position) => self.position(id)?,
            (Motor::St(motor), Mode::Speed) => {
                let ramp = Ramp { speed_rpm: speed(self.to)?, duration_ms: 0 };
                Request::st(motor.number(), StRequest::SetRamp(ramp))
            }
            (Motor::St(motor), Mode::Torque) => {
                if let Some(limit) = control
                    .limited(&self.target, |limited| limited.most(self.target.motor, Mode::Speed))
                {
                    return Err(Refusal::unsent(format!(
                        "the motor of a torque command turns as fast as its load allows, and its speed is \
                         limited to {limit} rpm"
                    )));
                }
                Stream::Current(motor, 0).request(self.to)?
            }
            (Motor::St(_), Mode::Position) => return Err(no_position()),
        };
        control.limited(&self.target, |limited| limited.check(&last)).map(drop)
    }

    fn position(&self, id: MotorId) -> Result<Request, Refusal> {
        let angle = wanted::<CentiDegrees>(self.to)?;
        let max_speed = wanted::<SpeedLimit>(self.rate)?;
        Ok(Request::rmd(id, &SetPositionLimited { max_speed, angle }))
    }

    /// How long a ramp of the drive takes, in ms: never faster than the rate.
    fn duration(&self, from: f64) -> Result<u16, Refusal> {
        let way = (self.to - from).abs();
        let duration = (1000.0 * way / self.rate).ceil();
        let most = f64::from(u16::MAX);
        if duration > most {
            let least = 1000.0 * way / most;
            return Err(Refusal::unsent(format!(
                "a ramp of the drive lasts up to {} s: the rate is {least:.1} or more",
                most / 1000.0
            )));
        }
        Ok(duration as u16)
    }
}

/// A run that its page may carry out.
struct Begun<'a, M> {
    run: &'a Run,
    control: &'a Arc<Control>,
    permitted: MotionSession<'a, M>,
}

impl<M: MotionPermit> Begun<'_, M> {
    fn target(&self) -> &Target {
        &self.run.target
    }

    fn reads(&self) -> Exchanges<'_> {
        Exchanges::new(&self.permitted.program, self.target())
    }

    async fn command(&self, request: &Request) -> Result<(), Refusal> {
        let exchanges = self.reads().within(MOTION).continues();
        send(self.control, &exchanges, request).await.map(drop)
    }

    async fn motion_status(&self, id: MotorId) -> Result<MotionStatus, Refusal> {
        let request = Request::Rmd(id, ReadMotionStatus.encode());
        let reply = self.measure(&[request]).await?;
        Ok(MotionStatus::decode(&self.eight(&reply)?))
    }

    fn eight(&self, replies: &[Vec<u8>]) -> Result<[u8; 8], Refusal> {
        let reply = replies.first().and_then(|reply| reply.as_slice().try_into().ok());
        reply.ok_or_else(|| self.reads().unfit())
    }

    /// Reads what a run begins with. Its replies are confirmed.
    async fn measure(&self, requests: &[Request]) -> Result<Vec<Vec<u8>>, Refusal> {
        // Only the first one begins the sequence: a stop after it ends the run.
        let (mut reads, mut attempt) = (self.reads(), 1);
        loop {
            let mut replies = Vec::new();
            for request in requests {
                replies.push(reads.request(request).await?);
                reads = reads.continues();
            }
            match reads.confirm().await {
                Ok(()) => return self.permitted.check().await.map(|()| replies),
                Err(why) if is_worth_repeating(&why) && attempt < ATTEMPTS => attempt += 1,
                Err(why) => return Err(why),
            }
        }
    }

    /// Registers of an ST motor.
    async fn registers(&self, registers: &[RegisterId]) -> Result<Vec<i32>, Refusal> {
        let Some((motor, profile)) = self.reads().of_st() else {
            return Err(Refusal::usage("not an ST motor"));
        };
        let read =
            |register: &RegisterId| Request::st(motor.number(), StRequest::GetRegister(*register));
        let requests: Vec<_> = registers.iter().map(read).collect();
        let replies = self.measure(&requests).await?;
        let bits = registers.iter().zip(replies).map(|(register, reply)| {
            register.decode(profile, &reply).ok_or_else(|| self.reads().unfit())
        });
        bits.collect()
    }

    /// The measured value, or the limit if that is less.
    fn first(&self, measured: f64) -> f64 {
        let most = self
            .control
            .limited(self.target(), |limited| limited.most(self.target().motor, self.run.mode));
        most.map_or(measured, |most| measured.clamp(-most, most))
    }

    /// Sends references at the rate until the target is reached.
    async fn stream(&self, stream: Stream, measured: f64) -> Result<f64, Refusal> {
        let from = self.first(measured);
        let references = self.references(stream);
        if let Err(why) = self.command(&stream.request(from)?).await {
            // The motor may have the reference, whose reply was lost.
            let is_unknown = matches!(
                why.reason,
                Reason::Silent | Reason::Unheard | Reason::Unconfirmed | Reason::Line
            );
            let message = if is_unknown { references.stop(&why).await } else { why.message };
            return Err(Refusal { message, ..why });
        }
        self.go_on(references, from);
        Ok(from)
    }

    /// The references of the run.
    fn references(&self, stream: Stream) -> References {
        References {
            control: Arc::clone(self.control),
            program: self.permitted.program.clone(),
            target: self.target().clone(),
            stream,
            to: self.run.to,
            rate: self.run.rate,
        }
    }

    /// Sends the next references in a task of their own.
    fn go_on(&self, references: References, from: f64) {
        let (ends, ended) = watch::channel(false);
        let report = self.permitted.drive.report();
        let task = tokio::spawn(references.send(from, ended, report));
        self.control.set_run(self.target(), Running { ends, task });
    }

    /// The drive's own move. It begins at the angle of the motor.
    async fn position(&self, id: MotorId) -> Result<f64, Refusal> {
        let reply = self.measure(&[Request::Rmd(id, ReadMultiTurnAngle.encode())]).await?;
        let from = MultiTurnAngle::decode(&self.eight(&reply)?).angle.degrees();
        self.command(&self.run.position(id)?).await?;
        Ok(from)
    }

    /// A ramp of the drive. START_MOTOR also makes the page responsible for a motor that turns already.
    async fn st_speed(&self, motor: MotorNumber) -> Result<f64, Refusal> {
        let (status, read) = self.state(&[RegisterId::SPEED_MEAS]).await?;
        if status == Status::Idle && self.run.to == 0.0 {
            let place = self.reads().place();
            let message = format!("{place}: it is at rest, and the target is 0");
            return Err(Refusal::unsent(message));
        }
        let from = f64::from(read[0]);
        let ramp = Ramp { speed_rpm: speed(self.run.to)?, duration_ms: self.run.duration(from)? };
        self.command(&Request::st(motor.number(), StRequest::SetRamp(ramp))).await?;
        self.start(motor).await?;
        Ok(from)
    }

    /// A ramp of the drive.
    async fn st_torque_ramp(&self, motor: MotorNumber) -> Result<f64, Refusal> {
        let (_, read) = self.state(&[RegisterId::TORQUE_MEAS]).await?;
        let from = f64::from(read[0]);
        let torque_s16a = current(self.run.to)?.into();
        let ramp = TorqueRamp { torque_s16a, duration_ms: self.run.duration(from)? };
        self.command(&Request::st(motor.number(), StRequest::SetTorqueRamp(ramp))).await?;
        self.start(motor).await?;
        Ok(from)
    }

    /// The document has no torque ramp: references are sent one by one.
    async fn st_current(&self, motor: MotorNumber) -> Result<f64, Refusal> {
        let (_, read) = self.state(&[RegisterId::TORQUE_MEAS, RegisterId::FLUX_REF]).await?;
        let from = self.first(f64::from(read[0]));
        let stream = Stream::Current(motor, read[1] as i16);
        self.command(&stream.request(from)?).await?;
        self.start(motor).await?;
        self.go_on(self.references(stream), from);
        Ok(from)
    }

    /// The state and registers of a motor that can be started.
    async fn state(&self, registers: &[RegisterId]) -> Result<(Status, Vec<i32>), Refusal> {
        let always = [RegisterId::STATUS, RegisterId::FLAGS];
        let mut read = self.registers(&[&always, registers].concat()).await?;
        let rest = read.split_off(always.len());
        let (status, flags) = (Status::from(read[0] as u8), Flags(read[1] as u32));
        let why = match status {
            Status::FaultNow | Status::FaultOver => NotStarted::Faults { status, flags },
            Status::AnyStop | Status::Stop | Status::StopIdle | Status::WaitStopMotor => {
                NotStarted::Stopping { status }
            }
            _ => return Ok((status, rest)),
        };
        let message = format!("{}: the motor does not start: {why}", self.reads().place());
        Err(Refusal::new(Reason::Refused, message))
    }

    async fn start(&self, motor: MotorNumber) -> Result<(), Refusal> {
        let start = StRequest::ExecuteCommand(Command::StartMotor);
        self.command(&Request::st(motor.number(), start)).await?;
        started(&self.reads().continues()).await
    }
}

/// The references of a run after the first one.
struct References {
    control: Arc<Control>,
    program: Program,
    target: Target,
    stream: Stream,
    to: f64,
    rate: f64,
}

impl References {
    /// Sends them until the target is reached, one fails, or `ended` becomes true.
    async fn send(
        self,
        from: f64,
        mut ended: watch::Receiver<bool>,
        report: impl FnOnce(RunResult) + Send,
    ) {
        let mut ticks = interval_at(Instant::now() + PERIOD, PERIOD);
        ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let mut reference = from;
        let mut acknowledged = Instant::now();
        let (mut repeats, mut failure) = (0, None);
        while (reference != self.to || repeats < LAST) && failure.is_none() {
            tokio::select! {
                biased;
                _ = ended.changed() => return,
                _ = ticks.tick() => {}
            }
            // After a pause of the server the reference continues where it was, without a jump.
            let step = self.rate * PERIOD.as_secs_f64();
            let left = self.to - reference;
            let next = if left.abs() <= step { self.to } else { reference + step.copysign(left) };
            match self.send_one(next, repeats + 1 == LAST).await {
                Ok(()) => {
                    (reference, acknowledged) = (next, Instant::now());
                    repeats += u32::from(next == self.to);
                }
                Err(why) if is_ended_by_others(&why) => return,
                // The same reference is sent again: the motor may have it already.
                Err(_) if acknowledged.elapsed() < PATIENCE => {}
                Err(why) => failure = Some(self.stop(&why).await),
            }
        }
        report(RunResult { motor: self.target.name.clone(), reference, failure });
    }

    /// Sends one. The replies so far are confirmed with the last one.
    async fn send_one(&self, reference: f64, is_last: bool) -> Result<(), Refusal> {
        let exchanges = Exchanges::new(&self.program, &self.target).within(MOTION).continues();
        let request = self.stream.request(reference)?;
        if !is_last {
            return send(&self.control, &exchanges, &request).await.map(drop);
        }
        let _lane = exchanges.lane().await;
        send(&self.control, &exchanges, &request).await?;
        exchanges.confirm().await
    }

    /// The motor must not keep turning at a speed in between. Gives why it was stopped, and how it took that.
    async fn stop(&self, why: &Refusal) -> String {
        self.control.stopping(&self.target);
        let stop = Request::stop(self.target.motor);
        let exchanges = Exchanges::new(&self.program, &self.target).own();
        let stopped = match exchanges.request(&stop).await {
            Ok(_) => "the motor confirmed its stop".to_owned(),
            Err(other) if other.reason == Reason::Held => other.message,
            Err(failure) => {
                format!("it did not confirm its stop and may keep turning: {}", failure.message)
            }
        };
        format!("{}; {stopped}", why.message)
    }
}

/// Whether a stop, another command or the end of the page ended the references. An event says so.
fn is_ended_by_others(why: &Refusal) -> bool {
    use Reason::{Displaced, Held, Lapsed, Latched, Overtaken};
    matches!(why.reason, Displaced | Held | Lapsed | Latched | Overtaken)
}

fn wanted<Q: Quantity>(value: f64) -> Result<Q, Refusal> {
    Q::wanted(value).map_err(Refusal::unsent)
}

/// A speed of an ST motor, rpm.
fn speed(value: f64) -> Result<i32, Refusal> {
    let most = i64::from(Ramp::MAX_SPEED_RPM);
    whole(value, Scale::plain(-most, most)).map(|digits| digits as i32)
}

/// A current of an ST motor in its digits.
fn current(value: f64) -> Result<i16, Refusal> {
    whole(value, Scale::plain(i16::MIN.into(), i16::MAX.into())).map(|digits| digits as i16)
}

fn whole(value: f64, scale: Scale) -> Result<i64, Refusal> {
    scale.wanted(value).map_err(Refusal::unsent)
}

fn no_position() -> Refusal {
    Refusal::unsent("the position of an ST motor cannot be controlled like this")
}
