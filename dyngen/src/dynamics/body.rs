//! The inertial parameters of links as expressions.

use crate::arm::{Arm, ParameterKind};
use crate::base::ParameterSet;
use crate::exact::algebra::Algebra;
use crate::exact::constant::{Constant, ConstantField, Factors};
use crate::graph::{Builder, Expr};

/// A vector's components.
pub type Vector = [Expr; 3];

/// The zero vector.
pub const ZERO: Vector = [Expr::ZERO; 3];

/// A rigid body by its ten inertial parameters about the origin of its frame.
#[derive(Clone, Copy, Debug)]
pub struct Body {
    /// Mass.
    pub mass: Expr,
    /// First moment.
    pub moment: Vector,
    /// Ixx, Iyy, Izz.
    pub inertia: Vector,
    /// Products of inertia Iyz, Ixz, Ixy (the tensor's off-diagonal elements are minus these).
    pub products: Vector,
}

impl Body {
    /// A body without mass.
    pub const NONE: Body = Body { mass: Expr::ZERO, moment: ZERO, inertia: ZERO, products: ZERO };

    /// I·v with the tensor of Eq. 8.
    pub fn inertia_times(&self, b: &Builder, v: &Vector) -> Vector {
        let [xx, yy, zz] = self.inertia;
        let [yz, xz, xy] = self.products;
        [b.dot(&[xx, -xy, -xz], v), b.dot(&[-xy, yy, -yz], v), b.dot(&[-xz, -yz, zz], v)]
    }

    /// The sum of two bodies in one frame.
    pub fn plus(&self, b: &Builder, other: &Body) -> Body {
        let sum = |u: &Vector, v: &Vector| std::array::from_fn(|i| b.add(&u[i], &v[i]));
        Body {
            mass: b.add(&self.mass, &other.mass),
            moment: sum(&self.moment, &other.moment),
            inertia: sum(&self.inertia, &other.inertia),
            products: sum(&self.products, &other.products),
        }
    }
}

/// What a link brings into the dynamics: its body, and the inertia of the rotor that drives its joint.
#[derive(Clone, Copy, Debug)]
pub struct Link {
    /// The link's body.
    pub body: Body,
    /// Rotor inertia Im.
    pub rotor: Expr,
}

/// The links of an arm with the values of a set's parameters; what carries none is zero.
pub fn links(
    b: &Builder,
    arm: &Arm,
    set: &ParameterSet,
    field: &ConstantField,
    value_of: impl Fn(usize) -> Expr,
) -> Vec<Link> {
    let mut values = vec![[Expr::ZERO; 11]; arm.dof()];
    for (index, parameter) in set.parameters.iter().enumerate() {
        let given = value_of(index);
        for (carrier, factor) in &parameter.carriers {
            let value = &mut values[carrier.link][carrier.kind as usize];
            *value = b.add(value, &b.mul(&constant(b, field, factor), &given));
        }
    }
    values.iter().map(link_of).collect()
}

fn link_of(values: &[Expr; 11]) -> Link {
    use ParameterKind::*;
    let of = |kind: ParameterKind| values[kind as usize];
    let body = Body {
        mass: of(M),
        moment: [of(Mx), of(My), of(Mz)],
        inertia: [of(Ixx), of(Iyy), of(Izz)],
        products: [of(Iyz), of(Ixz), of(Ixy)],
    };
    Link { body, rotor: of(Im) }
}

/// A constant of the arm as an expression.
pub fn constant(b: &Builder, field: &ConstantField, value: &Constant) -> Expr {
    let sum = |parts: Vec<Factors>| {
        parts.into_iter().fold(Expr::ZERO, |total, (coefficient, powers)| {
            let mut term = b.constant(&coefficient);
            for (index, sine, exponent) in powers {
                for _ in 0..exponent {
                    term = b.mul(&term, &b.symbol(index, sine));
                }
            }
            b.add(&total, &term)
        })
    };
    let (numerator, denominator) = field.factors(value);
    b.div(sum(numerator), sum(denominator))
}
