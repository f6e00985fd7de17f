//! The laws through the C ABI, on a pendulum in closed form: 2 kg·m², 10 N·m, 3 N·m of friction.

use super::abi::*;
use super::*;
use crate::{ERROR, OK};
use std::ffi::{CStr, c_int, c_void};
use std::ptr::{null, null_mut};

const INERTIA: f64 = 2.0;
const PERIOD: f64 = 0.005;

fn weight(q: f64) -> f64 {
    10.0 * q.cos()
}

fn friction(dq: f64) -> f64 {
    3.0 * (100.0 * dq).tanh()
}

unsafe extern "C" fn mass_matrix(_: *const f64, result: *mut f64) -> c_int {
    // SAFETY: one number is written.
    unsafe { result.write(INERTIA) };
    0
}

unsafe extern "C" fn nothing(_: *const f64, _: *const f64, result: *mut f64) -> c_int {
    // SAFETY: one number is written.
    unsafe { result.write(0.0) };
    0
}

unsafe extern "C" fn gravity(q: *const f64, result: *mut f64) -> c_int {
    // SAFETY: one number is read, one written.
    unsafe { result.write(weight(q.read())) };
    0
}

unsafe extern "C" fn begin(model: *mut c_void) -> c_int {
    // SAFETY: eight bytes are written.
    unsafe { model.cast::<u64>().write(7) };
    0
}

unsafe extern "C" fn torque(
    model: *mut c_void,
    q: *const f64,
    dq: *const f64,
    ddq: *const f64,
    _: f64,
    _: *const f64,
    result: *mut f64,
) -> c_int {
    // SAFETY: eight bytes are read, one number each.
    let (word, q, dq, ddq) = unsafe { (model.cast::<u64>().read(), q.read(), dq.read(), ddq.read()) };
    if word == 7 {
        // SAFETY: one number is written.
        unsafe { result.write(INERTIA * ddq + weight(q) + friction(dq)) };
    }
    c_int::from(word != 7)
}

const ARM: ArmFunctions = ArmFunctions {
    joints: 1,
    mass_matrix: Some(mass_matrix),
    coriolis_times_velocity: Some(nothing),
    coriolis_transpose_times_velocity: Some(nothing),
    gravity: Some(gravity),
    model_size: 8,
    begin: Some(begin),
    torque: Some(torque),
};

const LIMITS: [f64; 2] = [60.0, 6000.0];

fn c_options(law: c_int, bandwidth: f64) -> COptions {
    let [limit, rate] = [&LIMITS[0], &LIMITS[1]].map(std::ptr::from_ref);
    COptions {
        law,
        period: PERIOD,
        bandwidth,
        damping: 1.0,
        observer_bandwidth: 50.0,
        effort_limits: limit,
        effort_rate_limits: rate,
    }
}

/// Why a control is refused.
fn refusal(arm: &ArmFunctions, options: &COptions) -> String {
    let mut why = [0u8; 512];
    // SAFETY: all point to what they say.
    let made = unsafe { powerball_control_open(arm, options, why.as_mut_ptr().cast(), why.len()) };
    assert!(made.is_null());
    CStr::from_bytes_until_nul(&why).unwrap().to_str().unwrap().to_string()
}

/// The pendulum under a control for some seconds from rest at 0.3 rad, pushed by some N·m: position and
/// external torque.
fn run(law: c_int, reference: Option<f64>, push: f64, seconds: f64) -> [f64; 2] {
    let (mut q, mut dq, mut effort, mut external) = (0.3, 0.0, 0.0, 0.0);
    // SAFETY: all point to what they say; one number each.
    unsafe {
        let control = powerball_control_open(&ARM, &c_options(law, 0.0), null_mut(), 0);
        assert_eq!(powerball_control_start(control, &q), OK);
        for _ in 0..(seconds / PERIOD) as usize {
            let wanted = reference.as_ref().map_or(null(), std::ptr::from_ref);
            let code = powerball_control_update(
                control,
                &q,
                &dq,
                wanted,
                &0.0,
                &0.0,
                PERIOD,
                &mut effort,
                &mut external,
            );
            assert_eq!(code, OK);
            for _ in 0..50 {
                dq += (effort + push - weight(q) - friction(dq)) / INERTIA * (PERIOD / 50.0);
                q += dq * (PERIOD / 50.0);
            }
        }
        powerball_control_close(control);
    }
    [q, external]
}

