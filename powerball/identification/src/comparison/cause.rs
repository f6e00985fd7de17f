//! Causes that would explain the differences of two fits, and a sentence about them.

use super::differences::{Differences, Inertia};
use super::result::{Body, Cause};
use super::side::Side;
use crate::estimate::Solver;
use crate::estimate::distribution::f_tail;
use dyngen::arm::sum::parse_sum;
use dyngen::arm::{Parameter, ParameterKind};
use dyngen::exact::rational::to_f64;
use faer::Mat;

/// A payload is accepted if it leaves less than this share of the inertial difference unexplained, however
/// small the errors are.
const PAYLOAD_LEAVES: f64 = 0.05;

/// The causes of the differences, the inertial ones first; empty if there are none.
pub(super) fn causes(side: &Side, found: &Differences) -> Vec<Cause> {
    let mut causes = Vec::new();
    let inertial: Vec<String> =
        found.parameters.iter().filter(|p| p.differs).map(|p| p.name.clone()).collect();
    if !inertial.is_empty() {
        causes.push(payload(side, found).unwrap_or(Cause::Inertia { parameters: inertial.clone() }));
    }
    for f in found.friction.iter().filter(|f| f.differs) {
        causes.push(Cause::Friction { joint: f.joint, change: f.change });
    }
    for c in found.constants.iter().filter(|c| c.differs) {
        causes.push(Cause::SensorZero { joint: c.joint, change: c.interval });
    }
    let changed = found.friction.iter().filter(|f| f.differs).count();
    if inertial.is_empty() && changed >= 3 && 2 * changed > found.friction.len() {
        causes.push(Cause::AnotherUnit);
    }
    causes
}

/// The link of which ten inertial parameters explain all that differs, where there is one: the last where it
/// does so nearly as well as the best. A bar of a closed loop only where no link does.
fn payload(side: &Side, found: &Differences) -> Option<Cause> {
    // The minimal set, whose parameters say in their names what they are sums of.
    let sums: Vec<Vec<(Parameter, f64)>> = found
        .parameters
        .iter()
        .map(|p| Some(parse_sum(&p.name).ok()?.into_iter().map(|(p, c)| (p, to_f64(&c))).collect()))
        .collect::<Option<_>>()?;
    let links = side.friction.len();
    // Bodies behind the links are bars.
    let bodies = sums.iter().flatten().map(|(p, _)| p.link + 1).fold(links, usize::max);
    let loads: Vec<Load> =
        (0..links).rev().chain(links..bodies).filter_map(|body| Load::of(body, &sums, found)).collect();
    let least = loads.iter().map(|load| load.left).reduce(f64::min)?;
    let load = loads.iter().find(|load| load.left <= AS_WELL * least)?;
    load.is_enough(found).then(|| load.cause(side))
}

/// The part of the inertial difference that a body on a link or on a bar explains.
struct Load {
    /// The link, or the bar after them, from 0.
    link: usize,
    /// By parameter of a body: its value and its variance, if the logs determine it.
    values: Vec<Option<[f64; 2]>>,
    /// χ² of the difference, and what of it is left.
    all: f64,
    left: f64,
    /// Degrees of freedom of that.
    free: f64,
    /// Solver of the normal equations of the body's parameters.
    solver: Solver,
}

/// A link explains the difference as well as another one if its residual is at most this many times as large.
const AS_WELL: f64 = 1.1;
/// The parameters of a body: of a link but for its rotor.
fn of_a_body() -> impl Iterator<Item = ParameterKind> {
    ParameterKind::ALL.iter().copied().filter(|kind| *kind != ParameterKind::Im)
}

impl Load {
    /// By generalised least squares over the minimal set.
    fn of(link: usize, sums: &[Vec<(Parameter, f64)>], found: &Differences) -> Option<Load> {
        let column = |kind: ParameterKind| -> Vec<f64> {
            let own = |(p, factor): &(Parameter, f64)| {
                if p.link == link && p.kind == kind { *factor } else { 0.0 }
            };
            sums.iter().map(|sum| sum.iter().map(own).sum()).collect()
        };
        let columns: Vec<Vec<f64>> = of_a_body().map(column).collect();
        let inner = |x: &[f64], y: &[f64]| x.iter().zip(y).map(|(x, y)| x * y).sum::<f64>();
        let Inertia { difference, weights, .. } = &found.inertia;
        let weighted: Vec<Vec<f64>> = columns.iter().map(|column| weights.solve(column)).collect();
        let gram = Mat::from_fn(columns.len(), columns.len(), |i, k| inner(&columns[i], &weighted[k]));
        let right: Vec<f64> = weighted.iter().map(|column| inner(column, difference)).collect();
        let solver = Solver::new(&gram, |_| true);
        let load = solver.solve(&right);
        let all = inner(difference, &weights.solve(difference));
        let left = all - inner(&load, &right);
        let free = weights.kept().len().checked_sub(solver.kept().len()).filter(|free| *free > 0)? as f64;
        let variances = solver.inverse_diagonal();
        let value = |k: usize| solver.kept().contains(&k).then(|| [load[k], variances[k]]);
        let values = (0..columns.len()).map(value).collect();
        Some(Load { link, values, all, left, free, solver })
    }

    fn is_enough(&self, found: &Differences) -> bool {
        self.left <= PAYLOAD_LEAVES * self.all
            || f_tail(self.left / self.free, self.free, found.inertia.freedom) >= found.level
    }

