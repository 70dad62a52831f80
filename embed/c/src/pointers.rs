//! Pointers of C callers.

use core::slice;

use crate::PkmError;

/// What a C caller handed over, if there is something.
///
/// # Safety
/// Unless null or misaligned, the pointer leads to a `T` that nobody writes to meanwhile.
pub unsafe fn given<'a, T>(pointer: *const T) -> Result<&'a T, PkmError> {
    if pointer.is_null() {
        Err(PkmError::NullPointer)
    } else if !pointer.is_aligned() {
        Err(PkmError::Misaligned)
    } else {
        // SAFETY: neither null nor misaligned; the rest is the caller's promise
        Ok(unsafe { &*pointer })
    }
}

/// Several of what a C caller handed over. A reference to the first alone would not reach the others.
///
/// # Safety
/// Unless null or misaligned, the pointer leads to `count` of `T` that nobody writes to meanwhile.
pub unsafe fn given_slice<'a, T>(pointer: *const T, count: usize) -> Result<&'a [T], PkmError> {
    // SAFETY: the caller's promise
    unsafe { given(pointer)? };
    // SAFETY: neither null nor misaligned; the rest is the caller's promise
    Ok(unsafe { slice::from_raw_parts(pointer, count) })
}

/// What a C caller handed over to be changed.
///
/// # Safety
/// Unless null or misaligned, the pointer leads to a `T` that nobody else uses meanwhile.
pub unsafe fn taken<'a, T>(pointer: *mut T) -> Result<&'a mut T, PkmError> {
    // SAFETY: the caller's promise
    unsafe { given(pointer.cast_const())? };
    // SAFETY: neither null nor misaligned; the rest is the caller's promise
    Ok(unsafe { &mut *pointer })
}

/// Writes a result where the caller wants it, or nothing.
///
/// # Safety
/// Unless null or misaligned, the pointer leads to memory for a `T`.
pub unsafe fn answer<T>(result: *mut T, compute: impl FnOnce() -> Result<T, PkmError>) -> PkmError {
    // SAFETY: the caller's promise; the memory is not read, and `MaybeUninit` may be anything
    if let Err(error) = unsafe { given(result.cast::<core::mem::MaybeUninit<T>>()) } {
        return error;
    }
    match compute() {
        Ok(value) => {
            // SAFETY: neither null nor misaligned; inputs that were borrowed are not used any more
            unsafe { result.write(value) };
            PkmError::Ok
        }
        Err(error) => error,
    }
}
