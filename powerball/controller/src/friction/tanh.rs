//! Eq. 16.

use nalgebra::RealField;

/// Eq. 16: f = γ1·tanh(γ2·q̇) + γ3·tanh(γ4·q̇) + γ5·q̇.
///
/// Continuously differentiable, odd in q̇, and dissipative where γ1, γ3, γ5 ≥ 0 and γ2, γ4 > 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TanhFriction<T> {
    /// γ1, N·m (N for a prismatic joint): first saturating level.
    pub gamma1: T,
    /// γ2, s/rad: its steepness.
    pub gamma2: T,
    /// γ3, N·m: second saturating level.
    pub gamma3: T,
    /// γ4, s/rad: its steepness.
    pub gamma4: T,
    /// γ5, N·m·s/rad: viscous coefficient.
    pub gamma5: T,
}

impl<T: RealField + Copy> TanhFriction<T> {
    /// From γ1 … γ5 in order.
    pub fn new(gamma: [T; 5]) -> Self {
        let [gamma1, gamma2, gamma3, gamma4, gamma5] = gamma;
        TanhFriction { gamma1, gamma2, gamma3, gamma4, gamma5 }
    }

    /// Friction torque in N·m at joint velocity `dq` in rad/s, positive against positive motion.
    pub fn torque(&self, dq: T) -> T {
        self.gamma1 * (self.gamma2 * dq).tanh() + self.gamma3 * (self.gamma4 * dq).tanh() + self.gamma5 * dq
    }

    /// ∂f/∂q̇ in N·m·s/rad.
    pub fn slope(&self, dq: T) -> T {
        let part = |level: T, steepness: T| {
            let t = (steepness * dq).tanh();
            level * steepness * (T::one() - t * t)
        };
        part(self.gamma1, self.gamma2) + part(self.gamma3, self.gamma4) + self.gamma5
    }
}
