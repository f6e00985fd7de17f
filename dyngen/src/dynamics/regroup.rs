//! The inertial parameters in the form that is cheapest for the recursions.
//!
//! Torques depend on a parameter set only through as many sums as its rank. Which sums is free: each is
//! carried by one column of the dynamics, and the columns of second moments in the frames of the chain are
//! cheaper than those of the arm's file. The sums are linear in the set's parameters and depend on no state,
//! so they are prepared once.

use super::body::constant;
use super::chain::{self, LinkGeometry, Origins};
use super::moments::{ENTRIES, Moments};
use crate::arm::{Arm, JointKind, Linkage, Parameter, ParameterKind};
use crate::exact::algebra::Algebra;
use crate::exact::constant::{Constant, ConstantField};
use crate::exact::elimination::{self, Dependence};
use crate::exact::rational::{self, Rational};
use crate::exact::symbols::AngleSymbols;
use crate::graph::{Builder, Expr};
use crate::lagrangian::elements::{ArmElements, Source};
use crate::lagrangian::linkage::BarTurns;
use crate::parameters::{Combination, ParameterSet, minimal_coordinates};

/// The contribution of a link to the dynamics.
#[derive(Clone, Debug)]
pub struct LinkBody {
    /// Moments in the link's frame.
    pub moments: Moments<Expr>,
    /// A mass at the next link's origin.
    pub end_mass: Expr,
    /// Inertia of the rotor that drives the link's joint.
    pub rotor: Expr,
    /// A sphere with unit moment of inertia, less the same one in the link before the stage.
    pub flywheel: Expr,
}

impl LinkBody {
    /// Nothing.
    pub fn none(b: &Builder) -> Self {
        let none = Expr::ZERO;
        LinkBody { moments: Moments::none(b), end_mass: none, rotor: none, flywheel: none }
    }
}

/// A column of the dynamics that may carry a sum.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Column {
    Entry(usize, usize),
    EndMass(usize),
    Rotor(usize),
    Flywheel(usize),
    /// A parameter of the set, unchanged.
    Given(usize),
}

/// A rule for which columns carry the sums.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Order {
    /// The positions of the origins on their axes.
    pub origins: Origins,
    /// Masses at the ends of links, not first moments along the axes.
    pub masses: bool,
    /// Stages from the base whose links keep a flywheel, not one of the second moments across the axis.
    pub flywheels: usize,
}

impl Order {
    /// Rules for each place of the origins.
    pub const RULES: usize = 6;

    /// Every rule that is tried.
    pub fn all() -> impl Iterator<Item = Order> {
        [Origins::Inner, Origins::Outer].into_iter().flat_map(|origins| {
            let of = move |(flywheels, masses): (usize, bool)| Order { origins, masses, flywheels };
            [(2, true), (2, false), (1, true), (1, false), (0, true), (0, false)].into_iter().map(of)
        })
    }

    fn rank(self, arm: &Arm, stage_of: &[usize], column: Column) -> (usize, usize) {
        let revolute = |link: usize| arm.joints[link].kind == JointKind::Revolute;
        let wheels = |link: usize| revolute(link) && stage_of[link] < self.flywheels;
        let (rank, link) = match column {
            Column::Entry(link, entry) => {
                let rank = match entry {
                    0 => {
                        if revolute(link) {
                            6
                        } else {
                            2
                        }
                    }
                    3 if revolute(link) => {
                        if self.masses {
                            5
                        } else {
                            4
                        }
                    }
                    6 if revolute(link) => 7,
                    5 if wheels(link) => 3,
                    1..=3 => 0,
                    _ => {
                        if revolute(link) {
                            0
                        } else {
                            7
                        }
                    }
                };
                (rank, link)
            }
            Column::EndMass(link) => (if self.masses { 4 } else { 5 }, link),
            Column::Flywheel(link) => (if wheels(link) { 0 } else { 9 }, link),
            Column::Rotor(link) => (8, link),
            Column::Given(parameter) => return (10, parameter),
        };
        (rank, link)
    }
}

/// The sums and the columns that carry them.
#[derive(Clone, Debug)]
pub struct Regrouping {
    /// The rule.
    pub order: Order,
    columns: Vec<(Column, Vec<(usize, Constant)>)>,
}

