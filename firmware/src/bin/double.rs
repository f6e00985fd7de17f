//! A controller in double precision with the driver of the bus. That it links proves that it cannot panic and
//! that nothing allocates.
#![no_std]
#![no_main]

#[path = "../proof.rs"]
mod proof;

use core::hint::black_box;
use cortex_m_rt::entry;
use powerball::controller::online::SquareRoot;
use powerball_firmware::f64::{self as double, Joints, Parameters};
use powerball_firmware::{arm, bus};

#[entry]
fn main() -> ! {
    let mut online = SquareRoot::<f64, { arm::PARAMETERS }>::new(1e-3);
    let mut driver = bus::driver();
    let mut now = 0;
    loop {
        let [q, dq, ddq] = black_box(double::STATES[0]).map(Joints::from);
        let p = double::prepared(&black_box(Parameters::from(double::PARAMETERS)));
        let trig = double::trig(&q);
        let y = double::regressor(&trig, &dq, &ddq);
        black_box(double::mass_matrix(&trig, &p));
        black_box(double::coriolis(&trig, &dq, &p));
        black_box(double::gravity(&trig, &p));
        let torque = black_box(double::control([&q, &dq], [&q, &dq, &ddq], &p));
        for i in 0..6 {
            double::estimator_row(&mut online, &y.row(i).transpose(), torque[i]);
        }
        black_box(double::estimate(&online));
        if let Ok(driver) = &mut driver {
            now += black_box(1000);
            let came = black_box([powerball::bus::canopen::Frame::from_raw(0x183, &[0; 8])]);
            let _ = black_box(bus::step(
                black_box(driver),
                now,
                came.as_slice().first().map_or(&[], Option::as_slice),
                &torque.into(),
            ));
        }
    }
}
