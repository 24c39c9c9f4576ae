//! A dump, a comparison or a restore as steps: requests out, replies in. Blocking clients, event loops
//! and Python drive the same steps.
//!
//! The steps are async functions, so that they can be read from top to bottom. They need no executor:
//! a [`Procedure`] polls them each time a step is answered.

use std::mem;
use std::pin::Pin;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll, Waker};

use super::{Answer, Ask, Tunable, Tuning};

/// What a procedure wants next.
#[derive(Debug, Clone, PartialEq)]
pub enum Step<Id> {
    /// One exchange.
    Ask(Ask<Id>),
    /// A check of this request against the limits of the client. Sends nothing.
    Check(Ask<Id>),
    /// A check that replies and requests match.
    Confirm,
}

/// The next step of a procedure, or its result.
#[derive(Debug)]
pub enum Next<Id, T> {
    /// Take this step, and give its outcome to [`Procedure::answered`].
    Step(Step<Id>),
    /// It is over.
    Done(T),
}

/// A dump, a comparison or a restore in progress, which gives a `T`.
pub struct Procedure<'a, Id, E, T> {
    steps: Pin<Box<dyn Future<Output = T> + Send + 'a>>,
    line: Line<Id, E>,
}

impl<'a, Id: Clone, E, T> Procedure<'a, Id, E, T> {
    pub(super) fn new<F: Future<Output = T> + Send + 'a>(
        begin: impl FnOnce(Line<Id, E>) -> F,
    ) -> Self {
        let line = Line(Arc::new(Mutex::new(Slot::Empty)));
        Procedure { steps: Box::pin(begin(line.clone())), line }
    }

    /// The next step: the same one until it is answered. Not to be called after [`Next::Done`].
    #[expect(clippy::should_implement_trait, reason = "an iterator has no result")]
    pub fn next(&mut self) -> Next<Id, T> {
        match self.steps.as_mut().poll(&mut Context::from_waker(Waker::noop())) {
            Poll::Ready(result) => Next::Done(result),
            Poll::Pending => match &*self.line.slot() {
                Slot::Wanted(step) => Next::Step(step.clone()),
                _ => unreachable!("only steps are waited for"),
            },
        }
    }

    /// Takes the outcome of the last step. That of a check and of a confirmation is an empty answer.
    pub fn answered(&mut self, outcome: Result<Answer, E>) {
        *self.line.slot() = Slot::Answered(outcome);
    }

    /// Takes all steps, and waits for them.
    pub fn run<M: Tunable<Error = E>>(mut self, motor: &M) -> T
    where
        M::Tuning: Tuning<Id = Id>,
    {
        loop {
            let outcome = match self.next() {
                Next::Done(result) => return result,
                Next::Step(Step::Ask(ask)) => motor.ask(&ask),
                Next::Step(Step::Check(ask)) => motor.check(&ask).map(|()| Answer::default()),
                Next::Step(Step::Confirm) => motor.confirm().map(|()| Answer::default()),
            };
            self.answered(outcome);
        }
    }
}

/// Where a procedure leaves its steps, and finds their outcomes.
pub(super) struct Line<Id, E>(Arc<Mutex<Slot<Id, E>>>);

enum Slot<Id, E> {
    Empty,
    Wanted(Step<Id>),
    Answered(Result<Answer, E>),
}

impl<Id, E> Clone for Line<Id, E> {
    fn clone(&self) -> Self {
        Line(Arc::clone(&self.0))
    }
}

impl<Id, E> Line<Id, E> {
    pub(super) async fn identity(&self, line: u8) -> Result<Option<String>, E> {
        self.ask(Ask::Identity(line)).await.map(|answer| answer.text)
    }

    pub(super) async fn read(&self, block: Id) -> Result<Vec<i64>, E> {
        self.ask(Ask::Read(block)).await.map(|answer| answer.digits)
    }

    pub(super) async fn write(&self, block: Id, digits: Vec<i64>) -> Result<(), E> {
        self.ask(Ask::Write(block, digits)).await.map(drop)
    }

    pub(super) async fn keep(&self, block: Id, digits: Vec<i64>) -> Result<(), E> {
        self.ask(Ask::Keep(block, digits)).await.map(drop)
    }

    /// What the motor does, unless it is at rest.
    pub(super) async fn motion(&self) -> Result<Option<String>, E> {
        self.ask(Ask::Motion).await.map(|answer| answer.text)
    }

    /// Checks a write against the limits of the client.
    pub(super) async fn check(&self, block: Id, digits: Vec<i64>) -> Result<(), E> {
        self.take(Step::Check(Ask::Write(block, digits))).await.map(drop)
    }

    pub(super) async fn confirm(&self) -> Result<(), E> {
        self.take(Step::Confirm).await.map(drop)
    }

    async fn ask(&self, ask: Ask<Id>) -> Result<Answer, E> {
        self.take(Step::Ask(ask)).await
    }

    async fn take(&self, step: Step<Id>) -> Result<Answer, E> {
        *self.slot() = Slot::Wanted(step);
        std::future::poll_fn(|_| {
            let mut slot = self.slot();
            match mem::replace(&mut *slot, Slot::Empty) {
                Slot::Answered(outcome) => Poll::Ready(outcome),
                wanted => {
                    *slot = wanted;
                    Poll::Pending
                }
            }
        })
        .await
    }

    fn slot(&self) -> MutexGuard<'_, Slot<Id, E>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
