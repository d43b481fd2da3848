//! The only place that follows foreign pointers.
//!
//! A function of the library may believe what its header asks of the caller, and no more: a pointer is
//! NULL, or as the header says. That is the contract of each `unsafe fn` here.

use std::{
    ffi::{CStr, c_char},
    panic::{AssertUnwindSafe, catch_unwind},
    ptr::NonNull,
};

use crate::outcome::{Failure, Outcome};

/// Runs the body of a function of the library; nothing unwinds into C.
pub(crate) fn guard(body: impl FnOnce() -> Result<(), Failure>) -> Outcome {
    // What a panic leaves half done is the caller's object, which may only be freed.
    let result = catch_unwind(AssertUnwindSafe(body));
    match result.unwrap_or_else(|panic| Err(Failure::of_panic(&*panic))) {
        Ok(()) => Outcome::Ok,
        Err(failure) => failure.report(),
    }
}

/// An object of the library, to be looked at.
///
/// # Safety
/// `pointer` is NULL, or came from [`Output::give`] and is not freed while the object is looked at.
pub(crate) unsafe fn object<'a, T>(pointer: *const T, name: &str) -> Result<&'a T, Failure> {
    // SAFETY: by this function's contract it points to a live `T` of a `Box`.
    unsafe { pointer.as_ref() }.ok_or_else(|| null(name))
}

/// An object of the library, to be changed.
///
/// # Safety
/// As for [`object`]; and no other thread uses it meanwhile.
pub(crate) unsafe fn object_mut<'a, T>(pointer: *mut T, name: &str) -> Result<&'a mut T, Failure> {
    // SAFETY: by this function's contract it points to a live `T` of a `Box` that nobody else uses.
    unsafe { pointer.as_mut() }.ok_or_else(|| null(name))
}

/// Frees an object of the library; NULL is none.
///
/// # Safety
/// `pointer` is NULL, or came from [`Output::give`] and is used by nobody any more.
pub(crate) unsafe fn free<T>(pointer: *mut T) {
    let Some(pointer) = NonNull::new(pointer) else {
        return;
    };
    guard(|| {
        // SAFETY: by this function's contract it is a `Box` that was given away and comes back once.
        drop(unsafe { Box::from_raw(pointer.as_ptr()) });
        Ok(())
    });
}

/// A string of the caller.
///
/// # Safety
/// `pointer` is NULL, or points to a string that ends with NUL and does not change while it is read.
pub(crate) unsafe fn text<'a>(pointer: *const c_char, name: &str) -> Result<&'a str, Failure> {
    if pointer.is_null() {
        return Err(null(name));
    }
    // SAFETY: by this function's contract it is a C string.
    let text = unsafe { CStr::from_ptr(pointer) };
    text.to_str()
        .map_err(|error| Failure::invalid(format!("`{name}` is not UTF-8: {error}")))
}

/// Where the caller wants an output. Nothing is written before the call cannot fail any more.
#[derive(Debug)]
pub(crate) struct Output<T>(NonNull<T>);

impl<T> Output<T> {
    /// # Safety
    /// `pointer` is NULL, or valid for writing a `T` until the call ends; what is there may be anything.
    pub(crate) unsafe fn at(pointer: *mut T, name: &str) -> Result<Self, Failure> {
        NonNull::new(pointer).map(Self).ok_or_else(|| null(name))
    }

    pub(crate) fn write(self, value: T) {
        // SAFETY: by the contract of `at`. The old value is not dropped: C types have no destructors.
        unsafe { self.0.write(value) };
    }
}

impl<T> Output<*mut T> {
    /// Gives an object away, until it is freed.
    pub(crate) fn give(self, object: T) {
        self.write(Box::into_raw(Box::new(object)));
    }
}

/// Where the caller wants an array.
#[derive(Debug)]
pub(crate) struct OutputArray<'a, T> {
    first: NonNull<T>,
    room: usize,
    name: &'a str,
}

impl<'a, T: Copy> OutputArray<'a, T> {
    /// # Safety
    /// `first` is NULL, or valid for writing `room` of `T` until the call ends; what is there may be
    /// anything.
    pub(crate) unsafe fn at(first: *mut T, room: usize, name: &'a str) -> Result<Self, Failure> {
        let first = NonNull::new(first).ok_or_else(|| null(name))?;
        Ok(Self { first, room, name })
    }

    /// Fails unless there is room for so many.
    pub(crate) fn has_room_for(&self, count: usize) -> Result<(), Failure> {
        if count <= self.room {
            return Ok(());
        }
        let Self { room, name, .. } = self;
        let text = format!("`{name}` has room for {room} elements, {count} are needed");
        Err(Failure::new(Outcome::TooLittleRoom, text))
    }

    /// Writes all values, or nothing if there is no room for them.
    pub(crate) fn fill(self, values: &[T]) -> Result<(), Failure> {
        self.has_room_for(values.len())?;
        // SAFETY: by the contract of `at` there is room for that many, and memory that may be written
        // to by the caller alone is none of ours, so the two do not overlap.
        unsafe {
            self.first
                .copy_from_nonoverlapping(NonNull::from(values).cast(), values.len());
        }
        Ok(())
    }
}

fn null(name: &str) -> Failure {
    Failure::new(Outcome::NullParameter, format!("`{name}` is NULL"))
}
