//! Which columns of a matrix of constants depend on which: exact, with a proof of both halves.
//!
//! Independence of the kept columns is certified by a minor that is not zero modulo the prime; dependence of
//! the others by relations in the constants themselves, checked on every row. No tolerance appears.

use super::algebra::Algebra;
use super::constant::{Constant, ConstantField};
use super::polynomial::Numerator;
use super::prime::Fp;
use std::collections::BTreeMap;
use std::fmt;

/// A row's entries other than zero, by column.
pub type SparseRow = Vec<(usize, Numerator)>;

/// The dependence of columns: `kept` are independent, every other column is a combination of them.
#[derive(Clone, Debug)]
pub struct Dependence {
    /// The independent columns, in the order of preference.
    pub kept: Vec<usize>,
    /// For each column, its coordinates in `kept` (position, coefficient), zeros left out.
    pub coordinates: Vec<Vec<(usize, Constant)>>,
}

/// An elimination that did not prove its answer: the prime divided a number of the arm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Unproven;

impl fmt::Display for Unproven {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "the exact elimination could not be certified: a number of the arm is a multiple of the prime {}",
            super::prime::P
        )
    }
}

impl std::error::Error for Unproven {}

/// Finds the dependence of the columns of a matrix.
///
/// `preference` lists all columns that take part, those to be kept first: a column is kept exactly when it
/// does not depend on those before it. Columns that are not listed must not occur in `rows`.
///
/// # Errors
/// [`Unproven`] where the prime divides a denominator of the matrix.
pub fn dependence(
    field: &ConstantField,
    rows: &[SparseRow],
    columns: usize,
    preference: &[usize],
) -> Result<Dependence, Unproven> {
    let dependence = unchecked(field, rows, columns, preference)?;
    let relations = relations(field, &dependence);
    if rows.iter().all(|row| holds(field, row, &relations)) { Ok(dependence) } else { Err(Unproven) }
}

/// Like [`dependence`], but the caller proves that the relations hold on every row: if coefficients are
/// fractions of many symbols, their common denominator is long.
///
/// # Errors
/// [`Unproven`] where the prime divides a denominator of the matrix.
pub fn unchecked(
    field: &ConstantField,
    rows: &[SparseRow],
    columns: usize,
    preference: &[usize],
) -> Result<Dependence, Unproven> {
    let mut place = vec![usize::MAX; columns];
    for (i, column) in preference.iter().enumerate() {
        place[*column] = i;
    }
    let chosen = independent_rows(field, rows, &place, preference.len())?;
    let reduced = reduce(field, chosen.iter().map(|r| &rows[*r]), &place).ok_or(Unproven)?;
    if reduced.len() != chosen.len() {
        return Err(Unproven);
    }
    let kept: Vec<usize> = reduced.keys().map(|p| preference[*p]).collect();
    let mut coordinates = vec![Vec::new(); columns];
    for (position, row) in reduced.values().enumerate() {
        for (p, coefficient) in row {
            coordinates[preference[*p]].push((position, coefficient.clone()));
        }
    }
    Ok(Dependence { kept, coordinates })
}

/// The dependence of columns that are given as sparse columns of constants, in their own order of preference.
///
/// # Errors
/// [`Unproven`] where the prime divides a denominator.
pub fn dependence_of_columns(
    field: &ConstantField,
    columns: &[Vec<(usize, Constant)>],
    height: usize,
) -> Result<Dependence, Unproven> {
    // A row may be scaled freely, so each is cleared of its denominators.
    let mut rows: Vec<Vec<(usize, &Constant)>> = vec![Vec::new(); height];
    for (c, column) in columns.iter().enumerate() {
        for (r, value) in column {
            rows[*r].push((c, value));
        }
    }
    let rows: Vec<SparseRow> = rows.iter().map(|row| field.clear_denominators(row)).collect();
    let preference: Vec<usize> = (0..columns.len()).collect();
    dependence(field, &rows, columns.len(), &preference)
}

/// Indices of rows that are independent modulo the prime and span all rows, simple rows first.
fn independent_rows(
    field: &ConstantField,
    rows: &[SparseRow],
    place: &[usize],
    width: usize,
) -> Result<Vec<usize>, Unproven> {
    let mut order: Vec<usize> = (0..rows.len()).collect();
    let effort = |r: &SparseRow| (r.len(), r.iter().map(|(_, c)| c.terms().len()).sum::<usize>());
    order.sort_by_key(|r| effort(&rows[*r]));
    let mut echelon: BTreeMap<usize, Vec<Fp>> = BTreeMap::new();
    let mut chosen = Vec::new();
    for r in order {
        let mut dense = vec![Fp::ZERO; width];
        for (column, entry) in &rows[r] {
            dense[place[*column]] = field.modular_whole(entry).ok_or(Unproven)?;
        }
        if let Some(lead) = reduce_modular(&mut dense, &echelon) {
            let scale = dense[lead].inverse().ok_or(Unproven)?;
            dense.iter_mut().for_each(|x| *x = *x * scale);
            echelon.insert(lead, dense);
            chosen.push(r);
        }
    }
    Ok(chosen)
}

