//! A restore taken step by step, without a client: motors that no simulated drive is.

use motorlink::rmd::MotorId;
use motorlink::settings::{
    Answer, Ask, Cause, Comparison, Dump, Next, Permissions, Procedure, RestoreError, RmdBlock,
    RmdTuning, SettingsFile, StTuning, Step, StepError, Undone,
};
use motorlink::st::{MotorNumber, Profile};

const FILE: &str = "[rmd]\n[rmd.settings]\nspeed_kp = 5\nacceleration = 6\n";

/// The error of a step.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Failure {
    Refusal,
    Line,
    Interruption,
}

impl StepError for Failure {
    fn is_refusal(&self) -> bool {
        *self == Failure::Refusal
    }

    fn is_line_failure(&self) -> bool {
        *self == Failure::Line
    }

    fn is_interruption(&self) -> bool {
        *self == Failure::Interruption
    }
}

/// A motor with the settings of an RMD motor.
struct Motor {
    gains: Vec<i64>,
    acceleration: Vec<i64>,
    writes: u32,
    /// The outcome of a write: whether it is carried out, and its error. Writes count from 1.
    outcome: fn(u32) -> (bool, Option<Failure>),
    /// The gains that another program writes after the second write.
    others: Option<Vec<i64>>,
}

impl Motor {
    fn new(outcome: fn(u32) -> (bool, Option<Failure>)) -> Self {
        Motor { gains: vec![1; 6], acceleration: vec![0], writes: 0, outcome, others: None }
    }

    fn block(&mut self, id: RmdBlock) -> &mut Vec<i64> {
        match id {
            RmdBlock::Gains => &mut self.gains,
            _ => &mut self.acceleration,
        }
    }

    fn ask(&mut self, ask: Ask<RmdBlock>) -> Result<Answer, Failure> {
        match ask {
            Ask::Read(id) => Ok(Answer { digits: self.block(id).clone(), text: None }),
            Ask::Write(id, digits) => {
                self.writes += 1;
                let (is_done, error) = (self.outcome)(self.writes);
                if is_done {
                    *self.block(id) = digits;
                }
                if self.writes == 2
                    && let Some(gains) = self.others.take()
                {
                    self.gains = gains;
                }
                error.map_or(Ok(Answer::default()), Err)
            }
            _ => Ok(Answer::default()),
        }
    }

    fn take<T>(&mut self, mut procedure: Procedure<'_, RmdBlock, Failure, T>) -> T {
        loop {
            let outcome = match procedure.next() {
                Next::Done(result) => return result,
                Next::Step(Step::Ask(ask)) => self.ask(ask),
                Next::Step(_) => Ok(Answer::default()),
            };
            procedure.answered(outcome);
        }
    }

    fn restore(&mut self) -> Undone<Failure> {
        let tuning = RmdTuning { motor: MotorId::new(1).unwrap() };
        let file = SettingsFile::parse(FILE, &tuning).unwrap();
        let comparison = self.take(Comparison::reading(tuning, &file));
        let comparison = comparison.map_err(|unread| unread.error).unwrap();
        match self.take(comparison.restoring(Permissions::default(), || false)) {
            Err(RestoreError::Undone(undone)) => *undone,
            other => panic!("{other:?}"),
        }
    }
}

#[test]
fn a_step_is_the_same_until_it_is_answered() {
    let tuning = RmdTuning { motor: MotorId::new(1).unwrap() };
    let mut procedure = Dump::reading::<_, Failure>(tuning);
    for _ in 0..2 {
        let Next::Step(Step::Ask(ask)) = procedure.next() else { panic!("it has to ask first") };
        assert_eq!(ask, Ask::Read(RmdBlock::Gains));
    }
    procedure.answered(Err(Failure::Line));
    assert!(matches!(procedure.next(), Next::Done(Err(Failure::Line))));
}

#[test]
fn a_drive_may_refuse_to_say_what_it_is_and_may_not_be_silent() {
    for (error, is_read_on) in [(Failure::Refusal, true), (Failure::Line, false)] {
        let motor = MotorNumber::new(1).unwrap();
        let mut procedure =
            Dump::reading::<_, Failure>(StTuning { motor, profile: Profile::Mcsdk54 });
        let Next::Step(Step::Ask(ask)) = procedure.next() else { panic!("it has to ask first") };
        assert!(matches!(ask, Ask::Identity(0)));
        procedure.answered(Err(error));
        assert_eq!(matches!(procedure.next(), Next::Step(_)), is_read_on, "{error:?}");
    }
}

#[test]
fn a_write_that_was_refused_and_carried_out_is_rolled_back() {
    let mut motor = Motor::new(|write| (true, (write == 2).then_some(Failure::Refusal)));
    let undone = motor.restore();
    assert_eq!(undone.rolled_back, ["speed_kp", "acceleration"]);
    assert_eq!((motor.gains, motor.acceleration), (vec![1; 6], vec![0]));

    let mut motor = Motor::new(|write| (write != 2, (write == 2).then_some(Failure::Refusal)));
    let undone = motor.restore();
    assert_eq!(undone.rolled_back, ["speed_kp"]);
    assert_eq!(
        undone.cause,
        Cause::Exchange { settings: vec!["acceleration".to_owned()], error: Failure::Refusal }
    );
    assert_eq!(motor.gains, vec![1; 6]);
}

#[test]
fn an_interruption_puts_the_old_values_back_and_a_second_one_ends_that() {
    let mut motor = Motor::new(|write| (true, (write == 2).then_some(Failure::Interruption)));
    let undone = motor.restore();
    assert_eq!(undone.rolled_back, ["speed_kp", "acceleration"]);
    assert_eq!((motor.gains, motor.acceleration), (vec![1; 6], vec![0]));

    let mut motor = Motor::new(|write| (true, (write >= 2).then_some(Failure::Interruption)));
    let undone = motor.restore();
    assert_eq!(
        (undone.changed, undone.unknown),
        (vec!["speed_kp".to_owned()], vec!["acceleration".to_owned()])
    );
    assert_eq!((motor.gains[2], motor.writes), (5, 3));
}

#[test]
fn a_setting_that_another_program_writes_meanwhile_is_noticed() {
    let mut motor = Motor::new(|_| (true, None));
    motor.others = Some(vec![9; 6]);
    let undone = motor.restore();
    let Cause::Differs { settings } = &undone.cause else { panic!("{:?}", undone.cause) };
    assert_eq!(settings[2], "speed_kp 5 (it has 9)");
    assert_eq!(undone.rolled_back, ["speed_kp", "acceleration"]);
    assert_eq!((motor.gains, motor.acceleration), (vec![1; 6], vec![0]));
}
