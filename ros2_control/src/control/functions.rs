//! An arm's functions in C as the model that control laws ask.

use nalgebra::{SMatrix, SVector};
use powerball::controller::dynamics::{ArmModel, Reference};
use std::ffi::{c_int, c_void};

/// A function of positions.
pub(super) type OfPosition = unsafe extern "C" fn(*const f64, *mut f64) -> c_int;
/// A function of positions and velocities.
pub(super) type OfMotion = unsafe extern "C" fn(*const f64, *const f64, *mut f64) -> c_int;
/// Begins a torque model.
pub(super) type Begin = unsafe extern "C" fn(*mut c_void) -> c_int;
/// A torque model's torque.
pub(super) type Torque =
    unsafe extern "C" fn(*mut c_void, *const f64, *const f64, *const f64, f64, *const f64, *mut f64) -> c_int;

/// `powerball_arm_model`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct ArmFunctions {
    /// Joints.
    pub joints: usize,
    /// B.
    pub mass_matrix: Option<OfPosition>,
    /// C·q̇.
    pub coriolis_times_velocity: Option<OfMotion>,
    /// Cᵀ·q̇.
    pub coriolis_transpose_times_velocity: Option<OfMotion>,
    /// g.
    pub gravity: Option<OfPosition>,
    /// Bytes of a torque model.
    pub model_size: usize,
    /// Begins one.
    pub begin: Option<Begin>,
    /// The model's torque.
    pub torque: Option<Torque>,
}

/// The rigid arm's functions, all there.
#[derive(Clone, Copy)]
pub(super) struct Table<const N: usize> {
    mass_matrix: OfPosition,
    coriolis_times_velocity: OfMotion,
    coriolis_transpose_times_velocity: OfMotion,
    gravity: OfPosition,
}

impl<const N: usize> Table<N> {
    pub(super) fn of(arm: &ArmFunctions) -> Result<Self, String> {
        let missing = |name: &str| format!("the model has no {name}: generate the arm with this function");
        Ok(Table {
            mass_matrix: arm.mass_matrix.ok_or_else(|| missing("mass_matrix"))?,
            coriolis_times_velocity: arm
                .coriolis_times_velocity
                .ok_or_else(|| missing("coriolis_times_velocity"))?,
            coriolis_transpose_times_velocity: arm
                .coriolis_transpose_times_velocity
                .ok_or_else(|| missing("coriolis_transpose_times_velocity"))?,
            gravity: arm.gravity.ok_or_else(|| missing("gravity"))?,
        })
    }
}

/// The result of a function in C, no numbers where it gives an error.
fn result<const R: usize, const C: usize>(call: impl FnOnce(*mut f64) -> c_int) -> SMatrix<f64, R, C> {
    let none = SMatrix::<f64, R, C>::repeat(f64::NAN);
    let mut out = none;
    if call(out.as_mut_ptr()) == 0 { out } else { none }
}

impl<const N: usize> ArmModel<f64, N> for Table<N> {
    fn mass_matrix(&self, q: &SVector<f64, N>) -> SMatrix<f64, N, N> {
        // SAFETY: the promise of `open`: it reads N numbers and writes N·N.
        result(|out| unsafe { (self.mass_matrix)(q.as_ptr(), out) })
    }
    fn coriolis_times_velocity(&self, q: &SVector<f64, N>, dq: &SVector<f64, N>) -> SVector<f64, N> {
        // SAFETY: the promise of `open`: it reads N numbers each and writes N.
        result(|out| unsafe { (self.coriolis_times_velocity)(q.as_ptr(), dq.as_ptr(), out) })
    }
    fn coriolis_transpose_times_velocity(
        &self,
        q: &SVector<f64, N>,
        dq: &SVector<f64, N>,
    ) -> SVector<f64, N> {
        // SAFETY: as above.
        result(|out| unsafe { (self.coriolis_transpose_times_velocity)(q.as_ptr(), dq.as_ptr(), out) })
    }
    fn gravity(&self, q: &SVector<f64, N>) -> SVector<f64, N> {
        // SAFETY: as above.
        result(|out| unsafe { (self.gravity)(q.as_ptr(), out) })
    }
}

/// A torque model with what its terms remember, or none.
pub(super) struct Memory<const N: usize>(Option<(Vec<u64>, Begin, Torque)>);

impl<const N: usize> Memory<N> {
    pub(super) fn of(arm: &ArmFunctions) -> Result<Self, String> {
        Ok(Memory(match (arm.model_size, arm.begin, arm.torque) {
            (0, None, None) => None,
            (size, Some(begin), Some(torque)) if size > 0 => {
                Some((vec![0; size.div_ceil(size_of::<u64>())], begin, torque))
            }
            _ => {
                return Err(
                    "a model has a size, begin and torque, or none of them for a rigid arm".to_string()
                );
            }
        }))
    }

    /// Resets what the model remembers.
    pub(super) fn begin(&mut self) {
        if let Some((room, begin, _)) = &mut self.0 {
            // SAFETY: the promise of `open`: a model has room here, and nobody else uses it.
            unsafe { begin(room.as_mut_ptr().cast()) };
        }
    }

    /// What the motion takes beyond the rigid arm, N·m: friction and effects. Once a cycle.
    pub(super) fn added(
        &mut self,
        arm: &Table<N>,
        motion: &Reference<f64, N>,
        running: f64,
    ) -> SVector<f64, N> {
        let Some((room, _, torque)) = &mut self.0 else { return SVector::zeros() };
        let Reference { q, dq, ddq } = motion;
        let room = room.as_mut_ptr().cast();
        let whole: SVector<f64, N> = result(|out| {
            // SAFETY: the promise of `open`; the model was initialised, temperatures may be null, the others
            // have N numbers.
            unsafe { torque(room, q.as_ptr(), dq.as_ptr(), ddq.as_ptr(), running, std::ptr::null(), out) }
        });
        whole - arm.mass_matrix(q) * ddq - arm.coriolis_times_velocity(q, dq) - arm.gravity(q)
    }
}
