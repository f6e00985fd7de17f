//! A drive's servo: position over velocity over current, as cascades are.

/// How hard a servo holds on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gains {
    /// Position loop: rad/s for each rad of following error.
    pub position: f64,
    /// Velocity loop: N·m for each rad/s.
    pub velocity: f64,
    /// Its integral part: N·m/s for each rad/s.
    pub integral: f64,
    /// Torque at the current limit, N·m.
    pub limit: f64,
    /// Coulomb friction that is fed forward with the sign of the wanted velocity, N·m: without it a joint dwells
    /// at each reversal until the integrator has turned round.
    pub friction: f64,
}

/// Below this velocity the friction is not yet fed forward whole, rad/s.
const TURN: f64 = 5e-3;

impl Gains {
    /// Gains for an inertia in kg·m² at the joint: a velocity loop of 120 Hz, an integrator and a position
    /// loop that are slower by four.
    pub fn for_inertia(inertia: f64, limit: f64, friction: f64) -> Self {
        let bandwidth = std::f64::consts::TAU * 120.0;
        let velocity = inertia * bandwidth;
        Gains { position: bandwidth / 4.0, velocity, integral: velocity * bandwidth / 4.0, limit, friction }
    }
}

/// The servo of one joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Servo {
    /// The gains.
    pub gains: Gains,
    /// What the velocity loop's integrator holds, N·m.
    held: f64,
}

impl Servo {
    /// A servo that holds nothing yet.
    pub fn new(gains: Gains) -> Self {
        Servo { gains, held: 0.0 }
    }

    /// Forgets what the integrator holds.
    pub fn reset(&mut self) {
        self.held = 0.0;
    }

    /// The torque for the next `h` s, N·m: `wanted` and `actual` are position (rad) and velocity (rad/s),
    /// `forward` is torque that is fed forward.
    ///
    /// At the current limit the integrator waits, unless it leads away from the limit.
    pub fn torque(&mut self, h: f64, wanted: [f64; 2], actual: [f64; 2], forward: f64) -> f64 {
        let Gains { position, velocity, integral, limit, friction } = self.gains;
        let error = wanted[1] + position * (wanted[0] - actual[0]) - actual[1];
        let more = self.held + h * integral * error;
        let turning = friction * wanted[1] / wanted[1].hypot(TURN);
        let asked = forward + turning + velocity * error + more;
        if asked.abs() <= limit || asked * error < 0.0 {
            self.held = more.clamp(-limit, limit);
        }
        asked.clamp(-limit, limit)
    }
}
