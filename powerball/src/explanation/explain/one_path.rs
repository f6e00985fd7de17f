//! Whether the logs to judge on run the same path as the fitted ones: then terms of the position cannot be
//! judged.

use crate::explanation::effects::{Candidate, Class, Effect};
use crate::logs::regression::{Data, Recording};

/// Two recordings are one path where their positions over time correlate more than this: a path that drifts
/// with warmth keeps its shape, and two different paths hardly correlate.
const SAME: f64 = 0.9;
/// A ripple with fewer cycles along the path than this is as good as any other smooth function of the
/// position.
const FEW_CYCLES: f64 = 5.0;

/// Whether every recording of `other` repeats one of `data`.
#[must_use]
pub(super) fn repeats(data: &Data<'_>, other: &Data<'_>) -> bool {
    other.recordings.iter().all(|o| data.recordings.iter().any(|r| same_path(r, o)))
}

fn same_path(a: &Recording, b: &Recording) -> bool {
    let n = a.dof;
    let samples = a.len().min(b.len());
    // A short stretch that agrees is no path.
    if samples * 2 < a.len().max(b.len()) || (a.rate - b.rate).abs() > 0.05 * a.rate {
        return false;
    }
    let (mut common, mut own) = (0.0, [0.0; 2]);
    for j in 0..n {
        let mean = |r: &Recording| (0..samples).map(|k| r.q[k * n + j]).sum::<f64>() / samples.max(1) as f64;
        let (mean_a, mean_b) = (mean(a), mean(b));
        for k in 0..samples {
            let (x, y) = (a.q[k * n + j] - mean_a, b.q[k * n + j] - mean_b);
            common += x * y;
            own[0] += x * x;
            own[1] += y * y;
        }
    }
    common > SAME * (own[0] * own[1]).sqrt()
}

/// Why a candidate cannot be judged on a repeated path; `None` where it can: what warms, is late or rubs at
/// the joint's own speed is no function of the path alone, and a ripple of many cycles resembles nothing
/// else. Positions, the rigid body's torque and the motion of other joints are functions of the path like any
/// misfit.
#[must_use]
pub(super) fn cannot_be_judged(
    effect: &dyn Effect,
    candidate: &Candidate,
    data: &Data<'_>,
) -> Option<String> {
    let of_the_path = match effect.class() {
        Class::Position => true,
        Class::Dynamics => effect.name() != "time_delay",
        Class::Friction | Class::Event => false,
    };
    if !of_the_path {
        return None;
    }
    if effect.name() == "position_ripple"
        && let (Some(order), [joint]) = (candidate.values.first(), candidate.joints.as_slice())
    {
        let positions = || data.recordings.iter().flat_map(|r| r.position(*joint));
        let (low, high) =
            positions().fold((f64::MAX, f64::MIN), |(l, h): (f64, f64), q| (l.min(q), h.max(q)));
        if order * (high - low) / std::f64::consts::TAU >= FEW_CYCLES {
            return None;
        }
    }
    Some(
        "the logs to judge on run the same path: a function of the path cannot be told there from any other \
        misfit; record another path"
            .into(),
    )
}