/// Lengths and twists as constants; elements that depend on q are not requested.
struct Constants<'a> {
    field: &'a ConstantField,
    arm: &'a Arm,
}

impl Constants<'_> {
    fn number(&self, value: &Rational) -> Constant {
        self.field.rational(value.clone())
    }
}

impl Source<Constant> for Constants<'_> {
    fn joint_trig(&mut self, _: usize) -> (Constant, Constant) {
        (self.field.integer(0), self.field.integer(1))
    }
    fn position(&mut self, _: usize) -> Constant {
        self.field.integer(0)
    }
    fn velocity(&mut self, _: usize) -> Constant {
        self.field.integer(0)
    }
    fn a(&mut self, joint: usize) -> Constant {
        self.number(&self.arm.joints[joint].a)
    }
    fn b(&mut self, joint: usize) -> Constant {
        self.number(&self.arm.joints[joint].b)
    }
    fn d(&mut self, joint: usize) -> Constant {
        self.number(&self.arm.joints[joint].d)
    }
    fn ratio(&mut self, _: usize) -> Constant {
        self.field.integer(1)
    }
    fn exact(&mut self, value: &Rational) -> Constant {
        self.number(value)
    }
    fn linkage(&mut self, _: &Linkage) -> Option<BarTurns<Constant>> {
        None
    }
    fn gravity(&mut self, axis: usize) -> Constant {
        self.number(&self.arm.gravity[axis])
    }
    fn symbol(&mut self, index: usize, sine: bool) -> Constant {
        self.field.whole(self.field.symbol(index, sine).clone())
    }
}

/// Moments in the chain's frames against parameters of the file, over an arm's constants.
struct Map<'a> {
    field: &'a ConstantField,
    links: Vec<LinkGeometry<Constant>>,
}

impl<'a> Map<'a> {
    fn new(arm: &Arm, symbols: &AngleSymbols, field: &'a ConstantField, origins: Origins) -> Self {
        let elements = ArmElements::build(field, arm, symbols, &mut Constants { field, arm });
        Map { field, links: chain::geometry(field, arm, origins, &elements) }
    }

    /// The moments of a unit of a parameter of the file in the link's frame.
    fn of_parameter(&self, parameter: Parameter) -> Moments<Constant> {
        use ParameterKind::*;
        let f = self.field;
        let mut v: [Constant; ENTRIES] = std::array::from_fn(|_| f.integer(0));
        let half = |x: i64| f.rational(rational::ratio(x, 2));
        // J = ½ tr(I) − I
        let square = |axis: usize| [4, 5, 6].map(|e| (e, if e == 4 + axis { half(-1) } else { half(1) }));
        match parameter.kind {
            M | Mx | My | Mz => v[parameter.kind as usize] = f.integer(1),
            Ixx => square(0).into_iter().for_each(|(e, x)| v[e] = x),
            Iyy => square(1).into_iter().for_each(|(e, x)| v[e] = x),
            Izz => square(2).into_iter().for_each(|(e, x)| v[e] = x),
            Iyz => v[7] = f.integer(1),
            Ixz => v[8] = f.integer(1),
            Ixy => v[9] = f.integer(1),
            Im => {}
        }
        let link = &self.links[parameter.link];
        let (s, c) = &link.file_turn;
        Moments::from_entries(&v).turned_back_x(f, s, c).shifted(f, &link.file_origin)
    }

    /// Moments in a link's frame as a combination of parameters of the file.
    fn of_moments(&self, link: usize, moments: &Moments<Constant>) -> Combination {
        use ParameterKind::*;
        let f = self.field;
        let geometry = &self.links[link];
        let back = geometry.file_origin.each_ref().map(|x| Algebra::neg(f, x));
        let (s, c) = &geometry.file_turn;
        let body = moments.shifted(f, &back).turned_back_x(f, &Algebra::neg(f, s), c);
        let [xx, yy, zz] = &body.square;
        let [x, y, z] = body.first;
        let [yz, xz, xy] = body.mixed;
        let inertia = [(Ixx, f.add(yy, zz)), (Iyy, f.add(zz, xx)), (Izz, f.add(xx, yy))];
        [(M, body.mass), (Mx, x), (My, y), (Mz, z), (Iyz, yz), (Ixz, xz), (Ixy, xy)]
            .into_iter()
            .chain(inertia)
            .filter(|(_, value)| !value.is_zero())
            .map(|(kind, value)| (Parameter { link, kind }, value))
            .collect()
    }

