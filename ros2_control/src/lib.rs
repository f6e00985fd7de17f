//! The driver behind a C ABI, for a hardware interface of ros2_control: `include/powerball.h` says what each
//! function does, `docs/ros2_control.md` how it is used. [`Arm`] is the same in Rust. [`control`] has control
//! laws for a controller of any arm.
//!
//! Everything here is unsafe in the one way that C is: a pointer is what its caller says it is.

mod arm;
pub mod control;

pub use arm::{Arm, JOINTS, State};

use powerball::bus::driver::TorqueGuard;
use std::ffi::{CStr, c_char, c_int, c_void};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

/// The call is done.
pub const OK: c_int = 0;
/// The call is not done; [`powerball_message`] says why.
pub const ERROR: c_int = 1;
/// After an error: the drives must be configured anew.
pub const CONFIGURE: c_int = 2;

/// Room for a message, its closing zero included: messages are kept without allocating.
const MESSAGE: usize = 512;

/// An arm and what went wrong last.
#[derive(Debug)]
pub struct Handle {
    arm: Arm,
    message: [u8; MESSAGE],
}

/// Writes as much of `text` as fits, whole letters, and a zero.
fn put(text: &str, room: &mut [u8]) {
    let Some(most) = room.len().checked_sub(1) else { return };
    let end = (0..=most.min(text.len())).rev().find(|end| text.is_char_boundary(*end)).unwrap_or(0);
    let (bytes, rest) = room.split_at_mut(end);
    bytes.copy_from_slice(&text.as_bytes()[..end]);
    rest.iter_mut().take(1).for_each(|byte| *byte = 0);
}

/// Does something with the arm; a panic is an error and does not reach the caller's language.
///
/// # Safety
/// `handle` is null or comes from [`powerball_open`], was not closed, and nobody else uses it now.
unsafe fn with(handle: *mut Handle, act: impl FnOnce(&mut Arm) -> Result<c_int, String>) -> c_int {
    // SAFETY: the caller's promise.
    let Some(handle) = (unsafe { handle.as_mut() }) else { return ERROR };
    let arm = &mut handle.arm;
    match catch_unwind(AssertUnwindSafe(|| act(arm))) {
        Ok(Ok(code)) => code,
        Ok(Err(why)) => {
            put(&why, &mut handle.message);
            ERROR
        }
        Err(_) => {
            put("the driver has panicked: a mistake in it", &mut handle.message);
            ERROR
        }
    }
}

/// Opens a bus by its name; null where that fails, with the reason in `why`.
///
/// # Safety
/// `url` is a text that ends with zero; `why` is null or has room for `room` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn powerball_open(url: *const c_char, why: *mut c_char, room: usize) -> *mut Handle {
    let opened = if url.is_null() {
        Err("no bus is named".to_string())
    } else {
        // SAFETY: the caller's promise; it is not null.
        let url = unsafe { CStr::from_ptr(url) };
        catch_unwind(|| Arm::open(&url.to_string_lossy()))
            .unwrap_or_else(|_| Err("the driver has panicked: a mistake in it".to_string()))
    };
    match opened {
        Ok(arm) => Box::into_raw(Box::new(Handle { arm, message: [0; MESSAGE] })),
        Err(text) => {
            if !why.is_null() && room > 0 {
                // SAFETY: the caller's promise; it is not null.
                put(&text, unsafe { std::slice::from_raw_parts_mut(why.cast::<u8>(), room) });
            }
            std::ptr::null_mut()
        }
    }
}

/// Stops the arm where it moves, and closes the bus.
///
/// # Safety
/// `handle` is null or comes from [`powerball_open`] and is never used again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn powerball_close(handle: *mut Handle) {
    if !handle.is_null() {
        // SAFETY: the caller's promise: it was made by `Box::into_raw` and is given back once.
        let handle = unsafe { Box::from_raw(handle) };
        let _ = catch_unwind(AssertUnwindSafe(|| drop(handle)));
    }
}

