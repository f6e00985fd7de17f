//! On which side of the gear the torques are, by the friction in them.

use super::fit::Judged;
use super::physics::Energies;
use super::reading::Torques;
use super::result::Side;
use super::rows::Rows;

/// Of the power that goes into the joint with the least friction, friction takes at most this share on the
/// link side. Sensors of a Kinova Gen3, a Panda and an xMate: 2 to 8 %.
const LINK: f64 = 0.12;
/// And at least this on the motor side: a UR10e 37 %, a pendulum with a gear ratio of 6 36 %.
const MOTOR: f64 = 0.25;

/// The least share of its power that friction takes of any joint, in both parts.
pub(super) fn least_share(
    rows: &Rows<'_>,
    read: &Torques,
    judged: &Judged,
    energies: &[Energies; 2],
) -> Option<f64> {
    let of = |joint: usize| {
        let shares = [0, 1].map(|part| {
            let torque = rows.torque(read, joint, part);
            let columns = &rows.joints[joint][part].columns;
            let velocity = &columns[columns.len() - 2];
            let power = torque.iter().zip(velocity).map(|(t, v)| (t * v).abs()).sum::<f64>();
            energies[part].friction(&judged.fits[part], joint).value.abs() * torque.len() as f64 / power
        });
        0.5 * (shares[0] + shares[1])
    };
    let shares = (0..rows.dof()).filter(|j| rows.moves(*j)).map(of).filter(|x| x.is_finite());
    shares.min_by(f64::total_cmp)
}

/// The side.
pub(super) fn side(share: f64) -> Option<Side> {
    if share < LINK { Some(Side::Link) } else { (share > MOTOR).then_some(Side::Motor) }
}
