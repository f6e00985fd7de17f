//! Motion of one joint that loads another one: shared bearings, cables, belts through a joint, and motors
//! that turn with two joints.

use super::candidate::scaled;
use super::words::{Words, list, number};
use super::{Axis, Candidate, Class, Context, Effect, Found, Placed};
use powerball_controller::JointNumber;
use powerball_controller::correction::Law;
use powerball_controller::friction::TanhFriction;
use serde::Serialize;

/// On joint i: c·tanh(γ·q̇ₖ) (cross-joint Coulomb friction), c·q̇ₖ or c·q̈ₖ of another joint k; or a friction
/// of k's own steepnesses with levels of its own, c₁·tanh(γ₂·q̇ₖ) + c₂·tanh(γ₄·q̇ₖ) + c₃·q̇ₖ (Eq. 16).
///
/// Or joint i's motor turns with both (a wrist, a parallelogram, a belt through a joint): its position is
/// θ = qᵢ + ρ·qₖ, its torque τ = c·tanh(γ·θ̇) + v·θ̇ + I·θ̈, with c, v, I ≥ 0; joint i feels τ, joint k ρ·τ
/// (virtual work).
pub(super) struct JointCoupling;

/// Whose motion is felt, and how.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// The joint k whose motion is felt.
    pub from: JointNumber,
    /// How it is felt.
    pub kind: Kind,
}

/// How another joint's motion is felt.
#[derive(Clone, Debug, PartialEq)]
pub enum Kind {
    /// Coupling by cross-joint Coulomb friction.
    Coulomb,
    /// Coupling in proportion to its velocity.
    Viscous,
    /// Coupling in proportion to its acceleration.
    Inertial,
    /// Coupling by its whole friction, with levels of its own.
    Friction {
        /// γ₂ and γ₄ of the joint, where their levels are not zero, s/rad.
        steepness: Vec<f64>,
    },
    /// Coupling by a motor that turns with both joints.
    Transmission(Drive),
}

/// A motor that turns with two joints.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drive {
    /// ρ: how far it turns with the other joint.
    pub ratio: f64,
    /// γ of its Coulomb friction, s/rad.
    pub steepness: f64,
    /// Whether it has viscous friction.
    pub viscous: bool,
    /// Whether its rotor's inertia is felt.
    pub inertia: bool,
}

impl Kind {
    /// The name in results.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Kind::Coulomb => "coulomb",
            Kind::Viscous => "viscous",
            Kind::Inertial => "inertial",
            Kind::Friction { .. } => "friction",
            Kind::Transmission(_) => "transmission",
        }
    }
}

/// Kinds that there are.
const KINDS: usize = 4;
/// Ratios that are tried of a motor that turns with two joints.
const RATIOS: [f64; 2] = [1.0, -1.0];
/// A motor whose viscous friction and rotor are felt, or one of them.
const DRIVES: [(bool, bool); 3] = [(true, true), (false, true), (true, false)];

/// Figures of this effect in a result, one entry per pair of joints.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Figures {
    /// The coefficient of the law in SI units; of a friction its share in that of the other joint at that
    /// joint's top velocity; of a transmission its Coulomb friction, N·m.
    pub coefficient: Vec<f64>,
    /// The joint whose motion is felt.
    pub from_joint: Vec<JointNumber>,
    /// How it is felt: [`Kind::name`].
    pub law: Vec<&'static str>,
    /// The motors that turn with two joints.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub transmissions: Vec<Transmission>,
}

impl Figures {
    /// The figures in words.
    #[must_use]
    pub(super) fn in_words(&self, _: &Words<'_>) -> String {
        let one = |((law, from), c): ((&&str, &JointNumber), &f64)| {
            format!("{law} of joint {from}: {}", number(*c))
        };
        format!("{} (SI units)", list(self.law.iter().zip(&self.from_joint).zip(&self.coefficient).map(one)))
    }
}

/// A motor that turns with two joints, as found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Transmission {
    /// The joint whose motor it is.
    pub motor: JointNumber,
    /// The joint with which it turns too.
    pub with: JointNumber,
    /// How far it turns with that one.
    pub ratio: f64,
    /// Coulomb friction of the transmission, N·m.
    pub coulomb: f64,
    /// Viscous friction of the transmission, N·m·s/rad.
    pub viscous: f64,
    /// Inertia of the rotor beyond that of the arm file's rotors, at the joint, kg·m².
    pub inertia: f64,
    /// The block for the arm file.
    pub arm_file: String,
}