/// Inverse dynamics in the caller's language: context; position, velocity, acceleration; torque, N·m, to be
/// written.
pub type InverseDynamics = unsafe extern "C" fn(*mut c_void, *const f64, *const f64, *const f64, *mut f64);

/// A model that a caller gave, with what is his.
struct Callback(InverseDynamics, *mut c_void);

// SAFETY: powerball.h allows one thread at a time with an arm; its model is called from there alone.
unsafe impl Send for Callback {}
// SAFETY: as above.
unsafe impl Sync for Callback {}

impl Callback {
    fn torque(&self, q: &[f64; JOINTS], dq: &[f64; JOINTS], ddq: &[f64; JOINTS]) -> [f64; JOINTS] {
        // What is not written is no number, and no number lets nothing through.
        let mut torque = [f64::NAN; JOINTS];
        // SAFETY: the promise of `powerball_guard_torque`; all arrays have the length that the header says.
        unsafe { (self.0)(self.1, q.as_ptr(), dq.as_ptr(), ddq.as_ptr(), torque.as_mut_ptr()) };
        torque
    }
}

/// See [`Arm::guard_torque`]. What the guard needs in addition to the caller's own stays in memory until the
/// program ends.
///
/// # Safety
/// `handle` is null or an open arm's that nobody else uses now; `torque` is null or may be called with
/// `context` until the arm is closed, reads and writes [`JOINTS`] numbers, and does not unwind.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn powerball_guard_torque(
    handle: *mut Handle,
    torque: Option<InverseDynamics>,
    context: *mut c_void,
) -> c_int {
    // SAFETY: the caller's promise.
    unsafe {
        with(handle, |arm| {
            let callback = Callback(torque.ok_or("no model is given")?, context);
            let guard = move |q: &_, dq: &_, ddq: &_| callback.torque(q, dq, ddq);
            arm.guard_torque(TorqueGuard::new(Box::leak(Box::new(guard))));
            Ok(OK)
        })
    }
}

/// See [`Arm::accept_other_drives`].
///
/// # Safety
/// `handle` is null or an open arm's that nobody else uses now.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn powerball_accept_unverified(handle: *mut Handle) -> c_int {
    // SAFETY: the caller's promise.
    unsafe {
        with(handle, |arm| {
            arm.accept_other_drives();
            Ok(OK)
        })
    }
}

/// See [`Arm::guard_model`].
///
/// # Safety
/// `handle` is null or an open arm's that nobody else uses now; the others are null or texts that end with
/// zero.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn powerball_guard_model(
    handle: *mut Handle,
    mounting: *const c_char,
    values: *const c_char,
) -> c_int {
    // SAFETY: the caller's promise; null is not read.
    let text = |text: *const c_char| unsafe {
        (!text.is_null()).then(|| CStr::from_ptr(text).to_string_lossy().into_owned())
    };
    let (mounting, values) = (text(mounting), text(values));
    let mounting = mounting.as_deref().unwrap_or("filed");
    // SAFETY: the caller's promise.
    unsafe { with(handle, |arm| arm.guard_model(mounting, values.as_deref().map(Path::new)).map(|()| OK)) }
}

/// See [`Arm::configure`].
///
/// # Safety
/// `handle` is null or an open arm's that nobody else uses now.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn powerball_configure(handle: *mut Handle) -> c_int {
    // SAFETY: the caller's promise.
    unsafe { with(handle, |arm| arm.configure().map(|()| OK)) }
}

/// See [`Arm::activate`].
///
/// # Safety
/// `handle` is null or an open arm's that nobody else uses now.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn powerball_activate(handle: *mut Handle) -> c_int {
    // SAFETY: the caller's promise.
    unsafe { with(handle, |arm| arm.activate().map(|()| OK)) }
}