#[test]
fn gravity_holds_and_computed_torque_reaches_and_holds() {
    let [q, external] = run(0, None, 0.0, 5.0);
    assert!((q - 0.3).abs() < 1e-9 && external.abs() < 1e-9, "{q} {external}");
    let [q, external] = run(1, Some(0.8), 0.0, 5.0);
    assert!((q - 0.8).abs() < 2e-3 && external.abs() < 0.1, "{q} {external}");
    let [q, _] = run(1, None, 0.0, 1.0);
    assert!((q - 0.3).abs() < 1e-9, "{q}");
}

/// Friction of the model counts as the joint's own, not as a push.
#[test]
fn a_push_is_seen_as_external() {
    for push in [7.0, -7.0] {
        let [q, external] = run(1, None, push, 5.0);
        assert!((external - push).abs() < 0.02 * push.abs(), "{external}");
        // What computed torque gives way by at rest: push/(B·K_p).
        assert!(((q - 0.3) * push).is_sign_positive() && (q - 0.3).abs() < 7.0 / (INERTIA * 400.0), "{q}");
    }
}

#[test]
fn what_does_not_fit_is_refused_with_its_reason() {
    let fits = c_options(1, 20.0);
    assert!(refusal(&ARM, &c_options(2, 0.0)).contains("no law has the number 2"));
    assert!(refusal(&ArmFunctions { joints: 9, ..ARM }, &fits).contains("9 joints"));
    let no_limits = COptions { effort_limits: null(), ..fits };
    assert!(refusal(&ARM, &no_limits).contains("effort limits are missing"));
    assert!(refusal(&ArmFunctions { gravity: None, ..ARM }, &fits).contains("no gravity"));
    assert!(refusal(&ArmFunctions { begin: None, ..ARM }, &fits).contains("a size, begin and torque"));
    assert!(refusal(&ARM, &c_options(1, 300.0)).contains("unstable at 200 Hz"));
    assert!(refusal(&ARM, &c_options(1, -1.0)).contains("bandwidth"));
    assert!(refusal(&ARM, &COptions { damping: 0.0, ..fits }).contains("damping"));
    assert!(refusal(&ARM, &COptions { period: f64::NAN, ..fits }).contains("period"));
    let singular = ArmFunctions { mass_matrix: Some(gravity_of_nothing), ..ARM };
    assert!(refusal(&singular, &fits).contains("not positive"));
}

unsafe extern "C" fn gravity_of_nothing(_: *const f64, result: *mut f64) -> c_int {
    // SAFETY: one number is written.
    unsafe { result.write(0.0) };
    0
}

/// A state that is no number, or a cycle before the start: nothing is written. A reference that is none
/// holds.
#[test]
fn a_cycle_without_numbers_writes_nothing() {
    let (nan, one) = (f64::NAN, 1.0);
    let (mut effort, mut external) = (42.0, 43.0);
    // SAFETY: all point to what they say; one number each.
    unsafe {
        let control = powerball_control_open(&ARM, &c_options(1, 20.0), null_mut(), 0);
        let mut cycle = |q: &f64, reference: *const f64, period: f64| {
            powerball_control_update(
                control,
                q,
                &0.0,
                reference,
                &0.0,
                &0.0,
                period,
                &mut effort,
                &mut external,
            )
        };
        assert_eq!(cycle(&one, null(), PERIOD), ERROR, "not started");
        assert_eq!(powerball_control_start(control, &nan), ERROR);
        assert_eq!(powerball_control_start(control, &one), OK);
        assert_eq!(cycle(&nan, null(), PERIOD), ERROR);
        assert_eq!(cycle(&one, null(), 0.0), ERROR);
        assert_eq!(cycle(&one, null(), nan), ERROR);
        assert_eq!(cycle(&one, &nan, PERIOD), OK);
        assert!((effort - weight(1.0)).abs() < 1e-12, "{effort}");
        assert_eq!(external, 0.0);
        powerball_control_close(control);
        assert_eq!(powerball_control_start(null_mut(), &one), ERROR);
        powerball_control_close(null_mut());
    }
}
