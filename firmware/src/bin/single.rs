//! A controller in single precision. That it links proves that it cannot panic and that nothing allocates;
//! the test looks for arithmetic on `f64` in its symbols.
#![no_std]
#![no_main]

#[path = "../proof.rs"]
mod proof;

use core::hint::black_box;
use cortex_m_rt::entry;
use powerball::controller::dynamics::{Reference, State};
use powerball::controller::online::SquareRoot;
use powerball_firmware::arm;
use powerball_firmware::cycle::{self, Controller};
use powerball_firmware::f32::{self as single, Joints, Parameters};

#[entry]
fn main() -> ! {
    let mut online = SquareRoot::<f32, { arm::PARAMETERS }>::new(1e-3);
    let mut controller = Controller::default();
    loop {
        let [q, dq, ddq] = black_box(single::STATES[0]).map(Joints::from);
        let p = single::prepared(&black_box(Parameters::from(single::PARAMETERS)));
        let trig = single::trig(&q);
        let y = single::regressor(&trig, &dq, &ddq);
        black_box(single::mass_matrix(&trig, &p));
        black_box(single::coriolis(&trig, &dq, &p));
        black_box(single::gravity(&trig, &p));
        let torque = black_box(single::control([&q, &dq], [&q, &dq, &ddq], &p));
        for i in 0..6 {
            single::estimator_row(&mut online, &y.row(i).transpose(), torque[i]);
        }
        black_box(single::estimate(&online));
        let state = black_box(State { q, dq });
        let reference = black_box(Reference { q, dq, ddq });
        black_box(cycle::step(black_box(&mut controller), &state, &reference, &torque, &p));
    }
}
