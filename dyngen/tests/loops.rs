//! Closed loops: bars on the chain, against point masses on linkages whose loops are closed by intersecting
//! circles.
//!
//! The reference knows no frames of bars, no forces in pins and no parallels: a pin is where two bars of
//! given lengths meet, points move with the bars, and the torques are those of d'Alembert's principle, τᵢ = Σ
//! m ∂x/∂qᵢ·(ẍ − g), with exact derivatives along a path.

#![allow(clippy::unwrap_used, clippy::panic)]

use chacha20::ChaCha8Rng;
use dyngen::arm::{Convention, JointKind};
use dyngen::exact::rational::to_f64;
use dyngen::{Arm, Evaluator, Function, Model, SetKind};
use rand::{RngExt, SeedableRng};
use std::ops::{Add, Mul, Neg, Sub};
use support::{State, evaluate, model, proven, rank};

mod support;

const CRANK: &str = include_str!("loops/crank.toml");
const LEVEL: &str = include_str!("loops/level.toml");
const REMOTE: &str = include_str!("loops/remote.toml");
const ROCKER: &str = include_str!("loops/rocker.toml");
const DOUBLE: &str = include_str!("loops/double.toml");
const CROSSED: &str = include_str!("loops/crossed.toml");

const ARMS: [&str; 6] = [CRANK, LEVEL, REMOTE, ROCKER, DOUBLE, CROSSED];

/// A number along a path, to second order: value, rate, rate of the rate.
#[derive(Clone, Copy, Debug, Default)]
struct Along(f64, f64, f64);

impl Along {
    /// f(x), given f, f' and f'' at the value.
    fn map(self, [f, first, second]: [f64; 3]) -> Along {
        Along(f, first * self.1, second * self.1 * self.1 + first * self.2)
    }
    fn sin_cos(self) -> (Along, Along) {
        let (s, c) = self.0.sin_cos();
        (self.map([s, c, -s]), self.map([c, -s, -c]))
    }
    fn sqrt(self) -> Along {
        let root = self.0.sqrt();
        self.map([root, 0.5 / root, -0.25 / (root * self.0)])
    }
    fn inverse(self) -> Along {
        let x = 1.0 / self.0;
        self.map([x, -x * x, 2.0 * x * x * x])
    }
}

impl From<f64> for Along {
    fn from(x: f64) -> Along {
        Along(x, 0.0, 0.0)
    }
}

impl Add for Along {
    type Output = Along;
    fn add(self, o: Along) -> Along {
        Along(self.0 + o.0, self.1 + o.1, self.2 + o.2)
    }
}

impl Neg for Along {
    type Output = Along;
    fn neg(self) -> Along {
        Along(-self.0, -self.1, -self.2)
    }
}

impl Sub for Along {
    type Output = Along;
    fn sub(self, o: Along) -> Along {
        self + -o
    }
}

impl Mul for Along {
    type Output = Along;
    fn mul(self, o: Along) -> Along {
        Along(self.0 * o.0, self.1 * o.0 + self.0 * o.1, self.2 * o.0 + 2.0 * self.1 * o.1 + self.0 * o.2)
    }
}

type Vector = [Along; 3];

fn plus(u: Vector, v: Vector) -> Vector {
    std::array::from_fn(|i| u[i] + v[i])
}

fn minus(u: Vector, v: Vector) -> Vector {
    std::array::from_fn(|i| u[i] - v[i])
}

fn scaled(x: Along, v: Vector) -> Vector {
    v.map(|y| x * y)
}

fn dot(u: Vector, v: Vector) -> Along {
    u[0] * v[0] + u[1] * v[1] + u[2] * v[2]
}

/// A frame in the world: axes and origin.
#[derive(Clone, Copy)]
struct Frame {
    axes: [Vector; 3],
    origin: Vector,
}

