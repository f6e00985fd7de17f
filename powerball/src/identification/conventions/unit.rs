//! The unit of the torques: by the weight and inertia that they would give an arm of this size.
//!
//! Weight grows with the cube of the reach, inertia with its fifth power. Of arms from a pendulum of half a
//! metre to a UR10e, weight as a mass at full reach over reach³ is 0.2 to 21 kg/m³, and inertia over reach⁵
//! is 0.04 to 21 kg/m³. A unit that is a thousand times too small or a gear ratio that is missing is far
//! beyond both.

use super::change::FACTOR;
use super::factors::median;
use super::gravity::{acts, weight};
use super::result::GravityIs;
use super::search::Found;
use dyngen::Arm;
use dyngen::exact::rational::to_f64;

/// The geometric mean of both above this is no arm's, kg/m³.
const HEAVIEST: f64 = 100.0;
/// Inertia alone above this.
const HEAVIEST_INERTIA: f64 = 300.0;
/// Both below these are no arm's either.
const LIGHTEST: [f64; 2] = [0.2, 0.02];
/// Torques that stay below this share of every joint's limit are too small, where they carry the arm's weight.
const IDLE: f64 = 0.03;
/// Weight below this share of inertia is no weight: arms have once to thirty times as much.
const WEIGHTLESS: f64 = 0.15;
/// Factors agree with numbers of the arm file within this.
const AGREE: f64 = 1.2;

/// What the size of the torques says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Scale {
    Plausible,
    TooLarge,
    TooSmall,
    NotTold,
}

/// The unit that torques seem to be in.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Unit {
    NewtonMetre,
    Milli,
    /// Before the gear: each column is to be multiplied by its gear ratio.
    BeforeGear(Vec<f64>),
    /// Currents: each column is to be multiplied by its torque constant where the arm file has it.
    Ampere(Option<Vec<f64>>),
    /// Before the gear, or currents: all factors are alike, and both are of that size.
    GearOrAmpere,
    /// Some columns are in another unit than most.
    OfItsOwn(Vec<f64>),
    NotTold,
}

/// Weight and inertia over reach, kg/m³, and the largest share of a joint's torque limit.
#[derive(Clone, Copy, Debug)]
pub(super) struct Size {
    pub(super) weight: Option<f64>,
    pub(super) inertia: Option<f64>,
    pub(super) of_limit: Option<f64>,
}

impl Size {
    pub(super) fn of(found: &Found<'_>) -> Size {
        let (rows, arm) = (&found.rows, found.rows.data.body.arm());
        let fit = &found.judged.fits[0];
        let reach = reach(arm);
        let g = rows.data.body.gravity().iter().map(|x| x * x).sum::<f64>().sqrt();
        let (_, largest) = weight(rows, &fit.theta);
        let over = |x: f64| (x.is_finite() && x > 0.0).then_some(x);
        let mut squares = (0.0, 0usize);
        for recording in &rows.data.recordings {
            squares.0 += recording.v.iter().map(|v| v * v).sum::<f64>();
            squares.1 += recording.len();
        }
        let velocity = squares.0 / squares.1.max(1) as f64;
        let inertia = 2.0 * found.energies[0].kinetic(fit).value.abs() / velocity;
        Size {
            weight: if acts(rows) { over(largest / g / reach.powi(4)) } else { None },
            inertia: over(inertia / reach.powi(5)),
            of_limit: of_limit(found, arm),
        }
    }

    /// Whether the torques carry no weight, though they move an arm.
    pub(super) fn is_weightless(&self) -> bool {
        matches!((self.weight, self.inertia), (Some(weight), Some(inertia)) if weight < WEIGHTLESS * inertia)
    }

