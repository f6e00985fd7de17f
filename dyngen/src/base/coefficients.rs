//! The Lagrangian's exact coefficients without the expanded Lagrangian: rows that span the row space of the
//! matrix with one row for each function of the motion and one column for each parameter.
//!
//! A linear functional on functions of all joints' motions is a sum of products of functionals, one for each
//! joint. The values of the columns of link i under the functionals of the joints up to i are determined by
//! the values of 32 monomials of the link's motion (velocities, their products, gravity, height). Their
//! values span a space that a step from link to link maps on, whatever number of joints follows. Take for
//! each joint one functional that keeps constants, the mean over its turn at rest, and otherwise such as
//! vanish on constants. Then the last joint whose functional vanishes on constants sorts the rows into
//! blocks: its own link's columns span at most eleven dimensions (and five for each motor that turns with
//! several joints), and the links behind it contribute their means. So the rank is a sum over the joints, and
//! the work grows with the number of joints, not with the number of terms. The rows are certified in
//! `certificate.rs`.

use super::preference::Preference;
pub use super::steps::Sizes;
use super::steps::{LINK, Step, Steps, Values};
use super::tied;
use crate::arm::Arm;
use crate::exact::constant::{Constant, ConstantField};
use crate::exact::elimination::{self, SparseRow, Unproven};
use crate::exact::rational;
use crate::exact::symbols::AngleSymbols;
use std::collections::BTreeMap;

/// The rows for the parameters that the arm keeps: those of [`all_rows`] without the other columns.
pub fn kept(arm: &Arm, rows: &[SparseRow]) -> Vec<SparseRow> {
    let all = arm.all_parameters();
    let of = |row: &SparseRow| -> SparseRow {
        row.iter().filter(|(column, _)| arm.keeps(all[*column])).cloned().collect()
    };
    rows.iter().map(of).filter(|row: &SparseRow| !row.is_empty()).collect()
}

/// Rows that span the row space of all the arm's parameters, whether declared zero or not.
///
/// # Errors
/// [`Unproven`] where a number of the arm is a multiple of the proof's prime.
pub fn all_rows(
    arm: &Arm,
    symbols: &AngleSymbols,
    field: &ConstantField,
    sizes: Sizes,
) -> Result<Vec<SparseRow>, Unproven> {
    if arm.has_mimics() || !arm.bars.is_empty() {
        return tied::all_rows(arm, symbols, field, sizes);
    }
    let chain = Steps::new(arm, symbols, field, sizes);
    let mut constant = vec![chain.at_rest(arm)];
    let mut moving: Vec<Values> = Vec::new();
    let mut links = Vec::with_capacity(arm.dof());
    for joint in 0..arm.dof() {
        let step = chain.step(joint);
        let mut next = (Vec::new(), Vec::new());
        let mut own: Vec<Values> = Vec::new();
        for (values, moves) in constant.iter().map(|v| (v, false)).chain(moving.iter().map(|v| (v, true))) {
            for (functional, (image, rotor)) in step.images(values) {
                let new_motion = functional.moves || moves;
                if new_motion && !(functional.is_mean()) {
                    own.push(chain.columns(joint, &image, &rotor));
                }
                if new_motion { next.1.push(image) } else { next.0.push(image) }
            }
        }
        constant = chain.basis(next.0, chain.motion_order())?;
        moving = chain.basis(next.1, chain.motion_order())?;
        let mut order = Preference::ALL[0].within_link(arm, joint);
        order.extend(LINK..chain.width());
        links.push(Link { pivots: chain.basis(own, order)?, step });
    }
    chain.rows(&links)
}

/// The contribution of a link's own joint to the rows.
struct Link<'a, 'f> {
    /// A basis of the values that its columns take under functionals that vanish on constants, in reduced
    /// form.
    pivots: Vec<Values>,
    step: Step<'a, 'f>,
}

