use super::*;
use dyngen::{Model, SetKind};
use powerball_bus::driver::Profile;
use powerball_bus::driver::lwa4p::LWA4P;
use powerball_bus::driver::{Cause, Driver};
use powerball_bus::transport::{ArmError, Interrupt, Memory};
use powerball_controller::friction::{TABLE_2, TanhFriction};
use powerball_identification::NumericArm;
use powerball_logs::motion::Motion;
use powerball_virtual_arm::slave::{CurrentMode, Setup};
use powerball_virtual_arm::{PlantEffect, VirtualArm, lwa4p};

const SPRING: f64 = 6.0;

type Arm = Master<Memory<VirtualArm>, 6>;

pub(super) fn setup() -> Setup {
    let mode = CurrentMode { mode: 4, target: LWA4P.current.unwrap().setpoint };
    let mut setup = lwa4p::setup([0.0; 6], 1).unwrap().with_current_mode(mode);
    setup.modules.iter_mut().for_each(|module| module.commutated = true);
    setup.plant = setup.plant.with(PlantEffect::Spring { joint: 0, stiffness: SPRING, rest: -0.2 });
    setup
}

pub(super) fn master_on<B: Bus>(profile: Profile<6>, bus: B) -> Master<B, 6> {
    Master::new(Driver::new(profile).unwrap(), bus)
}

fn master(profile: Profile<6>) -> Arm {
    master_on(profile, Memory::new(VirtualArm::new(setup()).unwrap(), 500_000))
}

pub(super) fn numeric() -> NumericArm<6> {
    let model = Model::derive(lwa4p::arm().unwrap()).unwrap();
    let all: Vec<f64> = lwa4p::links().iter().flat_map(|b| b.parameters()).collect();
    let values = model.set_values(model.set(SetKind::Minimal).unwrap(), &all);
    NumericArm::new(&model, &values, [0.0; 6]).unwrap().unwrap()
}

pub(super) fn path(amplitude: f64, cycles: u32) -> Path<6> {
    let mut motion = Motion::new(6, 0.005);
    for k in 0..=cycles {
        let w = std::f64::consts::TAU * f64::from(k) / f64::from(cycles);
        motion.push((0..6).map(|j| [amplitude * (0.2 + 0.05 * f64::from(j)) * (1.0 - w.cos()), 0.0, 0.0]));
    }
    Path::clear(&motion, &Envelope::new(|_| None), &LWA4P).unwrap()
}

/// True parts of the path; `spring` tells whether the effect is known.
pub(super) fn parts(path: &Path<6>, arm: &NumericArm<6>, spring: bool) -> Parts<6> {
    let laws = TABLE_2.map(TanhFriction::new);
    let of = |f: &dyn Fn(&Reference<f64, 6>) -> SVector<f64, 6>| path.reference.iter().map(f).collect();
    let effect = |r: &Reference<f64, 6>| {
        // That of the virtual arm: stiffness around rest.
        let share = if spring { SPRING } else { 0.0 };
        SVector::from([share * (r.q[0] + 0.2), 0.0, 0.0, 0.0, 0.0, 0.0])
    };
    Parts {
        rigid: of(&|r| {
            arm.mass_matrix(&r.q) * r.ddq + arm.coriolis_times_velocity(&r.q, &r.dq) + arm.gravity(&r.q)
        }),
        friction: of(&|r| SVector::from_fn(|j, _| laws[j].torque(r.dq[j]))),
        effects: of(&effect),
    }
}

fn rests(master: &Arm) {
    let arm = master.bus().peer();
    for (j, node) in arm.nodes().iter().enumerate() {
        assert!(node.brake_closed() && !node.state().has_torque(), "joint {}", j + 1);
    }
}

