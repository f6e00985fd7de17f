//! The test whether a model still holds, in a controller's cycle.
//!
//! The test is asked at the rate of its rows, every fourth cycle at 200 Hz. In between the joints take turns,
//! so that no cycle pays for all of them.

use crate::cycle::Joints;
use powerball::controller::change::{Alarm, Bet, Colour, Joint, Standing, Term, Whitener, alarm};

/// Cycles from row to row.
pub const TURNS: usize = 4;

/// Mean number of rows from one false alarm to the next: a day at 200/4 Hz.
const LEVEL: f32 = 24.0 * 3600.0 * 50.0;

/// A residual's colour, of the size that the virtual arm's have.
const COLOUR: Colour<f32> =
    Colour { coefficients: [0.6, 0.2, -0.1, 0.05, 0.02, -0.01], deviation: 0.1, margin: 0.05 };

/// By how much of itself friction may wander.
const RANGE: f32 = 0.02;

/// What one joint has: its innovations, a bet on a force and one on a change of its friction.
#[derive(Clone, Copy)]
struct Test {
    joint: Joint<f32>,
    constant: Whitener<f32>,
    force: Bet<f32, 1>,
    friction: Bet<f32, 1>,
}

/// The tests of six joints.
pub struct Watch {
    tests: [Test; 6],
    /// Residual and friction of the row that they take in turns, N·m.
    row: [[f32; 2]; 6],
    rows: u64,
    /// Whose turn it is, 0 to [`TURNS`] − 1.
    pub next: usize,
}

impl Default for Watch {
    fn default() -> Self {
        let test = Test {
            joint: Joint::new(COLOUR, RANGE),
            constant: Whitener::default(),
            force: Bet::default(),
            friction: Bet::default(),
        };
        Watch { tests: [test; 6], row: [[0.0; 2]; 6], rows: 0, next: 0 }
    }
}

impl Test {
    fn update(&mut self, [residual, friction]: [f32; 2], row: u64) {
        let constant = self.constant.update(&COLOUR, 1.0);
        let (Some(constant), Some(innovation)) = (constant, self.joint.update(residual, friction)) else {
            return;
        };
        self.force.update(&[Term { innovation, columns: [constant] }], row);
        self.friction.update(&[Term { innovation, columns: [innovation.friction] }], row);
    }
}

impl Watch {
    /// A row in the first of [`TURNS`] cycles; whether its alarm rises, in the last. Measured less predicted
    /// torque and the model's friction, N·m.
    pub fn turn(&mut self, residual: &Joints, friction: &Joints) -> bool {
        if self.next == 0 {
            self.rows += 1;
            for (row, (residual, friction)) in self.row.iter_mut().zip(residual.iter().zip(friction)) {
                *row = [*residual, *friction];
            }
        }
        for (joint, (test, row)) in self.tests.iter_mut().zip(&self.row).enumerate() {
            if joint % TURNS == self.next {
                test.update(*row, self.rows);
            }
        }
        self.next = (self.next + 1) % TURNS;
        self.next == 0 && self.alarm().is_some()
    }

    fn alarm(&self) -> Option<Alarm<f32>> {
        let standing =
            |bet: &Bet<f32, 1>| Standing { weight: 1.0 / 12.0, capital: bet.capital(), since: bet.since() };
        alarm(self.tests.iter().flat_map(|test| [standing(&test.force), standing(&test.friction)]), LEVEL)
    }
}
