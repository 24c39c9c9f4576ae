//! The only file with `unsafe`: it converts pointers of C to safe types of Rust.

use core::marker::PhantomData;
use core::mem::{MaybeUninit, align_of, size_of};
use core::ops::{Deref, DerefMut};
use core::slice;
use core::sync::atomic::{AtomicU32, Ordering};

use crate::error::motorlink_error;
use crate::tag::{self, Kind};

type Result<T> = core::result::Result<T, motorlink_error>;

/// A pointer to something that may be read, or NULL, or misaligned.
pub(crate) struct In<T>(*const T);

/// A pointer to something that may be written, or NULL, or misaligned.
pub(crate) struct Out<T>(*mut T);

impl<T> Clone for In<T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T> Copy for In<T> {}

/// Pointers that a caller makes promises about.
pub(crate) trait Promise {
    type Promised;

    /// Relies on the caller's promise.
    ///
    /// # Safety
    /// What the crate's documentation demands of a pointer holds as long as the result is used.
    unsafe fn promised(self) -> Self::Promised;
}

impl<T> Promise for *const T {
    type Promised = In<T>;
    unsafe fn promised(self) -> In<T> {
        In(self)
    }
}

impl<T> Promise for *mut T {
    type Promised = Out<T>;
    unsafe fn promised(self) -> Out<T> {
        Out(self)
    }
}

/// Takes an exported function's pointers for what its callers promise them to be.
macro_rules! promised {
    ($($pointer:ident),+) => { $(
        // SAFETY: a caller keeps to the contract in the crate's documentation.
        let $pointer = unsafe { $crate::pointer::Promise::promised($pointer) };
    )+ };
}
pub(crate) use promised;

fn check<T>(pointer: *const T) -> Result<()> {
    check_address(pointer.addr(), align_of::<T>()).check()
}

// One function for pointers of all types takes less flash. It gives the number that C gets, so that
// a caller only has to pass it on.
#[inline(never)]
fn check_address(address: usize, alignment: usize) -> motorlink_error {
    if address == 0 {
        return motorlink_error::NullPointer;
    }
    if address & alignment.wrapping_sub(1) != 0 {
        return motorlink_error::Misaligned;
    }
    motorlink_error::Ok
}

/// As many `T` as one object may have.
fn checked<T>(len: usize) -> Result<usize> {
    let most = isize::MAX as usize / size_of::<T>().max(1);
    if len <= most { Ok(len) } else { Err(motorlink_error::BadArgument) }
}

/// Structs of C: every bit pattern of their size is a value.
///
/// # Safety
/// Only integers, arrays of them, pointers, [`In`] and optional functions of C are in there.
pub(crate) unsafe trait Plain: Copy + 'static {}

macro_rules! plain {
    ($($type:ty),+ $(,)?) => { $(
        // SAFETY: it has nothing but integers, arrays of them, pointers and optional functions.
        unsafe impl $crate::pointer::Plain for $type {}
    )+ };
}
pub(crate) use plain;

plain!(u8, i16, i32);

impl<T: Plain> In<T> {
    /// The value there.
    pub(crate) fn read(self) -> Result<T> {
        check(self.0)?;
        // SAFETY: neither NULL nor misaligned, promised to be readable, and any bits are a `T`.
        Ok(unsafe { self.0.read() })
    }

    /// The value there, `None` for NULL.
    pub(crate) fn read_optional(self) -> Result<Option<T>> {
        if self.0.is_null() { Ok(None) } else { self.read().map(Some) }
    }

    /// The value there, for as long as the promise holds.
    pub(crate) fn keep(self) -> Result<Kept<T>> {
        check(self.0)?;
        Ok(Kept(self.0))
    }

    /// The `len` values there; NULL is as good as any pointer to none.
    pub(crate) fn slice<'a>(self, len: usize) -> Result<&'a [T]> {
        if len == 0 {
            return Ok(&[]);
        }
        check(self.0)?;
        let len = checked::<T>(len)?;
        // SAFETY: neither NULL nor misaligned, promised to be readable, any bits are a `T`, and no
        // longer than an object can be.
        Ok(unsafe { slice::from_raw_parts(self.0, len) })
    }
}

