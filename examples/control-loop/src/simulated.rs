//! The desk arm in time, with friction.

use crate::{Joints, arm};
use powerball::controller::dynamics::State;
use powerball::controller::friction::TanhFriction;

/// Time between two cycles of a controller, s. Short against inertia over the slope of friction, or what hand
/// guiding takes off is late, and a light arm creeps.
pub const PERIOD: f64 = 0.001;

pub struct Arm {
    pub state: State<f64, 3>,
    pub friction: TanhFriction<f64>,
}

impl Arm {
    /// A cycle later, under a torque that holds, N·m.
    pub fn advance(&mut self, torque: Joints) {
        let step = PERIOD / 50.0;
        for _ in 0..50 {
            let State { q, dq } = &mut self.state;
            let left = torque - dq.map(|dq| self.friction.torque(dq));
            *dq += arm::forward_dynamics(q, dq, &left) * step;
            *q += *dq * step;
        }
    }
}