impl Frame {
    fn world() -> Frame {
        let unit = |i: usize| std::array::from_fn(|j| Along::from(f64::from(u8::from(i == j))));
        Frame { axes: [unit(0), unit(1), unit(2)], origin: Default::default() }
    }
    fn point(&self, r: [Along; 3]) -> Vector {
        (0..3).fold(self.origin, |sum, i| plus(sum, scaled(r[i], self.axes[i])))
    }
    fn shifted(self, r: [Along; 3]) -> Frame {
        Frame { origin: self.point(r), ..self }
    }
    /// Turned about its own axis number `about`, by a sine and cosine.
    fn turned(self, about: usize, (s, c): (Along, Along)) -> Frame {
        let (i, j) = ((about + 1) % 3, (about + 2) % 3);
        let mut axes = self.axes;
        axes[i] = plus(scaled(c, self.axes[i]), scaled(s, self.axes[j]));
        axes[j] = minus(scaled(c, self.axes[j]), scaled(s, self.axes[i]));
        Frame { axes, ..self }
    }
    /// In its plane, at an angle from x.
    fn at(&self, length: f64, angle: f64) -> Vector {
        let (s, c) = angle.sin_cos();
        self.point([(length * c).into(), (length * s).into(), 0.0.into()])
    }
}

/// A loop as the tests' arm files say it: joints of the chain, lengths, inner and outer direction.
struct Linkage {
    first: usize,
    last: usize,
    lengths: [f64; 4],
    inner: f64,
    outer: f64,
    /// Of a loop that is no parallelogram, whether its middle pin is on the left.
    left: Option<bool>,
}

fn linkages(text: &str) -> Vec<Linkage> {
    let of = |first, last, lengths, inner, outer| Linkage { first, last, lengths, inner, outer, left: None };
    let on = |joint, lengths, inner, outer, left| Linkage {
        left: Some(left),
        ..of(joint, joint, lengths, inner, outer)
    };
    use std::f64::consts::{FRAC_PI_2, PI};
    match text {
        CRANK => vec![of(2, 2, [0.25, 1.1, 0.25, 1.1], PI, PI)],
        LEVEL => vec![of(1, 2, [1.1, 0.3, 1.1, 0.3], 0.0, 0.0), of(3, 4, [1.2, 0.25, 1.2, 0.25], 1.9, -0.4)],
        ROCKER => vec![on(1, [0.2, 0.9, 0.6, 0.8], 0.3, FRAC_PI_2, true)],
        DOUBLE => vec![
            on(0, [0.6, 0.5, 0.7, 0.7], 0.3, 0.1, false),
            on(2, [0.3, 0.25, 0.35, 0.35], -FRAC_PI_2, 1.4, true),
        ],
        CROSSED => vec![
            on(1, [0.3, 1.0, 0.35, 1.0], 0.0, FRAC_PI_2, false),
            on(2, [0.3, 1.0, 0.32, 1.01], 0.2, 0.5, true),
        ],
        _ => vec![
            of(1, 1, [0.15, 0.516, 0.15, 0.516], 0.2, FRAC_PI_2),
            of(0, 0, [0.2, 0.3, 0.2, 0.3], -FRAC_PI_2, 1.0),
        ],
    }
}

/// Where two circles of a plane meet: the point at distances `from_a` of a and `from_b` of b, on the left of
/// the way from a to b, about the plane's normal, or on its right.
fn meet(a: Vector, from_a: f64, b: Vector, from_b: f64, normal: Vector, left: bool) -> Vector {
    let way = minus(b, a);
    // Within the plane.
    let way = minus(way, scaled(dot(way, normal), normal));
    let square = dot(way, way);
    let inverse = square.inverse();
    let share = (square + (from_a * from_a - from_b * from_b).into()) * inverse * 0.5.into();
    let height = (Along::from(from_a * from_a) - share * share * square).sqrt() * square.sqrt().inverse();
    let aside: Vector = std::array::from_fn(|i| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        normal[j] * way[k] - normal[k] * way[j]
    });
    plus(a, plus(scaled(share, way), scaled(if left { height } else { -height }, aside)))
}

