//! Signs: friction takes power, and energy of motion is positive.

use super::fit::{Judged, apart};
use super::physics::Energies;
use super::reading::Torques;
use super::rows::Rows;

/// Standard errors from zero at which a sign is sure.
const SURE: f64 = 5.0;
/// What speaks against it must be nearer to zero than this.
const AGAINST: f64 = 3.0;

/// The joints that friction drives where it brakes the others: their torque or their position has the other
/// sign. Each joint is asked by itself, with inertial parameters of its own, so that the others do not matter.
pub(super) fn driven_by_friction(rows: &Rows<'_>, read: &Torques, energies: &[Energies; 2]) -> Vec<usize> {
    let moving: Vec<usize> = (0..rows.dof()).filter(|j| rows.moves(*j)).collect();
    let sign_of = |joint: usize| {
        let clear =
            [0, 1].map(|part| energies[part].friction(&apart(rows, read, joint, part), joint).clear());
        match clear {
            [a, b] if a < -SURE && b < -SURE => -1,
            [a, b] if a > SURE && b > SURE => 1,
            _ => 0,
        }
    };
    let signs: Vec<(usize, i32)> = moving.into_iter().map(|j| (j, sign_of(j))).collect();
    let of = |sign: i32| signs.iter().filter(|(_, s)| *s == sign).map(|(j, _)| *j).collect::<Vec<usize>>();
    let (driven, braked) = (of(-1), of(1));
    // Where it drives most of them, all signs are reversed, and those of the others are not.
    if driven.len() > braked.len() { braked } else { driven }
}

/// What is known of the sign that all torques have in common.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Common {
    AsSaid,
    Reversed,
    NotTold,
}

/// The common sign of all torques: 1 or −1 where friction or the energy of motion tells it in both parts.
pub(super) fn common(judged: &Judged, energies: &[Energies; 2]) -> Common {
    let both = |of: &dyn Fn(usize) -> f64| [of(0), of(1)];
    let kinetic = both(&|part| energies[part].kinetic(&judged.fits[part]).clear());
    let friction = both(&|part| energies[part].all_friction(&judged.fits[part]).clear());
    let all = |x: [f64; 2], sign: f64, limit: f64| x.iter().all(|x| sign * x > limit);
    let says = |sign: f64| {
        (all(kinetic, sign, SURE) && all(friction, sign, -AGAINST))
            || (all(friction, sign, SURE) && all(kinetic, sign, -AGAINST))
    };
    match (says(1.0), says(-1.0)) {
        (true, false) => Common::AsSaid,
        (false, true) => Common::Reversed,
        _ => Common::NotTold,
    }
}