    fn unit(&self, link: usize, entry: usize) -> Combination {
        let f = self.field;
        let v = std::array::from_fn(|e| f.integer(i64::from(e == entry)));
        self.of_moments(link, &Moments::from_entries(&v))
    }

    fn sphere(&self, link: usize, sign: i64) -> Combination {
        let f = self.field;
        let half = f.rational(rational::ratio(sign, 2));
        let v = std::array::from_fn(|e| if (4..7).contains(&e) { half.clone() } else { f.integer(0) });
        self.of_moments(link, &Moments::from_entries(&v))
    }

    /// The parameters of the file that a column represents.
    fn parameters(&self, column: Column, before_stage: &[Option<usize>], set: &ParameterSet) -> Combination {
        let f = self.field;
        match column {
            Column::Entry(link, entry) => self.unit(link, entry),
            Column::EndMass(link) => {
                let mass = std::array::from_fn(|e| f.integer(i64::from(e == 0)));
                let at_end = Moments::from_entries(&mass).shifted(f, &self.links[link].reach);
                self.of_moments(link, &at_end)
            }
            Column::Rotor(link) => vec![(Parameter { link, kind: ParameterKind::Im }, f.integer(1))],
            Column::Flywheel(link) => {
                let mut sum = self.sphere(link, 1);
                if let Some(before) = before_stage[link] {
                    sum.extend(self.sphere(before, -1));
                }
                sum
            }
            Column::Given(parameter) => set.parameters[parameter].carriers.clone(),
        }
    }
}

/// The columns that a link's body may have, for any set.
fn columns_of_link(link: usize) -> impl Iterator<Item = Column> {
    let entries = (0..ENTRIES).map(move |entry| Column::Entry(link, entry));
    entries.chain([Column::EndMass(link), Column::Rotor(link), Column::Flywheel(link)])
}

/// The stage of each link, and the link before that stage.
fn stages_of_links(arm: &Arm) -> (Vec<usize>, Vec<Option<usize>>) {
    let stages = chain::stages(arm).into_iter().enumerate();
    stages.flat_map(|(s, stage)| stage.clone().map(move |_| (s, stage.start.checked_sub(1)))).unzip()
}

/// The exact dependence of an arm's columns.
#[derive(Clone, Copy, Debug)]
pub struct Known<'a> {
    /// Dependences of the arm's own parameters.
    pub minimal: &'a Dependence,
    /// Dependences of the same chain with frames on its joints, where that needs fewer fractions.
    pub on_joints: Option<&'a (Arm, Dependence)>,
}

impl Regrouping {
    /// The sums of a set under a rule. Where the elimination is not certified, the set's parameters as they
    /// are.
    pub fn new(
        arm: &Arm,
        symbols: &AngleSymbols,
        field: &ConstantField,
        known: Known<'_>,
        set: &ParameterSet,
        order: Order,
    ) -> Regrouping {
        let map = Map::new(arm, symbols, field, order.origins);
        // The chain's frames are those of both tables: moments in them convert from one to the other.
        let on_joints = known.on_joints.map(|(chain, d)| (Map::new(chain, symbols, field, order.origins), d));
        let height = known.on_joints.map_or(known.minimal, |(_, d)| d).kept.len();
        let coordinates_of = |sum: &Combination| match &on_joints {
            None => minimal_coordinates(field, known.minimal, sum),
            Some((chain, dependence)) => {
                let on_chain = |(p, factor): &(Parameter, Constant)| -> Combination {
                    if p.kind == ParameterKind::Im {
                        return vec![(*p, factor.clone())];
                    }
                    let there = chain.of_moments(p.link, &map.of_parameter(*p));
                    there.into_iter().map(|(q, c)| (q, field.mul(&c, factor))).collect()
                };
                let sum: Combination = sum.iter().flat_map(on_chain).collect();
                minimal_coordinates(field, dependence, &sum)
            }
        };
        let (stage_of, before_stage) = stages_of_links(arm);
        let given = (0..set.parameters.len()).map(Column::Given);
        let mut columns: Vec<Column> =
            (0..arm.links()).flat_map(columns_of_link).chain(given.clone()).collect();
        columns.sort_by_key(|c| order.rank(arm, &stage_of, *c));
        let coordinates: Vec<Option<Vec<(usize, Constant)>>> = columns
            .iter()
            .map(|c| {
                let sum = map.parameters(*c, &before_stage, set);
                sum.iter().all(|(p, _)| arm.keeps(*p)).then(|| coordinates_of(&sum))
            })
            .collect();
        let (columns, coordinates): (Vec<Column>, Vec<_>) =
            columns.into_iter().zip(coordinates).filter_map(|(c, x)| Some((c, x?))).unzip();
        let dependence = elimination::dependence_of_columns(field, &coordinates, height);
        let Ok(dependence) = dependence else {
            let one = |p: usize| vec![(p, field.integer(1))];
            return Regrouping { order, columns: given.enumerate().map(|(p, c)| (c, one(p))).collect() };
        };
        let mut sums: Vec<(Column, Vec<(usize, Constant)>)> =
            dependence.kept.iter().map(|k| (columns[*k], Vec::new())).collect();
        for (column, coordinates) in columns.iter().zip(&dependence.coordinates) {
            if let Column::Given(parameter) = column {
                for (position, factor) in coordinates {
                    sums[*position].1.push((*parameter, factor.clone()));
                }
            }
        }
        Regrouping { order, columns: sums }
    }