/// The frames of all bodies, links then bars, where the coordinates move along a path. Bars have x along the
/// bar.
fn frames(arm: &Arm, loops: &[Linkage], q: &[Along]) -> Vec<Frame> {
    let mut next = q.iter().copied();
    let mut frame = Frame::world();
    // Before and behind a joint's turn, in the plane of its frame.
    let (mut links, mut before, mut behind): (Vec<Frame>, Vec<Frame>, Vec<Frame>) = Default::default();
    for (i, joint) in arm.joints.iter().enumerate() {
        let [a, b, d] = [&joint.a, &joint.b, &joint.d].map(|x| Along::from(to_f64(x)));
        let alpha = Along::from(joint.alpha.radians()).sin_cos();
        let twist = |frame: Frame| frame.shifted([a, b, 0.0.into()]).turned(0, alpha);
        if arm.convention == Convention::Modified {
            frame = twist(frame);
        }
        before.push(frame.shifted([0.0.into(), 0.0.into(), d]));
        let theta = Along::from(joint.theta.radians());
        let closing = loops.iter().find(|l| l.last == i && l.first < i);
        let (turn, shift) = match (closing, joint.kind) {
            (Some(linkage), _) => (closed(linkage, &before, frame), 0.0.into()),
            (None, JointKind::Revolute) => ((next.next().unwrap() + theta).sin_cos(), 0.0.into()),
            (None, JointKind::Prismatic) => (theta.sin_cos(), next.next().unwrap()),
        };
        let turned = frame.turned(2, turn);
        behind.push(turned.shifted([0.0.into(), 0.0.into(), d]));
        frame = turned.shifted([0.0.into(), 0.0.into(), d + shift]);
        if arm.convention == Convention::Standard {
            frame = twist(frame);
        }
        links.push(frame);
    }
    links.extend(loops.iter().flat_map(|l| bars_of(l, before[l.first], behind[l.last])));
    links
}

/// Sine and cosine by which a joint turns that its loop holds: its pin is where the outer bar and the rod
/// meet.
fn closed(linkage: &Linkage, before: &[Frame], frame: Frame) -> (Along, Along) {
    let [_, outer, rod, inner] = linkage.lengths;
    let base = before[linkage.first];
    let foot = base.at(inner, linkage.inner);
    let normal = base.axes[2];
    // Opposite bars do not cross: from the last joint the pin is on the side on which the foot is from the
    // first.
    let link = minus(frame.origin, base.origin);
    let side = |v: Vector| {
        let (u, n) = (link.map(|x| x.0), normal.map(|x| x.0));
        let v = v.map(|x| x.0);
        (0..3)
            .map(|i| n[i] * (u[(i + 1) % 3] * v[(i + 2) % 3] - u[(i + 2) % 3] * v[(i + 1) % 3]))
            .sum::<f64>()
    };
    let of_foot = side(minus(foot, base.origin));
    let pins = [true, false].map(|left| meet(frame.origin, outer, foot, rod, normal, left));
    let pin = pins.into_iter().max_by(|a, b| {
        let along = |p: &Vector| side(minus(*p, frame.origin)) * of_foot;
        along(a).total_cmp(&along(b))
    });
    let way = minus(pin.unwrap(), frame.origin);
    let (x, y) = (dot(way, frame.axes[0]), dot(way, frame.axes[1]));
    let length = (x * x + y * y).sqrt().inverse();
    let (s, c) = linkage.outer.sin_cos();
    let (s, c): (Along, Along) = (s.into(), c.into());
    let (x, y) = (x * length, y * length);
    (y * c - x * s, x * c + y * s)
}