/// The ASCII at the beginning of a C string, of which no more than `most` bytes are looked at.
pub(crate) fn ascii<'a>(text: In<u8>, most: usize) -> &'a str {
    if text.0.is_null() {
        return "";
    }
    let mut len = 0;
    while len < most {
        let at = text.0.wrapping_add(len);
        // SAFETY: promised to be a C string, and no byte before this one was its end.
        if !matches!(unsafe { at.read() }, 1..=0x7F) {
            break;
        }
        len = len.wrapping_add(1);
    }
    // SAFETY: these bytes were just read.
    let bytes = unsafe { slice::from_raw_parts(text.0, len) };
    // SAFETY: each of them is ASCII.
    unsafe { str::from_utf8_unchecked(bytes) }
}

/// Asserts that a struct of C and one of Rust have the same fields at the same places.
macro_rules! same_layout {
    ($c:ty = $rust:ty { $($($of_c:ident).+ = $($of_rust:ident).+),+ $(,)? }) => {
        const _: () = {
            use core::mem::{align_of, offset_of, size_of};
            assert!(size_of::<$c>() == size_of::<$rust>());
            assert!(align_of::<$c>() == align_of::<$rust>());
            $( assert!(offset_of!($c, $($of_c).+) == offset_of!($rust, $($of_rust).+)); )+
        };
    };
}
pub(crate) use same_layout;

/// What a caller keeps in place as long as an object is used. The caller may change its content.
pub(crate) struct Kept<T>(*const T);

impl<T: Plain> Kept<T> {
    /// The value there now: no reference, which a callback that changes it would break.
    pub(crate) fn now(&self) -> T {
        // SAFETY: neither NULL nor misaligned, promised to be readable, and any bits are a `T`.
        unsafe { self.0.read() }
    }
}

/// A place for a result.
pub(crate) struct OutParam<T>(*mut T);

impl<T> Out<T> {
    /// The place, of which it is known that it can be written.
    pub(crate) fn place(&self) -> Result<OutParam<T>> {
        check(self.0)?;
        Ok(OutParam(self.0))
    }
}

impl<T: Plain> Out<T> {
    /// The places of `len` values; NULL is as good as any pointer to none.
    pub(crate) fn places<'a>(&self, len: usize) -> Result<&'a mut [MaybeUninit<T>]> {
        if len == 0 {
            return Ok(&mut []);
        }
        check(self.0)?;
        let len = checked::<T>(len)?;
        // SAFETY: neither NULL nor misaligned, promised to be writable, and no longer than an
        // object can be.
        Ok(unsafe { slice::from_raw_parts_mut(self.0.cast(), len) })
    }
}

impl<T> OutParam<T> {
    pub(crate) fn set(self, value: T) {
        // SAFETY: neither NULL nor misaligned, and promised to be writable.
        unsafe { self.0.write(value) };
    }
}

/// What C declares as an opaque array is a tag and a state to us.
///
/// # Safety
/// Size and alignment of `Stored<State>` are at most those of the type.
pub(crate) unsafe trait Storage {
    type State;
    const KIND: Kind;
}

/// What C declares storage as.
pub(crate) type Words = u64;

type Tag = AtomicU32;

/// The tag is that of the state's kind, and its complement during a call. Any other value: not
/// initialised.
#[repr(C)]
pub(crate) struct Stored<S> {
    tag: Tag,
    state: S,
}

/// Declares what the storage of an object holds.
macro_rules! storage {
    ($type:ident: $state:ty, $kind:expr) => {
        const _: () = {
            use core::mem::{align_of, size_of};
            use $crate::pointer::Stored;
            assert!(size_of::<Stored<$state>>() <= size_of::<$type>(), "storage too small");
            assert!(align_of::<Stored<$state>>() <= align_of::<$type>());
            assert!(align_of::<$type>() == align_of::<$crate::pointer::Words>());
        };

        // SAFETY: asserted above.
        unsafe impl $crate::pointer::Storage for $type {
            type State = $state;
            const KIND: $crate::tag::Kind = $kind;
        }
    };
}
pub(crate) use storage;

