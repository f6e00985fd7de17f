//! The test whether a model still holds, in a controller's cycle.
//!
//! It is asked at the rate of its rows, every fourth cycle at 200 Hz. In between the joints take turns, so that no cycle
//! pays for all of them.

use crate::cycle::Joints;
use powerball::controller::change::{Colour, JointTest, Shown, alarm};

/// Cycles from row to row.
pub const TURNS: usize = 4;

/// From one false alarm to the next there are so many rows in the mean: a day at 200/4 Hz.
const LEVEL: f32 = 24.0 * 3600.0 * 50.0;

/// A residual's colour, of the size that the virtual arm's have.
const COLOUR: Colour<f32> =
    Colour { coefficients: [0.6, 0.2, -0.1, 0.05, 0.02, -0.01], deviation: 0.1, margin: 0.05 };

/// The tests of six joints.
pub struct Watch {
    tests: [JointTest<f32>; 6],
    /// The row that they take in turns.
    row: [Shown<f32>; 6],
    rows: u64,
    /// Whose turn it is, 0 to [`TURNS`] − 1.
    pub next: usize,
}

impl Default for Watch {
    fn default() -> Self {
        let nothing = Shown { residual: 0.0, columns: [0.0; 3] };
        Watch { tests: [JointTest::new(COLOUR, 0.1); 6], row: [nothing; 6], rows: 0, next: 0 }
    }
}

impl Watch {
    /// A row in the first of [`TURNS`] cycles; whether its alarm rises, in the last. Measured less predicted torque, the
    /// model's friction and its whole torque, N·m.
    pub fn turn(&mut self, residual: &Joints, friction: &Joints, model: &Joints) -> bool {
        if self.next == 0 {
            self.rows += 1;
            let now = residual.iter().zip(friction).zip(model);
            for (row, ((residual, friction), model)) in self.row.iter_mut().zip(now) {
                let [_, before, _] = row.columns;
                *row = Shown { residual: *residual, columns: [*friction, *model, *model - before] };
            }
        }
        for (joint, (test, row)) in self.tests.iter_mut().zip(&self.row).enumerate() {
            if joint % TURNS == self.next {
                test.update(*row, self.rows);
            }
        }
        self.next = (self.next + 1) % TURNS;
        self.next == 0 && alarm(self.tests.iter().enumerate(), LEVEL).is_some()
    }
}