/// The frames of a loop's bars: origin at the pin, x along the bar, z along the joint's axis.
fn bars_of(linkage: &Linkage, inner: Frame, outer: Frame) -> Vec<Frame> {
    let [first, second, third, fourth] = linkage.lengths;
    let along = |from: Vector, to: Vector, length: f64, z: Vector| {
        let x = minus(to, from);
        // Pins may lie at other heights.
        let x = scaled((1.0 / length).into(), minus(x, scaled(dot(x, z), z)));
        let y = std::array::from_fn(|i| {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            z[j] * x[k] - z[k] * x[j]
        });
        Frame { axes: [x, y, z], origin: from }
    };
    let foot = inner.at(fourth, linkage.inner);
    if linkage.first < linkage.last {
        let pin = outer.at(second, linkage.outer);
        return vec![along(pin, foot, third, inner.axes[2])];
    }
    let pin = outer.at(first, linkage.outer);
    // The other pin is opposite to the joint: away from it across the way between the two pins.
    let normal = inner.axes[2];
    let pins = [true, false].map(|left| meet(pin, second, foot, third, normal, left));
    let apart = |p: &Vector| {
        let v = minus(*p, outer.origin);
        dot(v, v).0
    };
    let far = match linkage.left {
        Some(left) => pins[usize::from(!left)],
        None => pins.into_iter().max_by(|a, b| apart(a).total_cmp(&apart(b))).unwrap(),
    };
    vec![along(pin, far, second, normal), along(foot, far, third, normal)]
}

/// A mass at a point of a body, in that body's frame of the reference.
struct Particle {
    body: usize,
    mass: f64,
    at: [f64; 3],
}

/// The reference: an arm as particles.
struct Particles<'a> {
    arm: &'a Arm,
    loops: Vec<Linkage>,
    all: Vec<Particle>,
}

impl Particles<'_> {
    fn positions(&self, q: &[Along]) -> Vec<Vector> {
        let frames = frames(self.arm, &self.loops, q);
        self.all.iter().map(|p| frames[p.body].point(p.at.map(Along::from))).collect()
    }

    /// ∂x/∂qᵢ of each particle.
    fn partial(&self, q: &[f64], i: usize) -> Vec<[f64; 3]> {
        let along = |(j, q): (usize, &f64)| Along(*q, f64::from(u8::from(i == j)), 0.0);
        let path: Vec<Along> = q.iter().enumerate().map(along).collect();
        self.positions(&path).iter().map(|x| x.map(|x| x.1)).collect()
    }

    /// For each coordinate and each particle, its share of the torque of a motion.
    fn shares(&self, q: &[f64], dq: &[f64], ddq: &[f64]) -> Vec<Vec<f64>> {
        let path: Vec<Along> = (0..q.len()).map(|i| Along(q[i], dq[i], ddq[i])).collect();
        let moving = self.positions(&path);
        let gravity = self.arm.gravity.each_ref().map(to_f64);
        let share = |(k, partial): (usize, &[f64; 3])| {
            let power: f64 = (0..3).map(|i| partial[i] * (moving[k][i].2 - gravity[i])).sum();
            self.all[k].mass * power
        };
        (0..q.len()).map(|i| self.partial(q, i).iter().enumerate().map(share).collect()).collect()
    }
}

/// The frames that dyngen says its bars have, as turns of the reference's about z, found at one pose.
fn turns(arm: &Arm, loops: &[Linkage], q: &[f64]) -> Vec<[[f64; 3]; 3]> {
    let path: Vec<Along> = q.iter().map(|q| (*q).into()).collect();
    let frames = frames(arm, loops, &path);
    let world = Frame::world();
    let of = |(k, bar): (usize, &dyngen::arm::Bar)| {
        let own = &frames[arm.links() + k];
        let link = bar.parallel.map_or(&world, |link| &frames[link]);
        // The frame of a bar that turns on its own is that of the reference.
        let parallel = if bar.hinge.is_some() { own } else { link };
        std::array::from_fn(|i| std::array::from_fn(|j| dot(own.axes[i], parallel.axes[j]).0))
    };
    arm.bars.iter().enumerate().map(of).collect()
}

