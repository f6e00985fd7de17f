//! Prints the bits of every output, as one hash a function, and on the emulated core what every call costs.
#![cfg_attr(target_os = "none", no_std, no_main)]

use core::fmt::Write;
use core::hint::black_box;
use powerball::controller::dynamics::{Reference, State};
use powerball::controller::online::SquareRoot;
use powerball_firmware::cycle::{self, Controller, Joints};
use powerball_firmware::f32 as single;
use powerball_firmware::{arm, bus};

/// FNV-1a over the bits of numbers.
struct Hash(u64);

impl Hash {
    const NEW: Hash = Hash(0xcbf2_9ce4_8422_2325);

    fn add(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.0 = (self.0 ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }
}

macro_rules! bits {
    ($out:expr, $scalar:ident) => {{
        use powerball_firmware::$scalar::*;
        let p = prepared(&Parameters::from(PARAMETERS));
        let names = [
            "trig",
            "tau",
            "regressor",
            "mass_matrix",
            "coriolis",
            "gravity",
            "friction",
            "control",
            "estimator",
        ];
        let mut hashes = [const { Hash::NEW }; 9];
        let mut online = SquareRoot::<$scalar, { arm::PARAMETERS }>::new(1e-3);
        for state in &STATES {
            let [q, dq, ddq] = state.map(Joints::from);
            let trig = trig(&q);
            let y = regressor(&trig, &dq, &ddq);
            let torque = tau(&trig, &dq, &ddq, &p);
            let mut add = |k: usize, values: &[$scalar]| {
                values.iter().for_each(|x| hashes[k].add(&x.to_bits().to_le_bytes()))
            };
            add(0, &trig.sin);
            add(0, &trig.cos);
            add(1, torque.as_slice());
            add(2, y.as_slice());
            add(3, mass_matrix(&trig, &p).as_slice());
            add(4, coriolis(&trig, &dq, &p).as_slice());
            add(5, gravity(&trig, &p).as_slice());
            add(6, friction(&dq).as_slice());
            add(7, control([&q, &dq], [&(q * 0.99), &dq, &ddq], &p).as_slice());
            for i in 0..6 {
                estimator_row(&mut online, &y.row(i).transpose(), torque[i]);
            }
            add(8, estimate(&online).unwrap_or_default().as_slice());
        }
        for (name, hash) in names.iter().zip(&hashes) {
            let _ = writeln!($out, "bits {} {name} {:016x}", stringify!($scalar), hash.0);
        }
    }};
}

/// Cycles of a controller along a motion. From the middle on joint 2 needs 3 N·m more than its model says: in
/// which cycle the test reports so first is printed next to the bits.
fn bits_of_cycles(out: &mut impl Write) {
    let values = single::prepared(&single::PARAMETERS.into());
    let mut controller = Controller::default();
    let (mut hash, mut first) = (Hash::NEW, None);
    for k in 0..2000u16 {
        let rates = Joints::from_fn(|j, _| 1.0 + 0.1 * j as f32);
        let trig = single::trig(&(rates * (f32::from(k) * 0.005)));
        let wave = |waves: &[f32]| Joints::from_fn(|j, _| 0.3 * waves[j]);
        let (q, dq) = (wave(&trig.sin), wave(&trig.cos).component_mul(&rates));
        let reference = Reference { q, dq, ddq: -q.component_mul(&rates).component_mul(&rates) };
        let output = cycle::control(&mut controller, &State { q: q * 0.99, dq }, &reference, &values);
        let mut measured = output.model;
        measured[1] += if k < 1000 { 0.0 } else { 3.0 };
        if cycle::watch(&mut controller.watch, &output, &measured) {
            first = first.or(Some(k));
        }
        for x in output.torque.iter().chain(&output.external) {
            hash.add(&x.to_bits().to_le_bytes());
        }
    }
    let _ = writeln!(out, "bits f32 cycles {:016x}, alarm in {first:?}", hash.0);
}

fn bits(out: &mut impl Write) {
    bits!(out, f32);
    bits_of_cycles(out);
    bits!(out, f64);
    let mut hash = Hash::NEW;
    if let Ok(mut driver) = bus::driver() {
        let _ = driver.start(powerball::bus::driver::ControlMode::InterpolatedPosition, false);
        for k in 0..200 {
            let (mailbox, _) = bus::step(&mut driver, 1000 * k, &[], &[0.0; 6]);
            mailbox.frames().for_each(|frame| {
                hash.add(&frame.raw_id().to_le_bytes());
                hash.add(frame.bytes());
            });
        }
    }
    let _ = writeln!(out, "bits bus step {:016x}", hash.0);
}

#[cfg(not(target_os = "none"))]
fn main() {
    let mut text = String::new();
    bits(&mut text);
    print!("{text}");
}

#[cfg(target_os = "none")]
macro_rules! costs {
    ($out:expr, $counter:expr, $scalar:ident) => {{
        use powerball_firmware::$scalar::*;
        let p = prepared(&Parameters::from(PARAMETERS));
        let [q, dq, ddq] = STATES[0].map(Joints::from);
        let ready = trig(&q);
        let y = regressor(&ready, &dq, &ddq);
        let row: Parameters = y.row(2).transpose();
        let mut online = SquareRoot::new(1e-3);
        for i in 0..6 {
            estimator_row(&mut online, &y.row(i).transpose(), 1.0);
        }
        let full = online;
        let mut cost = |name: &str, call: &mut dyn FnMut()| {
            let stack = powerball_firmware::measure::stack(call);
            let instructions = $counter.instructions(call);
            let _ = writeln!($out, "cost {} {name} {stack} {instructions}", stringify!($scalar));
        };
        cost("trig", &mut || {
            black_box(trig(black_box(&q)));
        });
        cost("tau", &mut || {
            black_box(tau(black_box(&ready), black_box(&dq), black_box(&ddq), black_box(&p)));
        });
        cost("regressor", &mut || {
            black_box(regressor(black_box(&ready), black_box(&dq), black_box(&ddq)));
        });
        cost("mass_matrix", &mut || {
            black_box(mass_matrix(black_box(&ready), black_box(&p)));
        });
        cost("coriolis", &mut || {
            black_box(coriolis(black_box(&ready), black_box(&dq), black_box(&p)));
        });
        cost("gravity", &mut || {
            black_box(gravity(black_box(&ready), black_box(&p)));
        });
        cost("friction", &mut || {
            black_box(friction(black_box(&dq)));
        });
        cost("control", &mut || {
            black_box(control(black_box([&q, &dq]), black_box([&q, &dq, &ddq]), black_box(&p)));
        });
        cost("estimator_row", &mut || {
            black_box(estimator_row(black_box(&mut online), black_box(&row), black_box(1.0)));
        });
        cost("estimate", &mut || {
            black_box(estimate(black_box(&full)));
        });
    }};
}

/// A controller's cycle: without the test whether the model holds; all turns of a row of that test; the
/// dearest cycle with its turn.
#[cfg(target_os = "none")]
fn costs_of_cycle(out: &mut impl Write, counter: &mut powerball_firmware::measure::Counter) {
    use powerball_firmware::measure::stack;
    use powerball_firmware::watch::TURNS;
    let values = single::prepared(&single::PARAMETERS.into());
    let [q, dq, ddq] = single::STATES[0].map(Joints::from);
    let (state, reference) = (State { q: q * 0.99, dq: dq * 0.98 }, Reference { q, dq, ddq });
    let mut controller = Controller::default();
    let output = cycle::control(&mut controller, &state, &reference, &values);
    let measured = output.model * 1.01;

    let mut control = || {
        black_box(cycle::control(
            black_box(&mut controller),
            black_box(&state),
            black_box(&reference),
            &values,
        ));
    };
    let _ =
        writeln!(out, "cost cycle control {} {}", stack(&mut control), counter.instructions(&mut control));
    let mut row = || {
        for _ in 0..TURNS {
            black_box(cycle::watch(
                black_box(&mut controller.watch),
                black_box(&output),
                black_box(&measured),
            ));
        }
    };
    let _ = writeln!(out, "cost cycle row {} {}", stack(&mut row), counter.instructions(&mut row));
    let dearest = (0..TURNS).fold([0; 2], |[deep, many], turn| {
        let mut step = || {
            controller.watch.next = turn;
            black_box(cycle::step(
                black_box(&mut controller),
                black_box(&state),
                black_box(&reference),
                black_box(&measured),
                &values,
            ));
        };
        [deep.max(stack(&mut step) as u32), many.max(counter.instructions(&mut step))]
    });
    let _ = writeln!(out, "cost cycle step {} {}", dearest[0], dearest[1]);
}

#[cfg(target_os = "none")]
mod target {
    use super::*;
    use cortex_m_rt::entry;
    use cortex_m_semihosting::{debug, hio};

