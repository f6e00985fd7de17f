//! The control laws behind a C ABI: `include/powerball_control.h` says what each function does.

use super::{ArmFunctions, Asked, Control, Law, Options, open};
use crate::{ERROR, OK, put};
use std::ffi::{c_char, c_int};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::slice::from_raw_parts;

/// `powerball_control_options`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct COptions {
    /// [`Law`] by its number.
    pub law: c_int,
    /// See [`Options::period`].
    pub period: f64,
    /// See [`Options::bandwidth`].
    pub bandwidth: f64,
    /// See [`Options::damping`].
    pub damping: f64,
    /// See [`Options::observer_bandwidth`].
    pub observer_bandwidth: f64,
    /// See [`Options::effort_limits`].
    pub effort_limits: *const f64,
    /// See [`Options::effort_rate_limits`].
    pub effort_rate_limits: *const f64,
}

/// A control behind one pointer.
#[allow(missing_debug_implementations)]
pub struct Handle(Box<dyn Control>);

/// Options in Rust.
///
/// # Safety
/// Limits are null or have a number for each joint.
unsafe fn options(c: &COptions, joints: usize) -> Result<Options, String> {
    let law = match c.law {
        0 => Law::Gravity,
        1 => Law::ComputedTorque,
        other => return Err(format!("no law has the number {other}")),
    };
    let numbers = |values: *const f64, what: &str| {
        if values.is_null() {
            return Err(format!("{what} are missing"));
        }
        // SAFETY: the caller's promise; it is not null.
        Ok(unsafe { from_raw_parts(values, joints) }.to_vec())
    };
    Ok(Options {
        law,
        period: c.period,
        bandwidth: c.bandwidth,
        damping: c.damping,
        observer_bandwidth: c.observer_bandwidth,
        effort_limits: numbers(c.effort_limits, "effort limits")?,
        effort_rate_limits: numbers(c.effort_rate_limits, "effort rate limits")?,
    })
}

/// A control; null where model and options do not fit, with the reason in `why`.
///
/// # Safety
/// `model` and `options` are null or what the header says; `why` is null or has room for `room` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn powerball_control_open(
    model: *const ArmFunctions,
    options: *const COptions,
    why: *mut c_char,
    room: usize,
) -> *mut Handle {
    // SAFETY: the caller's promise.
    let (model, options) = unsafe { (model.as_ref(), options.as_ref()) };
    let made = catch_unwind(AssertUnwindSafe(|| {
        let model = model.ok_or("no model is given")?;
        // Before as many numbers are read.
        super::known(model.joints)?;
        // SAFETY: the caller's promise.
        let options = unsafe { self::options(options.ok_or("no options are given")?, model.joints) }?;
        // SAFETY: the caller's promise.
        unsafe { open(model, &options) }
    }));
    match made.unwrap_or_else(|_| Err("the control has panicked: a mistake in it".to_string())) {
        Ok(control) => Box::into_raw(Box::new(Handle(control))),
        Err(text) => {
            if !why.is_null() && room > 0 {
                // SAFETY: the caller's promise; it is not null.
                put(&text, unsafe { std::slice::from_raw_parts_mut(why.cast::<u8>(), room) });
            }
            std::ptr::null_mut()
        }
    }
}

/// Gives a control's memory back.
///
/// # Safety
/// `control` is null or comes from [`powerball_control_open`] and is never used again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn powerball_control_close(control: *mut Handle) {
    if !control.is_null() {
        // SAFETY: the caller's promise: it was made by `Box::into_raw` and is given back once.
        drop(unsafe { Box::from_raw(control) });
    }
}

/// See [`Control::start`].
///
/// # Safety
/// `control` is null or an open control that nobody else uses now; `position` is null or has a number for
/// each joint.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn powerball_control_start(control: *mut Handle, position: *const f64) -> c_int {
    // SAFETY: the caller's promise.
    let Some(Handle(control)) = (unsafe { control.as_mut() }) else { return ERROR };
    if position.is_null() {
        return ERROR;
    }
    // SAFETY: the caller's promise; it is not null.
    let position = unsafe { from_raw_parts(position, control.joints()) };
    code(catch_unwind(AssertUnwindSafe(|| control.start(position))))
}

/// See [`Control::update`].
///
/// # Safety
/// `control` is null or an open control that nobody else uses now; each array is null or has a number for
/// each joint.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn powerball_control_update(
    control: *mut Handle,
    position: *const f64,
    velocity: *const f64,
    reference_position: *const f64,
    reference_velocity: *const f64,
    reference_acceleration: *const f64,
    period: f64,
    effort: *mut f64,
    external: *mut f64,
) -> c_int {
    // SAFETY: the caller's promise.
    let Some(Handle(control)) = (unsafe { control.as_mut() }) else { return ERROR };
    let state = [position, velocity];
    let reference = [reference_position, reference_velocity, reference_acceleration];
    if state.iter().any(|x| x.is_null()) || effort.is_null() || external.is_null() {
        return ERROR;
    }
    let n = control.joints();
    let are_given = reference.iter().all(|x| !x.is_null());
    // SAFETY: the caller's promise; those that are read or written are not null.
    let (state, reference, effort, external) = unsafe {
        (
            state.map(|x| from_raw_parts(x, n)),
            are_given.then(|| reference.map(|x| from_raw_parts(x, n))),
            std::slice::from_raw_parts_mut(effort, n),
            std::slice::from_raw_parts_mut(external, n),
        )
    };
    let asked = Asked { state, reference, period };
    code(catch_unwind(AssertUnwindSafe(|| control.update(&asked, effort, external))))
}

fn code<E>(done: std::thread::Result<Result<(), E>>) -> c_int {
    if let Ok(Ok(())) = done { OK } else { ERROR }
}