/// Particles on every body, and the parameters of an arm that has them.
fn particles<'a>(
    arm: &'a Arm,
    text: &str,
    each: usize,
    random: &mut ChaCha8Rng,
) -> (Particles<'a>, Vec<f64>) {
    let loops = linkages(text);
    let pose: Vec<f64> = (0..arm.dof()).map(|_| random.random_range(-0.5..0.5)).collect();
    let turns = turns(arm, &loops, &pose);
    let mut all = Vec::new();
    let mut values = vec![0.0; arm.all_parameters().len()];
    for body in 0..arm.bodies() {
        for _ in 0..each {
            let mass = random.random_range(0.3..2.0);
            let at = [0; 3].map(|_| random.random_range(-0.3..0.3));
            // In the frame in which dyngen has the body.
            let r: [f64; 3] = match body.checked_sub(arm.links()) {
                None => at,
                Some(bar) => std::array::from_fn(|j| (0..3).map(|i| at[i] * turns[bar][i][j]).sum()),
            };
            let [x, y, z] = r;
            let own = [1.0, x, y, z, y * y + z * z, x * y, x * z, z * z + x * x, y * z, x * x + y * y];
            (0..10).for_each(|k| values[11 * body + k] += mass * own[k]);
            all.push(Particle { body, mass, at });
        }
    }
    (Particles { arm, loops, all }, values)
}

/// Poses at which the loops are not stretched.
fn state(random: &mut ChaCha8Rng, dof: usize) -> State {
    let mut state = State::draw(random, dof, 1.0);
    state.q = state.q.iter().map(|q| 0.7 * q).collect();
    state
}

fn close(found: &[f64], expected: &[f64], what: &str) {
    assert_eq!(found.len(), expected.len(), "{what}");
    let scale = expected.iter().fold(1e-3f64, |m, x| m.max(x.abs()));
    let error = found.iter().zip(expected).fold(0.0f64, |m, (a, b)| m.max((a - b).abs()));
    assert!(error < 1e-9 * scale, "{what}: {error:e} of {scale:e}\n{found:?}\n{expected:?}");
}

#[test]
fn torques_are_those_of_linkages_of_particles() {
    let mut random = ChaCha8Rng::seed_from_u64(55);
    for text in ARMS {
        let model = model(text);
        let arm = model.arm();
        let n = arm.dof();
        let (reference, all) = particles(arm, text, 4, &mut random);
        for kind in [SetKind::Full, SetKind::Minimal] {
            let parameters = model.set_values(model.set(kind).unwrap(), &all);
            let evaluators = proven(&model, kind);
            let at = |s: &State, f: Function| evaluate(&evaluators[f as usize], &s.samples(&parameters));
            for _ in 0..6 {
                let s = state(&mut random, n);
                let torques = |dq: &[f64], ddq: &[f64]| -> Vec<f64> {
                    reference.shares(&s.q, dq, ddq).iter().map(|shares| shares.iter().sum()).collect()
                };
                let what = format!("{}, {kind}", arm.name);
                close(&at(&s, Function::InverseDynamics), &torques(&s.dq, &s.ddq), &what);
                let rest = vec![0.0; n];
                let weight = torques(&rest, &rest);
                close(&at(&s, Function::Gravity), &weight, &format!("{what}: gravity"));
                let unit = |j: usize| (0..n).map(|i| f64::from(u8::from(i == j))).collect::<Vec<f64>>();
                let columns: Vec<Vec<f64>> = (0..n).map(|j| torques(&rest, &unit(j))).collect();
                let mass: Vec<f64> = (0..n * n).map(|k| columns[k % n][k / n] - weight[k / n]).collect();
                close(&at(&s, Function::MassMatrix), &mass, &format!("{what}: mass matrix"));
                let velocity: Vec<f64> =
                    torques(&s.dq, &rest).iter().zip(&weight).map(|(a, b)| a - b).collect();
                let matrix = at(&s, Function::CoriolisMatrix);
                let product: Vec<f64> =
                    matrix.chunks(n).map(|row| row.iter().zip(&s.dq).map(|(c, v)| c * v).sum()).collect();
                close(&product, &velocity, &format!("{what}: Coriolis matrix"));
            }
        }
    }
}