    /// What the size of the torques says, with what is known of gravity in them.
    pub(super) fn scale(&self, gravity: Option<GravityIs>) -> Scale {
        let (Some(inertia), weight) = (self.inertia, self.weight) else { return Scale::NotTold };
        let heavy = match weight.filter(|_| !self.is_weightless()) {
            Some(weight) => (weight * inertia).sqrt() > HEAVIEST,
            None => inertia > HEAVIEST_INERTIA,
        };
        let light = weight.is_some_and(|weight| weight < LIGHTEST[0] && inertia < LIGHTEST[1]);
        let idle = gravity == Some(GravityIs::Included) && self.of_limit.is_some_and(|share| share < IDLE);
        match (heavy, light || idle) {
            (true, _) => Scale::TooLarge,
            (_, true) => Scale::TooSmall,
            _ => Scale::Plausible,
        }
    }
}

/// The lengths of the links together, m.
pub(super) fn reach(arm: &Arm) -> f64 {
    arm.joints.iter().map(|j| to_f64(&j.a).hypot(to_f64(&j.b)).hypot(to_f64(&j.d))).sum()
}

/// The largest share of its limit that a joint's torque reaches in all but one of a hundred rows.
fn of_limit(found: &Found<'_>, arm: &Arm) -> Option<f64> {
    let share = |joint: usize| {
        let limit = arm.joints[joint].torque?;
        let mut torque: Vec<f64> =
            [0, 1].iter().flat_map(|part| found.rows.torque(&found.read.torques, joint, *part)).collect();
        torque.iter_mut().for_each(|t| *t = t.abs());
        torque.sort_by(f64::total_cmp);
        // The factor of the reading is not the log's.
        Some(torque.get(torque.len() * 99 / 100)? / limit / found.read.torques.gain[joint].abs())
    };
    (0..arm.dof()).map(share).collect::<Option<Vec<f64>>>()?.into_iter().max_by(f64::total_cmp)
}

/// The unit by size and by the factors that were found.
pub(super) fn unit(found: &Found<'_>, scale: Scale) -> Unit {
    let arm = found.rows.data.body.arm();
    let gains: Vec<f64> = found.read.torques.gain.iter().map(|g| g.abs()).collect();
    let filed = |of: &dyn Fn(usize) -> Option<f64>| {
        (0..arm.dof()).map(of).collect::<Option<Vec<f64>>>().filter(|x| x.iter().all(|x| *x > 0.0))
    };
    let ratios = filed(&|j| arm.joints[j].rotor_ratio.as_ref().map(|r| to_f64(r).abs()));
    let constants = filed(&|j| arm.joints[j].torque_constant.map(f64::abs));
    let agree = |numbers: &Option<Vec<f64>>| {
        numbers.as_ref().is_some_and(|numbers| {
            let apart: Vec<f64> = numbers.iter().zip(&gains).map(|(n, g)| (n / g).ln()).collect();
            let common = median(apart.clone());
            apart.iter().all(|x| (x - common).abs() < AGREE.ln())
        })
    };
    if found.read.torques.is_scaled() {
        if agree(&ratios) {
            return ratios.map_or(Unit::NotTold, Unit::BeforeGear);
        }
        if agree(&constants) {
            return Unit::Ampere(constants);
        }
        // Most columns of one unit, and a few that are surely not of it; anything between is told as it is.
        let odd = gains.iter().filter(|g| g.ln().abs() > FACTOR.ln()).count();
        let usual = gains.iter().filter(|g| g.ln().abs() < AGREE.ln()).count();
        let few = 3 * odd <= gains.len() && odd + usual == gains.len() && scale != Scale::TooSmall;
        let own = |g: &f64| if g.ln().abs() > FACTOR.ln() { *g } else { 1.0 };
        return if few { Unit::OfItsOwn(gains.iter().map(own).collect()) } else { Unit::Ampere(None) };
    }
    match scale {
        Scale::Plausible => Unit::NewtonMetre,
        Scale::NotTold => Unit::NotTold,
        Scale::TooLarge => Unit::Milli,
        Scale::TooSmall => Unit::GearOrAmpere,
    }
}
