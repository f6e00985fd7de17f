//! Fewer points for the same picture.

use std::collections::HashSet;

/// A curve of at most about two points for each of `columns` columns: the lowest and the highest value of
/// each column, in their order, so that no peak is lost. Points that are not finite break the curve and are
/// kept as one break. The points must be ordered by their first coordinate within each unbroken piece.
pub(super) fn envelope(points: &[(f64, f64)], columns: usize) -> Vec<(f64, f64)> {
    let finite = |p: &(f64, f64)| p.0.is_finite() && p.1.is_finite();
    let (low, high) = points
        .iter()
        .filter(|p| finite(p))
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), p| (l.min(p.0), h.max(p.0)));
    if points.len() <= 2 * columns || high <= low {
        return points.to_vec();
    }
    let column = |x: f64| ((x - low) / (high - low) * columns as f64) as usize;
    let mut out = Vec::with_capacity(2 * columns + 2);
    let mut start = 0;
    while start < points.len() {
        if !finite(&points[start]) {
            out.push((f64::NAN, f64::NAN));
            start += 1;
            while start < points.len() && !finite(&points[start]) {
                start += 1;
            }
            continue;
        }
        let this = column(points[start].0);
        let mut end = start + 1;
        while end < points.len() && finite(&points[end]) && column(points[end].0) == this {
            end += 1;
        }
        let by_value = |a: &usize, b: &usize| points[*a].1.total_cmp(&points[*b].1);
        let lowest = (start..end).min_by(by_value).unwrap_or(start);
        let highest = (start..end).max_by(by_value).unwrap_or(start);
        out.push(points[lowest.min(highest)]);
        if lowest != highest {
            out.push(points[lowest.max(highest)]);
        }
        start = end;
    }
    out
}

/// A cloud in which each cell of a grid holds at most one point, and at most `most` points in all.
pub(super) fn thin(points: &[(f64, f64)], cell: (f64, f64), most: usize) -> Vec<(f64, f64)> {
    let mut seen = HashSet::new();
    let distinct: Vec<(f64, f64)> = points
        .iter()
        .filter(|p| p.0.is_finite() && p.1.is_finite())
        .filter(|p| seen.insert(((p.0 / cell.0).round() as i64, (p.1 / cell.1).round() as i64)))
        .copied()
        .collect();
    let stride = distinct.len().div_ceil(most.max(1)).max(1);
    distinct.into_iter().step_by(stride).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lone_peak_survives() {
        let mut points: Vec<(f64, f64)> = (0..10_000).map(|k| (k as f64, (k as f64 * 0.01).sin())).collect();
        points[5_003].1 = 50.0;
        points[7_001].1 = -50.0;
        let small = envelope(&points, 300);
        assert!(small.len() <= 602, "{}", small.len());
        assert!(small.contains(&(5003.0, 50.0)) && small.contains(&(7001.0, -50.0)));
        assert!(small.windows(2).all(|w| w[0].0 <= w[1].0));
    }

    #[test]
    fn gaps_stay_gaps() {
        let mut points: Vec<(f64, f64)> = (0..5_000).map(|k| (k as f64, 1.0)).collect();
        for p in &mut points[2_000..2_100] {
            p.1 = f64::NAN;
        }
        let small = envelope(&points, 100);
        assert_eq!(small.iter().filter(|p| p.1.is_nan()).count(), 1);
    }

    #[test]
    fn a_cloud_is_thinned() {
        let points: Vec<(f64, f64)> = (0..50_000).map(|k| ((k % 97) as f64, (k % 89) as f64)).collect();
        assert!(thin(&points, (1.0, 1.0), 2_000).len() <= 2_000);
        assert_eq!(thin(&points, (1e3, 1e3), 2_000).len(), 1);
    }
}