    #[panic_handler]
    fn panic(info: &core::panic::PanicInfo) -> ! {
        if let Ok(mut out) = hio::hstdout() {
            let _ = writeln!(out, "{info}");
        }
        debug::exit(debug::EXIT_FAILURE);
        loop {
            core::hint::spin_loop();
        }
    }

    #[entry]
    fn main() -> ! {
        if let (Ok(mut out), Some(peripherals)) = (hio::hstdout(), cortex_m::Peripherals::take()) {
            bits(&mut out);
            let mut counter = powerball_firmware::measure::Counter::new(peripherals.SYST);
            costs!(out, counter, f32);
            costs_of_cycle(&mut out, &mut counter);
            costs!(out, counter, f64);
            let mut driver = bus::driver();
            if let Ok(driver) = &mut driver {
                let _ = driver.start(powerball::bus::driver::ControlMode::InterpolatedPosition, false);
                let mut step = || {
                    let _ = black_box(bus::step(black_box(driver), 1, &[], black_box(&[0.0; 6])));
                };
                let stack = powerball_firmware::measure::stack(&mut step);
                let _ = writeln!(out, "cost bus step {stack} {}", counter.instructions(&mut step));
            }
            debug::exit(debug::EXIT_SUCCESS);
        }
        loop {
            core::hint::spin_loop();
        }
    }
}