/// The columns whose unit vector lies in the space that the rows span, modulo the prime; the space has one
/// for every vector of its reduced form that has a single entry.
///
/// # Errors [`Unproven`] where the prime divides a denominator.
pub fn unit_vectors(
    field: &ConstantField,
    rows: &[SparseRow],
    columns: usize,
    preference: &[usize],
) -> Result<Vec<usize>, Unproven> {
    let mut place = vec![usize::MAX; columns];
    for (i, column) in preference.iter().enumerate() {
        place[*column] = i;
    }
    let mut echelon: BTreeMap<usize, Vec<Fp>> = BTreeMap::new();
    for row in rows {
        let mut dense = vec![Fp::ZERO; preference.len()];
        for (column, entry) in row {
            dense[place[*column]] = field.modular_whole(entry).ok_or(Unproven)?;
        }
        if let Some(lead) = reduce_modular(&mut dense, &echelon) {
            let scale = dense[lead].inverse().ok_or(Unproven)?;
            dense.iter_mut().for_each(|x| *x = *x * scale);
            echelon.insert(lead, dense);
        }
    }
    // From the last row upwards each is freed of the leads below it.
    let leads: Vec<usize> = echelon.keys().copied().collect();
    for lead in leads.iter().rev() {
        let Some(mut row) = echelon.remove(lead) else { continue };
        for (other, pivot) in echelon.range(lead + 1..) {
            let factor = row[*other];
            row.iter_mut().zip(pivot).for_each(|(x, y)| *x = *x - factor * *y);
        }
        echelon.insert(*lead, row);
    }
    let single = |row: &[Fp]| row.iter().filter(|x| **x != Fp::ZERO).count() == 1;
    Ok(echelon.iter().filter(|(_, row)| single(row)).map(|(lead, _)| preference[*lead]).collect())
}

/// The rank of a dense matrix modulo the prime.
pub fn rank(rows: Vec<Vec<Fp>>) -> usize {
    let mut echelon = Echelon::default();
    rows.into_iter().map(|row| usize::from(echelon.takes(row))).sum()
}

/// Independent rows modulo the prime, as they come.
#[derive(Clone, Debug, Default)]
pub struct Echelon(BTreeMap<usize, Vec<Fp>>);

impl Echelon {
    /// Takes a row if it is independent of those before.
    pub fn takes(&mut self, mut row: Vec<Fp>) -> bool {
        let Some(lead) = reduce_modular(&mut row, &self.0) else { return false };
        let scale = row[lead].inverse().unwrap_or(Fp::ONE);
        row.iter_mut().for_each(|x| *x = *x * scale);
        self.0.insert(lead, row);
        true
    }
}

fn reduce_modular(row: &mut [Fp], echelon: &BTreeMap<usize, Vec<Fp>>) -> Option<usize> {
    for lead in 0..row.len() {
        if row[lead] == Fp::ZERO {
            continue;
        }
        let Some(pivot) = echelon.get(&lead) else { return Some(lead) };
        let factor = row[lead];
        for (x, y) in row.iter_mut().zip(pivot).skip(lead) {
            if *y != Fp::ZERO {
                *x = *x - factor * *y;
            }
        }
    }
    None
}

type ReducedRow = BTreeMap<usize, Constant>;

/// The reduced row echelon form of a few rows, keyed by leading place; `None` on a division by zero.
fn reduce<'r>(
    field: &ConstantField,
    rows: impl Iterator<Item = &'r SparseRow>,
    place: &[usize],
) -> Option<BTreeMap<usize, ReducedRow>> {
    let mut echelon: BTreeMap<usize, ReducedRow> = BTreeMap::new();
    for row in rows {
        let mut current: ReducedRow =
            row.iter().map(|(c, entry)| (place[*c], field.whole(entry.clone()))).collect();
        // Earlier pivots first; what a subtraction adds stands to the right of the pivot.
        let mut from = 0;
        while let Some((at, value)) = current.range(from..).next().map(|(p, v)| (*p, v.clone())) {
            from = at + 1;
            if let Some(pivot) = echelon.get(&at) {
                subtract(field, &mut current, &value, pivot);
            }
        }
        let Some((lead, value)) = current.iter().next().map(|(p, v)| (*p, v.clone())) else { continue };
        let scaled: Option<ReducedRow> =
            current.iter().map(|(p, v)| field.div(v, &value).map(|q| (*p, q))).collect();
        let scaled = scaled?;
        for other in echelon.values_mut() {
            if let Some(factor) = other.get(&lead).cloned() {
                subtract(field, other, &factor, &scaled);
            }
        }
        echelon.insert(lead, scaled);
    }
    Some(echelon)
}

