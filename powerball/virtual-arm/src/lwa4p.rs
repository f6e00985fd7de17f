//! The virtual LWA 4P: bodies, friction and sensors that a real one could have.

use super::dynamics::{Body, Dynamics};
use super::effect::{Places, PlantEffect};
use super::plant::{Plant, Sensors};
use super::slave::{CurrentMode, Identity, Module, Setup};
use dyngen::{Arm, Diagnostics};
use powerball_bus::driver::lwa4p::LWA4P;
use powerball_controller::friction::{TABLE_2, TanhFriction};
use powerball_logs::chain::Chain;
use rand::Rng;
use std::ops::Range;

/// The arm file of the hardware, which the virtual arm follows to the letter.
pub const ARM_FILE: &str = include_str!("../lwa4p.toml");

/// Distance from the wrist's centre to the flange, m.
const FLANGE: f64 = 0.085;

/// Rotor inertia of the ERB 145 and ERB 115 modules at the motor, kg·m²: what motors of their size have.
/// Nothing is published.
const ROTOR_145: f64 = 4.0e-5;
const ROTOR_115: f64 = 1.0e-5;

/// Each link as a box of even density: mass in kg, centre of mass and edges in m in the link's frame.
///
/// The masses are those of the CAD model of the modules and tubes. Frame 2 lies at the elbow with x along the
/// upper arm, frame 3 at the elbow with z along the forearm, frame 4 at the wrist with −y along the forearm,
/// frames 5 and 6 at the wrist. The centres of mass keep the symmetries of Eq. 12, and boxes along the axes
/// then keep those of the tensors; a box is always a possible body.
const LINKS: [(f64, [f64; 3], [f64; 3], f64); 6] = [
    (4.1513, [0.0, -0.020, 0.0], [0.13, 0.16, 0.13], ROTOR_145),
    (1.6770, [-0.175, 0.0, 0.030], [0.25, 0.10, 0.10], ROTOR_145),
    (4.1513, [0.0, -0.012, 0.025], [0.13, 0.13, 0.17], ROTOR_145),
    (1.0277, [0.0, 0.140, 0.012], [0.09, 0.20, 0.09], ROTOR_145),
    (2.0100, [0.0, 0.010, 0.020], [0.11, 0.11, 0.14], ROTOR_115),
    (0.3000, [0.0, 0.0, 0.070], [0.09, 0.08, 0.03], ROTOR_115),
];

/// The virtual arm's bodies, in the order of the links.
pub fn links() -> Vec<Body> {
    LINKS.iter().map(|(mass, centre, edges, rotor)| Body::even_box(*mass, *centre, *edges, *rotor)).collect()
}

/// The places of random effects on this arm.
#[must_use]
pub fn places() -> Places {
    Places {
        any: (0..6).collect(),
        large: (0..4).collect(),
        // Gravity loads the shoulder and the elbow.
        loaded: vec![1, 2],
        // The elbow and the forearm, whose centres of mass are declared to lie in a plane.
        symmetric: vec![(2, 0.02), (3, 0.06)],
        // Both axes of a module share a housing.
        coupled: [[0, 1], [1, 0], [2, 3], [3, 2], [4, 5], [5, 4]].map(|pair| (pair, 1.0)).to_vec(),
        stiffness: vec![1500.0..3500.0; 6],
        flange: FLANGE,
    }
}

/// Draws an effect of this arm, as [`PlantEffect::draw`] does.
pub fn draw_effect(
    name: &str,
    plant: &Plant,
    session: f64,
    begins: Range<f64>,
    rng: &mut impl Rng,
) -> Option<PlantEffect> {
    PlantEffect::draw(name, plant, &places(), session, begins, rng)
}

/// The arm file as a description.
///
/// # Errors
/// None for the file that is built in; the type is that of every arm file.
pub fn arm() -> Result<Arm, Diagnostics> {
    Arm::parse(ARM_FILE, "lwa4p.toml")
}

/// The virtual arm without any undeclared effect: the rigid bodies of [`links`], Eq. 16 with Table 2,
/// encoders of 0.001° and torque noise.
///
/// # Errors
/// Those of [`arm`].
pub fn plant() -> Result<Plant, Diagnostics> {
    build(Chain::new(&arm()?))
}

/// The arm of [`plant`] with its base mounted otherwise: gravity in the base frame, m/s².
///
/// # Errors
/// Those of [`arm`].
pub fn mounted(gravity: [f64; 3]) -> Result<Plant, Diagnostics> {
    let mut chain = Chain::new(&arm()?);
    chain.gravity = gravity.into();
    build(chain)
}

fn build(chain: Chain) -> Result<Plant, Diagnostics> {
    let dynamics = Dynamics::new(chain, links())
        .ok_or_else(|| Diagnostics::whole_file("lwa4p.toml", "the virtual arm has six joints"))?;
    let sensors = Sensors {
        rate: 200.0,
        encoder_step: 0.001f64.to_radians(),
        white: vec![0.25, 0.25, 0.22, 0.18, 0.035, 0.030],
        coloured: vec![0.08, 0.08, 0.07, 0.06, 0.010, 0.010],
        colour_time: 0.15,
    };
    Ok(Plant::new(dynamics, TABLE_2.map(TanhFriction::new).to_vec(), sensors))
}

/// Rated current of the modules, mA, such that a few amperes give the torques that their maker names.
const RATED_145: u32 = 500;
const RATED_115: u32 = 150;

/// The drives of the arm: nodes and the scale of 0x6077 as the driver knows them, limits of the arm file.
///
/// # Errors
/// Those of [`arm`].
pub fn modules() -> Result<Vec<Module>, Diagnostics> {
    let joints = arm()?.joints;
    Ok(joints
        .iter()
        .zip(&LWA4P.joints)
        .map(|(joint, known)| Module {
            node: known.node,
            identity: Identity {
                vendor: VENDOR,
                product: 1,
                revision: 0x0003_0001,
                serial: 1000 + u32::from(known.node.raw()),
            },
            limits: joint.position.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]),
            velocity: joint.velocity.unwrap_or(f64::INFINITY),
            acceleration: joint.acceleration.unwrap_or(f64::INFINITY),
            torque: joint.torque.unwrap_or(f64::INFINITY),
            rated_current: if known.units.rated_torque > 2.0 { RATED_145 } else { RATED_115 },
            rated_torque: known.units.rated_torque,
            commutated: false,
            current_mode: None,
        })
        .collect())
}

/// The vendor that `powerball/lwa4p_bus.toml` names, which says where it is from.
const VENDOR: u32 = 0x0000_015E;

/// The virtual LWA 4P for a bus: [`plant`] with its six drives at `start`, rad.
///
/// # Errors
/// Those of [`arm`].
pub fn setup(start: [f64; 6], seed: u64) -> Result<Setup, Diagnostics> {
    Ok(Setup { plant: plant()?, modules: modules()?, start: start.to_vec(), age: 0.0, seed })
}

/// A setup with drives that have the current mode that the bus profile knows.
#[must_use]
pub fn with_current_mode(setup: Setup) -> Setup {
    match LWA4P.current {
        Some(mode) => setup.with_current_mode(CurrentMode { mode: mode.mode.code(), target: mode.setpoint }),
        None => setup,
    }
}
