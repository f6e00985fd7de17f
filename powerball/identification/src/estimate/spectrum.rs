//! The spectrum of a noise from its powers by octave.
//!
//! Haar's octaves are not sharp: each sees some of its neighbours, most of all the slower ones' power. A
//! noise of colour then looks flatter than it is, and where a motion stands in slow octaves and leaks into
//! fast ones, the fast ones' smaller power counts for a part of it. Both are known: a wave of frequency f
//! leaves the share E_g(f) of its square in octave g, whatever else is in the signal. With a spectrum S(f) =
//! Σ_h μ_h·E_h(f) the mean power in octave g is
//!
//! λ_g = Σ_h K_gh·μ_h, K_gh = ∫E_g·E_h df / ∫E_g df,
//!
//! and a column that leaves the square D_g in octave g takes Σ_g μ_g·D_g of the noise, as if the octaves were
//! sharp and their powers were the μ. These are the most likely ones for powers λ that are known with some
//! degrees of freedom each (Whittle's likelihood), by multiplicative steps (Févotte, Bertin and Durrieu 2009,
//! Neural Computation 21: Itakura–Saito's divergence), which keep them positive.
//!
//! The module also estimates the error that no model can avoid.

use powerball_logs::regression::Data;
use powerball_logs::signal::Band;
use powerball_logs::summary::OCTAVES;
use std::f64::consts::PI;
use std::sync::LazyLock;

/// Steps from the uncorrected powers; more steps amplify their uncertainty.
const STEPS: usize = 30;

/// A power as an octave shows it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Power {
    /// The octave, 0 is the fastest.
    pub octave: usize,
    /// Mean square.
    pub mean: f64,
    /// Equivalent number of independent squares in the mean.
    pub freedom: f64,
}

/// K, for as many octaves as there are.
static LEAKS: LazyLock<[[f64; OCTAVES]; OCTAVES]> = LazyLock::new(leaks);

/// E_g at a frequency in periods a row: the squared gain of Haar's g-th wavelet over its length; the last
/// octave holds all sums that are left.
fn shares(frequency: f64) -> [f64; OCTAVES] {
    let one = (PI * frequency).sin().powi(2);
    std::array::from_fn(|g| {
        let last = g == OCTAVES - 1;
        let rows = if last { 1u32 << g } else { 2u32 << g };
        let summed = if last { rows } else { rows / 2 };
        let wave = (PI * frequency * f64::from(summed)).sin().powi(2);
        let gain = if last { wave } else { 4.0 * wave * wave };
        gain / (one * f64::from(rows).powi(2))
    })
}

fn leaks() -> [[f64; OCTAVES]; OCTAVES] {
    // Sums over a circle of more points than the products have harmonics are the integrals.
    const POINTS: usize = 8 << OCTAVES;
    let at: Vec<_> = (0..POINTS).map(|k| shares((k as f64 + 0.5) / POINTS as f64)).collect();
    std::array::from_fn(|g| {
        let all: f64 = at.iter().map(|e| e[g]).sum();
        std::array::from_fn(|h| at.iter().map(|e| e[g] * e[h]).sum::<f64>() / all)
    })
}

/// The μ of a noise with these powers, in their order.
pub(super) fn deconvolved(powers: &[Power]) -> Vec<f64> {
    let mut sharp: Vec<f64> = powers.iter().map(|p| p.mean).collect();
    if sharp.iter().any(|mean| !(*mean > 0.0 && mean.is_finite())) {
        return sharp;
    }
    // The leak from octaves without data is ignored.
    let leaks: Vec<Vec<f64>> = powers
        .iter()
        .map(|p| {
            let row: Vec<f64> = powers.iter().map(|other| LEAKS[p.octave][other.octave]).collect();
            let all: f64 = row.iter().sum();
            row.into_iter().map(|share| share / all).collect()
        })
        .collect();
    for _ in 0..STEPS {
        let mixed: Vec<f64> =
            leaks.iter().map(|row| row.iter().zip(&sharp).map(|(k, mu)| k * mu).sum()).collect();
        for (h, mu) in sharp.iter_mut().enumerate() {
            let (mut up, mut down) = (0.0, 0.0);
            for ((power, row), mixed) in powers.iter().zip(&leaks).zip(&mixed) {
                let weight = power.freedom * row[h] / mixed;
                up += weight * power.mean / mixed;
                down += weight;
            }
            *mu *= (up / down).sqrt();
        }
    }
    sharp
}

// The error that no model can avoid.

/// Residual of measurement noise alone in the band, by joint, N·m.
///
/// Noise is seen where the motion is not: between neighbouring samples (second differences), and in the
/// octave above the band. Where the two disagree the noise is not white (a stiff servo's torque trembles
/// fast), and the smaller one is taken. Noise that is slower than the band is not seen this way, so the floor
/// is the lowest one that can be hoped for.
#[must_use]
pub fn noise_floor(data: &Data<'_>) -> Vec<f64> {
    let of_joint = |j: usize| {
        let torques: Vec<&[f64]> = data.recordings.iter().map(|r| r.torque[j].as_slice()).collect();
        noise_in_band(&torques, &data.joints[j].band, data.rate())
    };
    (0..data.dof()).map(of_joint).collect()
}