/// row −= factor·pivot
fn subtract(field: &ConstantField, row: &mut ReducedRow, factor: &Constant, pivot: &ReducedRow) {
    for (p, v) in pivot {
        let change = field.neg(&field.mul(factor, v));
        let sum = match row.get(p) {
            Some(old) => field.add(old, &change),
            None => change,
        };
        if sum.is_zero() {
            row.remove(p);
        } else {
            row.insert(*p, sum);
        }
    }
}

/// A column's relation over a common denominator: denominator·column = Σ numerator·kept.
struct Relation {
    column: usize,
    denominator: Numerator,
    terms: Vec<(usize, Numerator)>,
}

/// The relations of all columns without fractions, so that checking them takes products and sums alone.
fn relations(field: &ConstantField, dependence: &Dependence) -> Vec<Relation> {
    let one = field.whole(field.ring().integer(1));
    let relation = |(column, coordinates): (usize, &Vec<(usize, Constant)>)| {
        let mut row: Vec<(usize, &Constant)> =
            coordinates.iter().map(|(position, c)| (dependence.kept[*position], c)).collect();
        row.push((column, &one));
        let mut terms = field.clear_denominators(&row);
        let denominator = terms.pop().map_or(field.ring().integer(1), |(_, d)| d);
        Relation { column, denominator, terms }
    };
    dependence.coordinates.iter().enumerate().map(relation).collect()
}

/// Whether a row's entries obey the relations.
fn holds(field: &ConstantField, row: &SparseRow, relations: &[Relation]) -> bool {
    let ring = field.ring();
    let entry: BTreeMap<usize, &Numerator> = row.iter().map(|(c, e)| (*c, e)).collect();
    relations.iter().all(|relation| {
        let of = |column: &usize, factor: &Numerator| entry.get(column).map(|value| ring.mul(value, factor));
        let terms = relation.terms.iter().filter_map(|(kept, numerator)| of(kept, numerator));
        let sum = terms.fold(ring.integer(0), |sum, term| ring.add(&sum, &term));
        sum == of(&relation.column, &relation.denominator).unwrap_or_else(|| ring.integer(0))
    })
}

#[cfg(test)]
mod tests {
    use super::super::prime::Draws;
    use super::super::rational::integer;
    use super::super::symbols::AngleSymbols;
    use super::*;

    fn matrix(field: &ConstantField, rows: &[&[i64]]) -> Vec<SparseRow> {
        let sparse = |r: &&[i64]| {
            let entries = r.iter().enumerate().filter(|(_, v)| **v != 0);
            entries.map(|(c, v)| (c, field.ring().constant(integer(*v)))).collect()
        };
        rows.iter().map(sparse).collect()
    }

    #[test]
    fn preferred_columns_are_kept_and_the_rest_is_expressed_in_them() {
        let field = ConstantField::new(&AngleSymbols::default(), 0, &mut Draws::new(1));
        // column 2 = 2·column 0 − column 1; column 3 = 0
        let rows = matrix(&field, &[&[1, 0, 2, 0], &[0, 1, -1, 0], &[3, 5, 1, 0]]);
        let natural = dependence(&field, &rows, 4, &[0, 1, 2, 3]).unwrap();
        assert_eq!(natural.kept, [0, 1]);
        let text = |d: &Dependence, c: usize| -> Vec<(usize, String)> {
            d.coordinates[c].iter().map(|(p, v)| (d.kept[*p], field.text(v))).collect()
        };
        assert_eq!(text(&natural, 2), [(0, "2".into()), (1, "-1".into())]);
        assert!(natural.coordinates[3].is_empty());
        let other = dependence(&field, &rows, 4, &[2, 1, 0, 3]).unwrap();
        assert_eq!(other.kept, [2, 1]);
        assert_eq!(text(&other, 0), [(2, "1/2".into()), (1, "1/2".into())]);
    }

    #[test]
    fn a_wrong_relation_is_noticed() {
        let field = ConstantField::new(&AngleSymbols::default(), 0, &mut Draws::new(1));
        let rows = matrix(&field, &[&[1, 2], &[2, 4]]);
        let mut found = dependence(&field, &rows, 2, &[0, 1]).unwrap();
        let all_hold = |d: &Dependence| rows.iter().all(|r| holds(&field, r, &relations(&field, d)));
        assert!(all_hold(&found));
        found.coordinates[1][0].1 = field.rational(integer(3));
        assert!(!all_hold(&found));
    }
}
