//! Registers as typed constants. The compiler checks their values and accesses.

use super::id::RegisterId;
use super::value::Value;
use core::marker::PhantomData;

/// A register with the type of its value and its access.
#[derive(Debug)]
pub struct Register<T, A> {
    id: RegisterId,
    kind: PhantomData<fn() -> (T, A)>,
}

impl<T, A> Clone for Register<T, A> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T, A> Copy for Register<T, A> {}

impl<T: Value, A> Register<T, A> {
    pub(super) const fn new(id: u8) -> Self {
        Register { id: RegisterId(id), kind: PhantomData }
    }

    /// The number on the wire.
    pub const fn id(self) -> RegisterId {
        self.id
    }
}

/// Marks registers that table 3 lets a master read.
pub trait Readable {}
/// Marks registers that table 3 lets a master write.
pub trait Writable {}

/// Access `RW`.
#[derive(Debug)]
pub enum ReadWrite {}
/// Access `R`.
#[derive(Debug)]
pub enum ReadOnly {}
/// Access `W`.
#[derive(Debug)]
pub enum WriteOnly {}
/// Access `D`.
#[derive(Debug)]
pub enum Dac {}
/// Neither readable nor writable.
#[derive(Debug)]
pub enum Never {}

impl Readable for ReadWrite {}
impl Readable for ReadOnly {}
impl Writable for ReadWrite {}
impl Writable for WriteOnly {}