impl Effect for JointCoupling {
    fn name(&self) -> &'static str {
        "joint_coupling"
    }

    fn class(&self) -> Class {
        Class::Dynamics
    }

    /// A joint may feel several others.
    fn excludes(&self, a: &Candidate, b: &Candidate) -> bool {
        let (mut one, mut other) = (a.joints.clone(), b.joints.clone());
        one.sort_unstable();
        other.sort_unstable();
        one == other && (one.len() > 1 || from(a) == from(b))
    }

    fn shown_by(&self, candidate: &Candidate) -> Axis {
        Axis::Velocity(from(candidate).unwrap_or(candidate.joints[0]))
    }

    fn candidates(&self, context: &Context<'_>) -> Vec<Candidate> {
        let joints: Vec<JointNumber> = context.moving_joints().collect();
        let options = KINDS * joints.len().saturating_sub(1);
        let mut candidates = Vec::new();
        for &i in &joints {
            for &k in joints.iter().filter(|k| **k != i) {
                let mut on = |kind| candidates.push(Candidate::on(i, Settings { from: k, kind }, options));
                [Kind::Coulomb, Kind::Viscous, Kind::Inertial].into_iter().for_each(&mut on);
                let [g1, g2, g3, g4, _] = context.fit.friction(k.index());
                let levels = [(g1, g2), (g3, g4)].into_iter().filter(|level| level.0 > 0.0);
                let steepness: Vec<f64> = levels.map(|level| level.1).collect();
                if !steepness.is_empty() {
                    on(Kind::Friction { steepness });
                }
                let steepness = context.steepness(i);
                let drives = RATIOS.into_iter().flat_map(|ratio| {
                    DRIVES.map(|(viscous, inertia)| Drive { ratio, steepness, viscous, inertia })
                });
                candidates.extend(drives.map(|drive| {
                    let settings = Settings { from: k, kind: Kind::Transmission(drive) };
                    Candidate::on_all(vec![i, k], settings, options * RATIOS.len())
                }));
            }
        }
        candidates
    }

    fn neighbours(&self, candidate: &Candidate, share: f64) -> Vec<Candidate> {
        let Some(Settings { from, kind: Kind::Transmission(drive) }) = Settings::of(candidate) else {
            return Vec::new();
        };
        let at = |ratio: f64, steepness: f64| {
            let steepness = scaled(drive.steepness, steepness, share);
            let drive = Drive { ratio: scaled(drive.ratio, ratio, share), steepness, ..*drive };
            candidate.with(Settings { from: *from, kind: Kind::Transmission(drive) })
        };
        let ratios = [0.5, 0.8, 1.25, 2.0].map(|f| at(f, 1.0));
        ratios.into_iter().chain([0.25, 0.5, 2.0, 4.0].map(|f| at(1.0, f))).collect()
    }

    /// A motor's friction dissipates and its rotor has inertia.
    fn admissible(&self, candidate: &Candidate, coefficients: &[f64]) -> bool {
        candidate.joints.len() == 1 || coefficients.iter().all(|c| *c >= 0.0)
    }

    fn placed_laws(&self, context: &Context<'_>, candidate: &Candidate) -> Vec<Vec<Placed>> {
        let Some(Settings { from, kind: Kind::Transmission(drive) }) = Settings::of(candidate) else {
            let laws = self.laws(context, candidate);
            return laws.into_iter().map(|law| vec![(candidate.joints[0], law, 1.0)]).collect();
        };
        let (motor, Drive { ratio, steepness, viscous, inertia }) = (candidate.joints[0], *drive);
        // θ seen from either joint.
        let both = |law: &dyn Fn(usize, f64, f64) -> Law<f64>| {
            vec![(motor, law(from.index(), 1.0, ratio), 1.0), (*from, law(motor.index(), ratio, 1.0), ratio)]
        };
        let mut columns =
            vec![both(&|other, own, theirs| Law::SumDirection { other, own, theirs, steepness })];
        if viscous {
            columns.push(both(&|other, own, theirs| Law::SumVelocity { other, own, theirs }));
        }
        if inertia {
            columns.push(both(&|other, own, theirs| Law::SumAcceleration { other, own, theirs }));
        }
        columns
    }

    fn laws(&self, context: &Context<'_>, candidate: &Candidate) -> Vec<Law<f64>> {
        let Some(Settings { from, kind }) = Settings::of(candidate) else { return Vec::new() };
        let other = from.index();
        match kind {
            Kind::Coulomb => vec![Law::OtherDirection { other, steepness: context.steepness(*from) }],
            Kind::Viscous => vec![Law::OtherVelocity { other }],
            Kind::Inertial => vec![Law::OtherAcceleration { other }],
            Kind::Friction { steepness } => {
                let level = |steepness: &f64| Law::OtherDirection { other, steepness: *steepness };
                steepness.iter().map(level).chain([Law::OtherVelocity { other }]).collect()
            }
            Kind::Transmission(_) => Vec::new(),
        }
    }

    fn figures(&self, context: &Context<'_>, found: &[Found<'_>]) -> super::Figures {
        let mut figures = Figures {
            coefficient: Vec::new(),
            from_joint: Vec::new(),
            law: Vec::new(),
            transmissions: Vec::new(),
        };
        for f in found {
            let Some(Settings { from, kind }) = Settings::of(f.candidate) else { continue };
            if let Kind::Transmission(drive) = kind {
                figures.transmissions.push(transmission(f, *from, drive));
            }
            figures.coefficient.push(coefficient(context, *from, kind, f.coefficients));
            figures.from_joint.push(*from);
            figures.law.push(kind.name());
        }
        figures.into()
    }
}