#[test]
fn a_known_effect_halves_the_error_and_the_observer_sees_an_unknown_one() {
    let (arm, path) = (numeric(), path(1.0, 600));
    let law = Law::Torque(ComputedTorque::for_period(0.005));
    let best = parts(&path, &arm, true);
    let drive = |parts: Option<Parts<6>>| {
        let run = Run {
            path: &path,
            arm: &arm,
            parts: parts.as_ref(),
            best: &best,
            give: 0.0,
            guard: None,
            law,
            contact: None,
            accept_unverified: true,
        };
        let (master, track, _) = run.follow(master(LWA4P), Envelope::new(|_| None), None, |_, _| ()).unwrap();
        rests(&master);
        assert_eq!(track.samples.len(), 601);
        track
    };
    let [alone, base, explained] =
        [None, Some(parts(&path, &arm, false)), Some(parts(&path, &arm, true))].map(drive);
    let rms = |track: &Track<6>| track.error(&path, 0.0).rms[0];
    assert!(rms(&base) < 0.5 * rms(&alone), "{} {}", rms(&base), rms(&alone));
    assert!(rms(&explained) < 0.5 * rms(&base), "{} {}", rms(&explained), rms(&base));
    // The spring pulls with up to 4 N·m; the observer lags by a thirtieth of a second.
    let seen = |track: &Track<6>| -> f64 {
        let off = |s: &Sample<6>| s.external.unwrap()[0] + SPRING * (s.q[0] + 0.2);
        (track.samples.iter().map(|s| off(s).powi(2)).sum::<f64>() / 601.0).sqrt()
    };
    assert!(seen(&base) < 0.6, "{}", seen(&base));
    let external = explained.torques().external.unwrap()[0];
    assert!(external < 0.6, "{external}");
}

#[test]
fn torque_offsets_take_the_work_off_the_drives_own_feedback() {
    let (arm, path) = (numeric(), path(1.0, 600));
    let best = parts(&path, &arm, true);
    let drive = |parts: Option<Parts<6>>| {
        let law = Law::Feedforward;
        let run = Run {
            path: &path,
            arm: &arm,
            parts: parts.as_ref(),
            best: &best,
            give: 0.0,
            guard: None,
            law,
            contact: None,
            accept_unverified: false,
        };
        let profile = LWA4P.with_torque_offset();
        let (master, track, _) =
            run.follow(master(profile), Envelope::new(|_| None), None, |_, _| ()).unwrap();
        rests(&master);
        track
    };
    let [alone, explained] = [None, Some(parts(&path, &arm, true))].map(drive);
    let tracks = [&alone, &explained];
    let delay = common_delay(&tracks, &path);
    assert!((2.5..4.0).contains(&(delay / 0.005)), "{delay}");
    for track in tracks {
        assert!(track.error(&path, delay).rms.iter().all(|e| *e < 1e-4));
    }
    let left = |track: &Track<6>, j: usize| track.torques().feedback[j];
    for j in 0..4 {
        assert!(left(&explained, j) < 0.25 * left(&alone, j), "joint {}", j + 1);
    }
}

#[test]
fn what_is_not_accepted_not_known_or_not_stable_is_refused_with_closed_brakes() {
    let refused = |profile: Profile<6>, accept: bool| {
        let failed = TorqueLoop::bring_up(master(profile), accept).map(|_| ()).unwrap_err();
        failed.to_string()
    };
    assert!(refused(LWA4P, false).contains("never verified"));
    let mut unknown = LWA4P;
    unknown.joints[2].units.rated_torque = 0.0;
    let text = refused(unknown, true);
    assert!(text.contains("joint 3") && text.contains("torque constant"), "{text}");
    let (arm, poses) = (numeric(), [SVector::zeros()]);
    let judge = |w: f64| Law::Torque(ComputedTorque::of_bandwidth(w)).judge(&arm, poses, 0.005);
    assert!(judge(20.0).unwrap() < 0.95);
    assert!(judge(150.0).unwrap_err().contains("not stable at 200 Hz"));
}

#[test]
fn an_interrupt_stops_the_law_and_the_arm() {
    let (arm, path) = (numeric(), path(1.0, 600));
    let interrupt = Interrupt::default();
    let mut cycles = 0;
    let mut held = TorqueLoop::bring_up(master(LWA4P).with_interrupt(interrupt.clone()), true).unwrap();
    let ended = held.run(None, |m| {
        cycles += 1;
        if cycles == 100 {
            interrupt.ask();
        }
        let reference = path.at(0.0);
        Some(ComputedTorque::for_period(0.005).torque(&arm, &m.state, &reference))
    });
    assert!(matches!(&ended, Err(RecordError::Arm(ArmError::Stopped(Cause::Interrupted, _)))), "{ended:?}");
    assert!(cycles < 104);
}