#[test]
fn the_whole_arm_is_that_of_its_particles() {
    let mut random = ChaCha8Rng::seed_from_u64(56);
    for text in ARMS {
        let model = model(text);
        let (arm, n) = (model.arm(), model.arm().dof());
        let (reference, all) = particles(arm, text, 3, &mut random);
        let parameters = model.set_values(model.set(SetKind::Full).unwrap(), &all);
        let result = |f, s: &State| {
            evaluate(&Evaluator::new(&model, f, SetKind::Full).unwrap(), &s.samples(&parameters))
        };
        let s = state(&mut random, n);
        let path: Vec<Along> = s.q.iter().zip(&s.dq).map(|(q, v)| Along(*q, *v, 0.0)).collect();
        let moving = reference.positions(&path);
        let sum = |of: &dyn Fn(&Vector) -> [f64; 3]| -> [f64; 3] {
            let each = reference.all.iter().zip(&moving).map(|(p, x)| of(x).map(|y| p.mass * y));
            each.fold([0.0; 3], |sum, x| std::array::from_fn(|i| sum[i] + x[i]))
        };
        let mass: f64 = reference.all.iter().map(|p| p.mass).sum();
        let centre = sum(&|x| x.map(|x| x.0 / mass));
        close(&result(Function::CentreOfMass, &s), &centre, &arm.name);
        let linear = sum(&|x| x.map(|x| x.1));
        let angular = sum(&|x| {
            std::array::from_fn(|i| {
                let (j, k) = ((i + 1) % 3, (i + 2) % 3);
                x[j].0 * x[k].1 - x[k].0 * x[j].1
            })
        });
        close(&result(Function::TotalMomentum, &s), &[linear, angular].concat(), &arm.name);
        let energy: f64 = reference
            .all
            .iter()
            .zip(&moving)
            .map(|(p, x)| 0.5 * p.mass * x.iter().map(|x| x.1 * x.1).sum::<f64>())
            .sum();
        close(&result(Function::KineticEnergy, &s), &[energy], &arm.name);
    }
}

#[test]
fn the_rank_is_that_of_linkages_of_particles() {
    let mut random = ChaCha8Rng::seed_from_u64(57);
    for text in ARMS {
        let without_rotors = text.replace(", rotor_ratio = 100", "").replace(", rotor_ratio = 80", "");
        let model = model(&without_rotors);
        let (arm, n) = (model.arm(), model.arm().dof());
        // Ten particles have any ten moments.
        let (mut reference, _) = particles(arm, text, 10, &mut random);
        reference.all.iter_mut().for_each(|p| p.mass = 1.0);
        let mut columns = vec![Vec::new(); reference.all.len()];
        for _ in 0..columns.len() {
            let s = state(&mut random, n);
            for shares in reference.shares(&s.q, &s.dq, &s.ddq) {
                columns.iter_mut().zip(shares).for_each(|(column, x)| column.push(x));
            }
        }
        assert_eq!(model.set(SetKind::Minimal).unwrap().parameters.len(), rank(columns), "{}", arm.name);
    }
}

#[test]
fn every_function_is_proven_for_every_size() {
    for text in ARMS {
        let model = model(text);
        let functions = model.functions(SetKind::Symbolic).count();
        assert_eq!(proven(&model, SetKind::Symbolic).len(), functions);
    }
}

/// Bars count: without them the torques are others.
#[test]
fn a_bar_has_columns_of_its_own() {
    let with: Model = model(CRANK);
    let without = model(&CRANK[..CRANK.find("[[loop]]").unwrap()]);
    let count = |model: &Model| model.set(SetKind::Minimal).unwrap().parameters.len();
    assert_eq!(count(&with), count(&without) + 3);
    let names: Vec<String> = with.set(SetKind::Symbolic).unwrap().names();
    assert!(["mx5", "my5", "mx6", "my6"].iter().all(|name| names.iter().any(|n| n == name)), "{names:?}");
}