impl<K: Storage> Out<K> {
    /// Begins an object in a storage of `size` bytes, whatever was there.
    pub(crate) fn init(&self, size: usize, state: K::State) -> Result<()> {
        check(self.0)?;
        if size < size_of::<K>() {
            return Err(motorlink_error::StorageTooSmall);
        }
        // SAFETY: neither NULL nor misaligned, promised to be writable and not in use, and large
        // enough for a `Stored`.
        let stored = unsafe { &mut *self.0.cast::<MaybeUninit<Stored<K::State>>>() };
        stored.write(Stored { tag: Tag::new(K::KIND.tag()), state });
        Ok(())
    }

    /// The object, for one call.
    pub(crate) fn enter<'a>(&self) -> Result<Entered<'a, K>> {
        enter(self.0.cast(), K::KIND).check()?;
        Ok(Entered { stored: self.0.cast(), call: PhantomData })
    }
}

/// Begins a call for an object of this kind.
// One function for objects of all kinds takes less flash.
#[inline(never)]
fn enter(object: *const Tag, kind: Kind) -> motorlink_error {
    let checked = check_address(object.addr(), align_of::<Words>());
    if checked != motorlink_error::Ok {
        return checked;
    }
    // SAFETY: neither NULL nor misaligned, promised to be storage of some kind, each of which
    // begins with a tag; any bits are one.
    let tag = unsafe { &*object };
    let idle = kind.tag();
    match take(tag, idle) {
        Ok(()) => motorlink_error::Ok,
        Err(busy) if busy == !idle => motorlink_error::InUse,
        Err(other) if tag::is_of_any_kind(other) => motorlink_error::WrongKind,
        Err(_) => motorlink_error::Uninitialised,
    }
}

/// Ends a call: the tag was the complement of the idle one.
#[inline(never)]
fn leave(tag: &Tag) {
    tag.store(!tag.load(Ordering::Relaxed), Ordering::Release);
}

/// Complements the tag if it is `idle`, and gives it if it is not.
#[cfg(target_has_atomic = "32")]
fn take(tag: &Tag, idle: u32) -> core::result::Result<(), u32> {
    tag.compare_exchange(idle, !idle, Ordering::Acquire, Ordering::Relaxed).map(drop)
}

/// Complements the tag if it is `idle`, and gives it if it is not. For processors without
/// compare-and-exchange: an interrupt between load and store ends before the store.
#[cfg(not(target_has_atomic = "32"))]
fn take(tag: &Tag, idle: u32) -> core::result::Result<(), u32> {
    let found = tag.load(Ordering::Acquire);
    if found != idle {
        return Err(found);
    }
    tag.store(!idle, Ordering::Relaxed);
    core::sync::atomic::compiler_fence(Ordering::SeqCst);
    Ok(())
}

/// An object during a call. Other calls for it find it in use.
pub(crate) struct Entered<'a, K: Storage> {
    stored: *mut Stored<K::State>,
    call: PhantomData<&'a mut K::State>,
}

impl<K: Storage> Deref for Entered<'_, K> {
    type Target = K::State;
    fn deref(&self) -> &K::State {
        // SAFETY: the tag says that there is a state and that no other call uses it.
        unsafe { &(*self.stored).state }
    }
}

impl<K: Storage> DerefMut for Entered<'_, K> {
    fn deref_mut(&mut self) -> &mut K::State {
        // SAFETY: the tag says that there is a state and that no other call uses it.
        unsafe { &mut (*self.stored).state }
    }
}

impl<K: Storage> Drop for Entered<'_, K> {
    fn drop(&mut self) {
        // SAFETY: the storage was entered, so there is a tag.
        let tag = unsafe { &(*self.stored).tag };
        leave(tag);
    }
}