    fn cause(&self, side: &Side) -> Cause {
        let value = |kind: ParameterKind| self.values[of_a_body().position(|k| k == kind)?];
        let mass = value(ParameterKind::M).map(|[mass, variance]| [mass, variance.sqrt()]);
        let moments = [ParameterKind::Mx, ParameterKind::My, ParameterKind::Mz];
        let square: f64 = moments.into_iter().filter_map(value).map(|[moment, _]| moment * moment).sum();
        let links = side.friction.len();
        let body = if self.link + 1 == links { self.body() } else { None };
        let number = || (self.link + 1).to_string();
        let bar = self.link.checked_sub(links).map(|bar| side.bars.get(bar).cloned().unwrap_or_else(number));
        Cause::Payload { link: self.link + 1, bar, mass, first_moment: square.sqrt(), body }
    }

    /// All of it, where mass and centre are determined.
    fn body(&self) -> Option<Body> {
        let place = |kind: ParameterKind| of_a_body().position(|k| k == kind);
        let value = |kind: ParameterKind| self.values[place(kind)?];
        let [mass, variance] = value(ParameterKind::M)?;
        let moments = [ParameterKind::Mx, ParameterKind::My, ParameterKind::Mz];
        let mut com = [0.0; 3];
        for (centre, kind) in com.iter_mut().zip(moments) {
            *centre = value(kind)?[0] / mass;
        }
        // Products of inertia are the negative of the tensor's elements. About the frame's origin there is
        // more than about the centre, by m·(|c|²·E − c·cᵀ) (Steiner).
        let tensor = [
            (ParameterKind::Ixx, 0, 0),
            (ParameterKind::Ixy, 0, 1),
            (ParameterKind::Ixz, 0, 2),
            (ParameterKind::Iyy, 1, 1),
            (ParameterKind::Iyz, 1, 2),
            (ParameterKind::Izz, 2, 2),
        ];
        let about_centre = tensor.map(|(kind, i, k)| {
            let (sign, square) = if i == k { (1.0, com.iter().map(|c| c * c).sum()) } else { (-1.0, 0.0) };
            let element = sign * value(kind)?[0] - mass * (square - com[i] * com[k]);
            // Along the parameters, with c = (mx, my, mz)/m.
            let mut slope = vec![0.0; self.values.len()];
            slope[place(kind)?] = sign;
            slope[place(ParameterKind::M)?] = square - com[i] * com[k];
            for (axis, kind) in moments.into_iter().enumerate() {
                let own = if i == k { 2.0 * com[axis] } else { 0.0 };
                let of = |a: usize, b: usize| if axis == a { com[b] } else { 0.0 };
                slope[place(kind)?] = of(i, k) + of(k, i) - own;
            }
            let variance: f64 = slope.iter().zip(self.solver.solve(&slope)).map(|(a, b)| a * b).sum();
            Some([element, variance.max(0.0).sqrt()])
        });
        let all: Option<Vec<[f64; 2]>> = about_centre.into_iter().collect();
        let part = |which: usize| {
            let entries = all.as_ref()?.iter().map(|both| both[which]).collect::<Vec<_>>();
            entries.try_into().ok()
        };
        Some(Body { mass, mass_std: variance.sqrt(), com, inertia: part(0), inertia_std: part(1) })
    }
}

/// A difference in words.
pub(super) fn sentence(found: &Differences, causes: &[Cause]) -> String {
    if causes.is_empty() {
        let widest = found.friction.iter().map(|f| f.change[0].abs().max(f.change[1].abs()));
        let widest = widest.filter(|w| w.is_finite()).fold(0.0, f64::max);
        return format!(
            "Same arm, as far as these fits can tell: none of {} numbers differs (level {} %); a change of \
                friction by \
                more than {:.1} % would have been seen on every joint.",
            found.comparisons,
            100.0 * found.level,
            100.0 * widest
        );
    }
    let words: Vec<String> = causes.iter().map(in_words).collect();
    let mut text = words.join("; ");
    if let Some(first) = text.get(..1).map(str::to_uppercase) {
        text.replace_range(..1, &first);
    }
    format!("{text}.")
}

fn in_words(cause: &Cause) -> String {
    match cause {
        Cause::Payload { link, bar, mass, first_moment, .. } => {
            let carrier = bar.as_ref().map_or_else(|| format!("link {link}"), |bar| format!("bar {bar}"));
            let moment = format!("first moments that the logs determine differ by {first_moment:.3} kg·m");
            match mass {
                Some([mass, std]) => {
                    let which = if *mass >= 0.0 { "heavier" } else { "lighter" };
                    let mass = mass.abs();
                    format!(
                        "another payload: {carrier} is {mass:.3} kg {which} (standard error {std:.3} kg); \
                            its {moment}"
                    )
                }
                None => {
                    format!("another payload: on {carrier} {moment}; these logs do not determine its mass")
                }
            }
        }
        Cause::Inertia { parameters } => format!(
            "the inertial parameters {} differ, but not as a body on one link would change them",
            parameters.join("; ")
        ),
        Cause::Friction { joint, change: [low, high] } => {
            let which = if low + high > 0.0 { "higher" } else { "lower" };
            // An interval that ends near zero is one of a change of either size, and of no sign.
            let ends = [low.abs().min(high.abs()), low.abs().max(high.abs())].map(|end| 100.0 * end);
            let least = if low * high > 0.0 { ends[0] } else { 0.0 };
            format!("friction of joint {joint} is {which} by {least:.0} to {:.0} %", ends[1])
        }
        Cause::SensorZero { joint, change: [low, high] } => {
            format!(
                "another sensor zero on joint {joint}: a constant torque of {low:.3} to {high:.3} N·m was \
                    added"
            )
        }
        Cause::AnotherUnit => {
            "friction differs on most joints and inertia on none: another unit of the same kind, or the same \
                one at another \
                temperature"
                .into()
        }
    }
}