fn from(candidate: &Candidate) -> Option<JointNumber> {
    Settings::of(candidate).map(|settings| settings.from)
}

/// The one number that describes a coupling (see [`Figures::coefficient`]).
fn coefficient(context: &Context<'_>, from: JointNumber, kind: &Kind, coefficients: &[f64]) -> f64 {
    let Kind::Friction { steepness } = kind else { return coefficients[0] };
    let velocity = context.top_velocity(from);
    let levels = steepness.iter().map(|steepness| (steepness * velocity).tanh());
    let felt: f64 = levels.chain([velocity]).zip(coefficients).map(|(x, c)| c * x).sum();
    felt / TanhFriction::new(context.fit.friction(from.index())).torque(velocity)
}

/// A motor that was found, with its block for the arm file.
fn transmission(found: &Found<'_>, with: JointNumber, drive: &Drive) -> Transmission {
    let motor = found.candidate.joints[0];
    let mut more = found.coefficients.iter().skip(1).copied();
    let viscous = if drive.viscous { more.next().unwrap_or(0.0) } else { 0.0 };
    let inertia = if drive.inertia { more.next().unwrap_or(0.0) } else { 0.0 };
    let (ratio, exact) = of_teeth(drive.ratio);
    let arm_file = block(motor, with, &exact);
    Transmission { motor, with, ratio, coulomb: found.coefficients[0], viscous, inertia, arm_file }
}

/// The nearest ratio of few teeth, and as it stands in an arm file; the ratio itself where none is near.
fn of_teeth(ratio: f64) -> (f64, String) {
    for bottom in 1..=MOST_TEETH {
        let top = (ratio * f64::from(bottom)).round();
        let near = top / f64::from(bottom);
        if (near - ratio).abs() < SAME_RATIO * ratio.abs() {
            return (near, if bottom == 1 { top.to_string() } else { format!("\"{top}/{bottom}\"") });
        }
    }
    (ratio, format!("{ratio:.4}"))
}

/// `[[transmission]]` of an arm file: motor positions = matrix · joint positions.
fn block(motor: JointNumber, with: JointNumber, ratio: &str) -> String {
    let (joints, matrix) = match motor < with {
        true => ([motor, with], format!("[[1, {ratio}], [0, 1]]")),
        false => ([with, motor], format!("[[1, 0], [{ratio}, 1]]")),
    };
    let [first, second] = joints;
    format!("[[transmission]]\njoints = [{first}, {second}]\nmatrix = {matrix}")
}

/// Ratios of up to this many teeth are tried for the arm file.
const MOST_TEETH: u32 = 12;
/// A ratio that is found this near to one of teeth is that one.
const SAME_RATIO: f64 = 0.04;

#[cfg(test)]
mod tests {
    use super::*;

    /// The arm file's reader takes the block, and its matrix is the motor's: θ = qᵢ + ρ·qₖ.
    #[test]
    fn the_block_is_what_an_arm_file_takes() {
        let joint =
            "[[joint]]\nkind = \"revolute\"\na = 0.3\nalpha = 0\nd = 0\ntheta = 0\nrotor_ratio = 100\n";
        let head = "name = \"x\"\nconvention = \"standard\"\ngravity = [0, -9.81, 0]\n";
        for (motor, with, found, ratio) in
            [(2, 1, 1.01, 1.0), (0, 2, -0.66, -2.0 / 3.0), (1, 0, 0.7073, 0.7073)]
        {
            let (near, exact) = of_teeth(found);
            approx::assert_relative_eq!(near, ratio, max_relative = 0.03);
            let block = block(JointNumber::from_index(motor), JointNumber::from_index(with), &exact);
            let text = format!("{head}{}{block}\n", joint.repeat(3));
            let arm = dyngen::Arm::parse(&text, "x.toml").unwrap();
            let matrix = arm.motor_velocity_matrix_f64();
            assert_eq!(matrix[motor][motor], 1.0);
            approx::assert_relative_eq!(matrix[motor][with], near, max_relative = 1e-4);
            assert_eq!(matrix[with][motor], 0.0);
        }
    }
}
