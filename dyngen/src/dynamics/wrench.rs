//! Forces and moments, or linear and angular momenta, carried inwards along the chain.

use super::body::{Vector, ZERO};
use super::stage::{SinCos, back_x, back_y, back_z, plus};
use crate::exact::algebra::Algebra;
use crate::graph::{Builder, Expr};

/// A force and a moment about the origin of a frame, in its axes.
#[derive(Clone, Copy, Debug)]
pub struct Wrench {
    /// Force.
    pub force: Vector,
    /// Moment about the origin.
    pub moment: Vector,
}

impl Wrench {
    /// No force, no moment.
    pub const NONE: Wrench = Wrench { force: ZERO, moment: ZERO };

    /// The sum of two wrenches about one origin.
    pub fn plus(&self, b: &Builder, other: &Wrench) -> Wrench {
        Wrench { force: plus(b, &self.force, &other.force), moment: plus(b, &self.moment, &other.moment) }
    }

    /// In the axes before a twist about x.
    pub fn turned_back_x(&self, b: &Builder, twist: SinCos) -> Wrench {
        Wrench { force: back_x(b, twist, &self.force), moment: back_x(b, twist, &self.moment) }
    }

    /// In the axes before a turn about y.
    pub fn turned_back_y(&self, b: &Builder, turn: SinCos) -> Wrench {
        Wrench { force: back_y(b, turn, &self.force), moment: back_y(b, turn, &self.moment) }
    }

    /// In the axes before a turn about z.
    pub fn turned_back_z(&self, b: &Builder, turn: SinCos) -> Wrench {
        Wrench { force: back_z(b, turn, &self.force), moment: back_z(b, turn, &self.moment) }
    }

    /// About the origin of a frame in which this one's lies at p.
    pub fn shifted(&self, b: &Builder, p: &Vector) -> Wrench {
        Wrench { force: self.force, moment: plus(b, &self.moment, &b.cross(p, &self.force)) }
    }
}

/// z·(p×f)
pub fn lever(b: &Builder, p: &Vector, force: &Vector) -> Expr {
    b.sub(&b.mul(&p[0], &force[1]), &b.mul(&p[1], &force[0]))
}