    /// The links with the sums in place, for values of the set's parameters.
    pub fn bodies(
        &self,
        b: &Builder,
        arm: &Arm,
        symbols: &AngleSymbols,
        field: &ConstantField,
        set: &ParameterSet,
        value: impl Fn(usize) -> Expr,
    ) -> Vec<LinkBody> {
        let mut bodies = vec![LinkBody::none(b); arm.links()];
        let map = Map::new(arm, symbols, field, self.order.origins);
        let term = |factor: &Constant, x: Expr| b.mul(&constant(b, field, factor), &x);
        for (column, sum) in &self.columns {
            let sum =
                sum.iter().fold(Expr::ZERO, |total, (p, factor)| b.add(&total, &term(factor, value(*p))));
            let add = |to: &mut Expr, x: Expr| *to = b.add(to, &x);
            match *column {
                Column::Entry(link, entry) => {
                    let mut entries = bodies[link].moments.entries();
                    add(&mut entries[entry], sum);
                    bodies[link].moments = Moments::from_entries(&entries);
                }
                Column::EndMass(link) => add(&mut bodies[link].end_mass, sum),
                Column::Rotor(link) => add(&mut bodies[link].rotor, sum),
                Column::Flywheel(link) => add(&mut bodies[link].flywheel, sum),
                Column::Given(parameter) => {
                    let of_links = |(p, _): &&(Parameter, Constant)| p.link < arm.links();
                    for (carrier, factor) in set.parameters[parameter].carriers.iter().filter(of_links) {
                        let x = term(factor, sum);
                        let body = &mut bodies[carrier.link];
                        if carrier.kind == ParameterKind::Im {
                            add(&mut body.rotor, x);
                            continue;
                        }
                        let unit = map.of_parameter(*carrier).entries();
                        let entries = body.moments.entries();
                        body.moments = Moments::from_entries(&std::array::from_fn(|e| {
                            b.add(&entries[e], &term(&unit[e], x))
                        }));
                    }
                }
            }
        }
        bodies
    }

    /// The ten parameters of each bar with the sums in place.
    pub fn bars(
        &self,
        b: &Builder,
        arm: &Arm,
        field: &ConstantField,
        set: &ParameterSet,
        value: impl Fn(usize) -> Expr,
    ) -> Vec<[Expr; ENTRIES]> {
        let mut bars = vec![[Expr::ZERO; ENTRIES]; arm.bars.len()];
        let term = |factor: &Constant, x: Expr| b.mul(&constant(b, field, factor), &x);
        for (column, sum) in &self.columns {
            let Column::Given(parameter) = *column else { continue };
            for (carrier, factor) in &set.parameters[parameter].carriers {
                let Some(bar) = carrier.link.checked_sub(arm.links()) else { continue };
                let sum = sum.iter().fold(Expr::ZERO, |sum, (p, c)| b.add(&sum, &term(c, value(*p))));
                let to = &mut bars[bar][carrier.kind as usize];
                *to = b.add(to, &term(factor, sum));
            }
        }
        bars
    }
}