/// Residual of measurement noise alone in the band of one joint's torques, along recordings of `rate`
/// Hz.
pub(crate) fn noise_in_band(torques: &[&[f64]], band: &Band, rate: f64) -> f64 {
    let wider = Band::new(2.0 * band.cutoff, rate);
    let (share, between) = (band.white_share(rate), band.white_share_between(&wider, rate));
    let differences = torques.iter().flat_map(|tau| tau.windows(3)).map(|w| w[0] - 2.0 * w[1] + w[2]);
    // Second differences of white noise have six times its variance.
    let fast = deviation(differences.collect()) / 6f64.sqrt();
    if between < 1e-3 {
        return fast * share;
    }
    let above = torques.iter().flat_map(|tau| {
        let (wide, narrow) = (wider.filtered(tau), band.filtered(tau));
        let inner = band.trim..tau.len().saturating_sub(band.trim).max(band.trim);
        inner.map(|k| wide[k] - narrow[k]).collect::<Vec<f64>>()
    });
    fast.min(deviation(above.collect()) / between) * share
}

/// Standard deviation from the median of squares, which reversals and impacts do not change.
fn deviation(values: Vec<f64>) -> f64 {
    let mut squares: Vec<f64> = values.into_iter().map(|v| v * v).collect();
    if squares.is_empty() {
        return 0.0;
    }
    let middle = squares.len() / 2;
    let (_, median, _) = squares.select_nth_unstable_by(middle, f64::total_cmp);
    // The median of χ² with one degree of freedom.
    (*median / 0.4549).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use powerball_logs::summary::halved;

    fn octaves(signal: &[f64]) -> Vec<Vec<f64>> {
        let mut sums = signal.to_vec();
        let mut out = Vec::new();
        for _ in 1..OCTAVES {
            let (differences, slower) = halved(&sums);
            out.push(differences);
            sums = slower;
        }
        out.push(sums);
        out
    }

    fn square(signal: &[f64]) -> f64 {
        signal.iter().map(|x| x * x).sum()
    }

    /// What waves leave in the octaves, on average over their phases, is what the gains say.
    #[test]
    fn waves_leave_their_shares() {
        let rows = 4 << OCTAVES;
        for frequency in [0.002, 0.013, 0.07, 0.31] {
            let mut left = [0.0; OCTAVES];
            for phase in 0..16 {
                let angle = |k: usize| 2.0 * PI * (frequency * k as f64 + f64::from(phase) / 32.0);
                let wave: Vec<f64> = (0..rows).map(|k| angle(k).sin()).collect();
                let all = square(&wave);
                for (left, octave) in left.iter_mut().zip(octaves(&wave)) {
                    *left += square(&octave) / all / 16.0;
                }
            }
            for (left, share) in left.iter().zip(shares(frequency)) {
                approx::assert_abs_diff_eq!(*left, share, epsilon = 0.01);
            }
            approx::assert_relative_eq!(shares(frequency).iter().sum::<f64>(), 1.0, max_relative = 1e-9);
        }
    }

    /// The variance of a wave's coefficient, Σ of its covariance with every row, under a noise that forgets
    /// within some rows: by the octaves' powers as they are up to a third too small, by the sharpened ones
    /// right.
    #[test]
    fn a_column_takes_the_noise_of_its_frequency() {
        let rows = 2 << OCTAVES;
        for forgets in [2.0f64, 4.0, 8.0] {
            let kept = (-1.0 / forgets).exp();
            let covariance = |a: usize, b: usize| kept.powi(a.abs_diff(b) as i32);
            let noise: Vec<Vec<Vec<f64>>> = (0..rows)
                .map(|a| octaves(&(0..rows).map(|b| covariance(a, b)).collect::<Vec<_>>()))
                .collect();
            // Turned on both sides: the diagonal's means are the octaves' powers.
            let mut powers = Vec::new();
            for octave in 0..OCTAVES {
                let count = noise[0][octave].len();
                let own = |i: usize| {
                    let column: Vec<f64> = noise.iter().map(|row| row[octave][i]).collect();
                    octaves(&column)[octave][i]
                };
                let mean = (0..count).map(own).sum::<f64>() / count as f64;
                powers.push(Power { octave, mean, freedom: count as f64 });
            }
            let sharp = deconvolved(&powers);
            for frequency in [0.004, 0.01, 0.02, 0.03] {
                let (mut truth, mut plain, mut found) = (0.0, 0.0, 0.0);
                for phase in 0..8 {
                    let angle = |k: usize| 2.0 * PI * (frequency * k as f64 + f64::from(phase) / 16.0);
                    let wave: Vec<f64> = (0..rows).map(|k| angle(k).sin()).collect();
                    let pairs = (0..rows).flat_map(|a| (0..rows).map(move |b| (a, b)));
                    truth += pairs.map(|(a, b)| wave[a] * covariance(a, b) * wave[b]).sum::<f64>();
                    for (g, octave) in octaves(&wave).iter().enumerate() {
                        plain += powers[g].mean * square(octave);
                        found += sharp[g] * square(octave);
                    }
                }
                assert!(plain < 1.02 * truth, "{forgets} {frequency}: {}", plain / truth);
                assert!((found / truth - 1.0).abs() < 0.16, "{forgets} {frequency}: {}", found / truth);
            }
        }
    }

    #[test]
    fn white_noise_stays_as_it_is_and_no_noise_does_no_harm() {
        let of = |mean: f64| (0..OCTAVES).map(move |octave| Power { octave, mean, freedom: 9.0 });
        for mu in deconvolved(&of(0.3).collect::<Vec<_>>()) {
            approx::assert_relative_eq!(mu, 0.3, max_relative = 1e-9);
        }
        // Octaves without rows are left out.
        for mu in deconvolved(&of(0.3).filter(|p| p.octave % 3 == 1).collect::<Vec<_>>()) {
            approx::assert_relative_eq!(mu, 0.3, max_relative = 1e-9);
        }
        assert_eq!(deconvolved(&of(0.0).collect::<Vec<_>>()), [0.0; OCTAVES]);
        assert!(deconvolved(&[]).is_empty());
    }
}