impl<'f> Steps<'f> {
    /// A basis in reduced form of the space that some values span, in the order of preference.
    ///
    /// Where the space holds a unit vector, which a reduction modulo the prime shows, it is taken unchanged,
    /// so that it gets no fractions.
    fn basis(&self, values: Vec<Values>, order: Vec<usize>) -> Result<Vec<Values>, Unproven> {
        let rows: Vec<SparseRow> = values
            .iter()
            .filter(|v| !v.is_empty())
            .map(|v| self.field.clear_denominators(&v.iter().map(|(k, c)| (*k, c)).collect::<Vec<_>>()))
            .collect();
        let width = order.iter().max().map_or(0, |m| m + 1);
        let units = elimination::unit_vectors(self.field, &rows, width, &order)?;
        let rest: Vec<SparseRow> = rows
            .into_iter()
            .map(|row| row.into_iter().filter(|(k, _)| !units.contains(k)).collect::<SparseRow>())
            .filter(|row| !row.is_empty())
            .collect();
        let one = self.field.rational(rational::integer(1));
        let mut basis: Vec<Values> = units.iter().map(|k| vec![(*k, one.clone())]).collect();
        let order: Vec<usize> = order.into_iter().filter(|k| !units.contains(k)).collect();
        if !rest.is_empty() {
            let found = elimination::dependence(self.field, &rest, width, &order)?;
            basis.extend(found.kept.iter().enumerate().map(|(position, kept)| {
                let mut row: Values = vec![(*kept, one.clone())];
                for (column, coordinates) in found.coordinates.iter().enumerate().filter(|(c, _)| c != kept) {
                    row.extend(
                        coordinates.iter().filter(|(p, _)| *p == position).map(|(_, c)| (column, c.clone())),
                    );
                }
                row
            }));
        }
        Ok(basis)
    }

    /// The rows: for each joint its link's basis, and what the means of the joints behind make of it.
    fn rows(&self, links: &[Link<'_, 'f>]) -> Result<Vec<SparseRow>, Unproven> {
        let n = links.len();
        // For each column of a link, what stands in the links behind it, without what those links' own rows
        // remove.
        let mut behind: Vec<Values> = vec![Vec::new(); self.width()];
        let mut rows: Vec<SparseRow> = Vec::new();
        for joint in (0..n).rev() {
            let link = &links[joint];
            for pivot in &link.pivots {
                let row = self.continued(pivot, &behind, joint);
                let row: Vec<(usize, &Constant)> = row.iter().map(|(k, c)| (*k, c)).collect();
                if !row.is_empty() {
                    rows.push(self.field.clear_denominators(&row));
                }
            }
            if joint == 0 {
                break;
            }
            let lifted = self.lifted(joint - 1);
            behind = (lifted.iter())
                .map(|lifted| {
                    let images = link.step.images(lifted);
                    let mean = images.into_iter().find(|(functional, _)| functional.is_mean());
                    let values = mean.map(|(_, (image, rotor))| self.columns(joint, &image, &rotor));
                    let reduced = self.without_pivots(values.unwrap_or_default(), &link.pivots);
                    self.continued(&reduced, &behind, joint)
                })
                .collect();
        }
        rows.reverse();
        Ok(rows)
    }

    /// Values of a link's columns less multiples of its basis, so that the leading columns of those are zero.
    fn without_pivots(&self, values: Values, pivots: &[Values]) -> Values {
        let field = self.field;
        let mut rest: BTreeMap<usize, Constant> = values.into_iter().collect();
        for pivot in pivots {
            let Some(factor) = rest.get(&pivot[0].0).cloned() else { continue };
            for (column, value) in pivot {
                add_to(field, &mut rest, *column, &field.neg(&field.mul(&factor, value)));
            }
        }
        rest.into_iter().collect()
    }

    /// A link's values with what they are in the links behind, by the arm's columns.
    fn continued(&self, values: &Values, behind: &[Values], joint: usize) -> Values {
        let mut row: BTreeMap<usize, Constant> = BTreeMap::new();
        for (column, value) in values {
            if let Some(own) = self.arm_column(joint, *column) {
                add_to(self.field, &mut row, own, value);
            }
            for (further, factor) in &behind[*column] {
                add_to(self.field, &mut row, *further, &self.field.mul(value, factor));
            }
        }
        row.into_iter().collect()
    }
}

fn add_to(field: &ConstantField, sums: &mut BTreeMap<usize, Constant>, place: usize, term: &Constant) {
    let sum = match sums.get(&place) {
        Some(old) => field.add(old, term),
        None => term.clone(),
    };
    if sum.is_zero() {
        sums.remove(&place);
    } else {
        sums.insert(place, sum);
    }
}
