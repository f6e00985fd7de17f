//! Ratios of sums over blocks that count as independent.

use super::distribution::t_quantile_975;

/// Σ a / Σ b over blocks (a, b), and half the width of its 95 % interval by Student's t: infinite where fewer
/// than two blocks have a denominator.
#[must_use]
pub(crate) fn over_blocks(blocks: &[(f64, f64)]) -> (f64, f64) {
    let used: Vec<&(f64, f64)> = blocks.iter().filter(|(_, b)| *b > 0.0).collect();
    let count = used.len() as f64;
    let (above, below) = used.iter().fold((0.0, 0.0), |(a, b), block| (a + block.0, b + block.1));
    let ratio = if below > 0.0 { above / below } else { 0.0 };
    if count < 2.0 {
        return (ratio, f64::INFINITY);
    }
    let squares: f64 = used.iter().map(|(a, b)| (a - ratio * b).powi(2)).sum();
    (ratio, t_quantile_975(count - 1.0) * (squares * count / (count - 1.0)).sqrt() / below)
}

#[cfg(test)]
mod tests {
    use super::over_blocks;
    use rand::{RngExt, SeedableRng};

    #[test]
    fn intervals_hold_the_true_ratio_as_often_as_they_say() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(5);
        let held = (0..2000)
            .filter(|_| {
                let blocks: Vec<(f64, f64)> = (0..25)
                    .map(|_| {
                        let b = rng.random_range(1.0..2.0);
                        (b * rng.random_range(0.2..1.0), b)
                    })
                    .collect();
                let (ratio, half) = over_blocks(&blocks);
                (ratio - 0.6).abs() < half
            })
            .count();
        assert!((1860..=1940).contains(&held), "{held} of 2000");
        assert_eq!(over_blocks(&[(1.0, 2.0)]), (0.5, f64::INFINITY));
        assert_eq!(over_blocks(&[]).0, 0.0);
    }
}