/// See [`Arm::read`].
///
/// # Safety
/// `handle` is null or an open arm's that nobody else uses now; each of the others is null or has room for
/// [`JOINTS`] numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn powerball_read(
    handle: *mut Handle,
    position: *mut f64,
    velocity: *mut f64,
    effort: *mut f64,
) -> c_int {
    let mut state = State::default();
    // SAFETY: the caller's promise.
    let code = unsafe { with(handle, |arm| arm.read().map(|read| state = read).map(|()| OK)) };
    if code == OK {
        for (values, out) in [(state.position, position), (state.velocity, velocity), (state.effort, effort)]
        {
            if !out.is_null() {
                // SAFETY: the caller's promise; it is not null, and `values` is a copy of its own.
                unsafe { std::ptr::copy_nonoverlapping(values.as_ptr(), out, JOINTS) };
            }
        }
    }
    code
}

/// See [`Arm::write`].
///
/// # Safety
/// `handle` is null or an open arm's that nobody else uses now; `position` is null or has [`JOINTS`] numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn powerball_write(handle: *mut Handle, position: *const f64) -> c_int {
    if position.is_null() {
        return ERROR;
    }
    // SAFETY: the caller's promise; it is not null.
    let position = unsafe { position.cast::<[f64; JOINTS]>().read() };
    // SAFETY: the caller's promise.
    unsafe { with(handle, |arm| arm.write(&position).map(|()| OK)) }
}

/// See [`Arm::deactivate`].
///
/// # Safety
/// `handle` is null or an open arm's that nobody else uses now.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn powerball_deactivate(handle: *mut Handle) -> c_int {
    // SAFETY: the caller's promise.
    unsafe { with(handle, |arm| arm.deactivate().map(|()| OK)) }
}

/// See [`Arm::on_error`]; [`OK`] where the arm may be activated again, [`CONFIGURE`] where it must be
/// configured first.
///
/// # Safety
/// `handle` is null or an open arm's that nobody else uses now.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn powerball_on_error(handle: *mut Handle) -> c_int {
    // SAFETY: the caller's promise.
    unsafe { with(handle, |arm| arm.on_error().map(|ready| if ready { OK } else { CONFIGURE })) }
}

/// Why the last call that gave [`ERROR`] did so; it stays until the next such call.
///
/// # Safety
/// `handle` is null or an open arm's that nobody else uses now.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn powerball_message(handle: *const Handle) -> *const c_char {
    // SAFETY: the caller's promise.
    match unsafe { handle.as_ref() } {
        Some(handle) => handle.message.as_ptr().cast(),
        None => c"there is no arm".as_ptr(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_are_cut_at_whole_letters() {
        let mut room = [7u8; 6];
        put("N·m·s", &mut room);
        assert_eq!(CStr::from_bytes_until_nul(&room).unwrap().to_str().unwrap(), "N·m");
        put("", &mut room);
        assert_eq!(room[0], 0);
        put("x", &mut []);
    }

    #[test]
    fn null_is_an_error_and_no_crash() {
        let null = std::ptr::null_mut();
        // SAFETY: null is allowed everywhere.
        unsafe {
            assert!(powerball_open(std::ptr::null(), std::ptr::null_mut(), 0).is_null());
            assert_eq!(powerball_configure(null), ERROR);
            assert_eq!(powerball_accept_unverified(null), ERROR);
            assert_eq!(powerball_guard_torque(null, None, std::ptr::null_mut()), ERROR);
            assert_eq!(powerball_guard_model(null, std::ptr::null(), std::ptr::null()), ERROR);
            assert_eq!(
                powerball_read(null, std::ptr::null_mut(), std::ptr::null_mut(), std::ptr::null_mut()),
                ERROR
            );
            assert_eq!(powerball_write(null, std::ptr::null()), ERROR);
            assert!(!powerball_message(null).is_null());
            powerball_close(null);
        }
    }
}
