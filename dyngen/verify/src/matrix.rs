//! Matrices over the prime field, row by row.

use dyngen_arm::exact::prime::Fp;

/// The product of two matrices; `inner` is the first one's number of columns.
pub(crate) fn times(a: &[Fp], b: &[Fp], inner: usize) -> Vec<Fp> {
    let columns = b.len() / inner.max(1);
    let entry =
        |i: usize, j: usize| (0..inner).fold(Fp::ZERO, |sum, l| sum + a[i * inner + l] * b[l * columns + j]);
    (0..a.len() / inner.max(1))
        .flat_map(|i| (0..columns).map(move |j| (i, j)))
        .map(|(i, j)| entry(i, j))
        .collect()
}

/// The transpose of a matrix with `columns` columns.
pub(crate) fn transposed(matrix: &[Fp], columns: usize) -> Vec<Fp> {
    (0..columns).flat_map(|j| matrix.iter().skip(j).step_by(columns).copied()).collect()
}

/// The inverse by Gauss and Jordan; nothing where there is none.
pub(crate) fn inverse(a: Vec<Fp>, n: usize) -> Option<Vec<Fp>> {
    let unit = |i: usize| (0..n).map(move |j| if i == j { Fp::ONE } else { Fp::ZERO });
    let mut rows: Vec<Vec<Fp>> =
        (0..n).map(|i| a[i * n..(i + 1) * n].iter().copied().chain(unit(i)).collect()).collect();
    if reduce(&mut rows, n).len() < n {
        return None;
    }
    Some(rows.into_iter().flat_map(|row| row.into_iter().skip(n)).collect())
}

/// Brings rows into their reduced echelon form by the first `columns`; gives the columns of the pivots.
pub(crate) fn reduce(rows: &mut [Vec<Fp>], columns: usize) -> Vec<usize> {
    let mut pivots = Vec::new();
    for column in 0..columns {
        let rank = pivots.len();
        let Some(pivot) = (rank..rows.len()).find(|r| rows[*r][column] != Fp::ZERO) else { continue };
        rows.swap(rank, pivot);
        let scale = rows[rank][column].inverse().unwrap_or(Fp::ONE);
        let own: Vec<Fp> = rows[rank].iter().map(|x| *x * scale).collect();
        for (r, row) in rows.iter_mut().enumerate() {
            let factor = if r == rank { Fp::ZERO } else { row[column] };
            if factor != Fp::ZERO {
                row.iter_mut().zip(&own).for_each(|(x, y)| *x = *x - factor * *y);
            }
        }
        rows[rank] = own;
        pivots.push(column);
    }
    pivots
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_singular_matrix_has_no_inverse() {
        let matrix = |x: [i64; 4]| x.map(Fp::from_integer).to_vec();
        assert_eq!(inverse(matrix([1, 2, 2, 4]), 2), None);
        let regular = matrix([1, 2, 3, 4]);
        let inverse = inverse(regular.clone(), 2);
        assert_eq!(inverse.map(|x| times(&regular, &x, 2)), Some(matrix([1, 0, 0, 1])));
    }
}
