//! How much of the bus a profile needs: computed before anything is sent.
//!
//! A classic frame with an 11-bit identifier and n bytes has 47 + 8n bits with its pause; stuffing adds up to
//! ⌊(33 + 8n)/4⌋. A cycle of SYNC, one receive PDO and the transmit PDOs of every node must fit into the SYNC
//! period, and so must the heartbeats, which are included. Above 100 % of the worst case the driver refuses
//! to start; above [`WARN_ABOVE`] it warns.

use super::profile::{ModeProfile, Profile};
use crate::canopen::Micros;
use core::fmt;

/// Worst-case load above which the driver warns. The lean interpolated mapping of this arm at 200 Hz and 500
/// kbit/s needs 89 % with its heartbeats and is what has run on the real one; with a torque offset it needs
/// 94 %.
pub const WARN_ABOVE: f64 = 0.90;

/// Bits of a frame with `bytes` bytes, with its pause, without stuffing.
pub const fn nominal_bits(bytes: usize) -> u32 {
    47 + 8 * bytes as u32
}

/// Bits of a frame with `bytes` bytes, with its pause and the most stuffing that there can be.
pub const fn worst_bits(bytes: usize) -> u32 {
    nominal_bits(bytes) + (33 + 8 * bytes as u32) / 4
}

/// Bits on the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Bits {
    /// Without stuffing.
    pub nominal: u32,
    /// Number of bits with the most stuffing.
    pub worst: u32,
}

impl Bits {
    /// `count` frames of `bytes` bytes.
    pub const fn frames(count: u32, bytes: usize) -> Bits {
        Bits { nominal: count * nominal_bits(bytes), worst: count * worst_bits(bytes) }
    }

    const fn plus(self, other: Bits) -> Bits {
        Bits { nominal: self.nominal + other.nominal, worst: self.worst + other.worst }
    }
}

/// Bits of one SYNC cycle: SYNC, and to and from each of `nodes` nodes one frame for each length given.
/// A length of 0 is a PDO that is not used.
pub fn cycle_bits(nodes: u32, lengths: impl IntoIterator<Item = usize>) -> Bits {
    let used = lengths.into_iter().filter(|&bytes| bytes > 0);
    used.fold(Bits::frames(1, 0), |sum, bytes| sum.plus(Bits::frames(nodes, bytes)))
}

/// The bus load of a profile in one mode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Budget {
    /// bit/s.
    pub bitrate: u32,
    /// µs.
    pub period: Micros,
    /// Bits of one cycle.
    pub cycle: Bits,
    /// Bits of the receive PDOs of one cycle.
    pub setpoints: Bits,
    /// Bits of the heartbeats of one second.
    pub heartbeats: Bits,
}

/// Whether a budget fits the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// The load fits the bus.
    Fits,
    /// The load fits in the worst case, but without a reserve for retransmissions or SDO.
    Tight,
    /// The load does not fit in the worst case.
    TooMuch,
}

impl Budget {
    /// The budget of `profile` in a mode.
    pub fn of<const N: usize>(profile: &Profile<N>, mode: &ModeProfile) -> Budget {
        let nodes = N as u32;
        let tpdos = profile.tpdos.iter().map(|mapping| mapping.len());
        let rate = |period: Micros| (1_000_000u64).checked_div(period).unwrap_or(0) as u32;
        let beats =
            nodes * rate(Micros::from(profile.node_heartbeat_ms) * 1000) + rate(profile.master_heartbeat);
        Budget {
            bitrate: profile.bitrate,
            period: profile.sync_period,
            cycle: cycle_bits(nodes, tpdos.chain([mode.rpdo.len()])),
            setpoints: Bits::frames(nodes, mode.rpdo.len()),
            heartbeats: Bits::frames(beats, 1),
        }
    }

    fn load(&self, cycle: u32, heartbeats: u32) -> f64 {
        let (cycle, second) = (f64::from(cycle) * 1e6 / self.period as f64, f64::from(heartbeats));
        (cycle + second) / f64::from(self.bitrate)
    }

    /// Part of the bus without stuffing.
    pub fn nominal_load(&self) -> f64 {
        self.load(self.cycle.nominal, self.heartbeats.nominal)
    }

    /// Part of the bus in the worst case.
    pub fn worst_load(&self) -> f64 {
        self.load(self.cycle.worst, self.heartbeats.worst)
    }

    /// How long `bits` take, µs, rounded up.
    pub fn duration(&self, bits: u32) -> Micros {
        (u64::from(bits) * 1_000_000).div_ceil(u64::from(self.bitrate.max(1)))
    }

    /// When after SYNC the set-points must begin to leave to be with the drives before the next SYNC, µs: the
    /// period less the worst-case time of the receive PDOs and 2 % of the period. What is computed from a
    /// cycle's data has from the last transmit PDO until then.
    pub fn setpoint_slot(&self) -> Micros {
        self.period.saturating_sub(self.duration(self.setpoints.worst) + self.period / 50)
    }

    /// From the last transmit PDO (worst case) to [`Budget::setpoint_slot`], µs: the caller's time to
    /// compute.
    pub fn compute_time(&self) -> Micros {
        let data = self.duration(self.cycle.worst - self.setpoints.worst);
        self.setpoint_slot().saturating_sub(data)
    }

    /// Whether it fits.
    pub fn verdict(&self) -> Verdict {
        match self.worst_load() {
            load if load > 1.0 || !load.is_finite() => Verdict::TooMuch,
            load if load > WARN_ABOVE => Verdict::Tight,
            _ => Verdict::Fits,
        }
    }
}

impl fmt::Display for Budget {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} bits a cycle ({} without stuffing); {:.1} % of {} kbit/s at {:.0} Hz with heartbeats ({:.1} \
                % without stuffing)",
            self.cycle.worst,
            self.cycle.nominal,
            100.0 * self.worst_load(),
            self.bitrate / 1000,
            1e6 / self.period as f64,
            100.0 * self.nominal_load(),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_have_the_bits_of_the_standard() {
        assert_eq!([0, 2, 4, 6, 8].map(worst_bits), [55, 75, 95, 115, 135]);
        assert_eq!([0, 2, 4, 6, 8].map(nominal_bits), [47, 63, 79, 95, 111]);
    }

    /// Six nodes and SYNC at 200 Hz: receive and transmit PDO lengths; worst and nominal bits; per cent of
    /// 500 kbit/s and of 1 Mbit/s, worst and nominal; ms of a 5 ms cycle at 500 kbit/s.
    #[test]
    fn the_table_of_mappings() {
        type Row = (&'static [usize], [u32; 2], [f64; 4], f64);
        let rows: [Row; 6] = [
            (&[8, 8, 8], [2485, 2045], [99.4, 81.8, 49.7, 40.9], 4.97),
            (&[6, 8, 4], [2125, 1757], [85.0, 70.3, 42.5, 35.1], 4.25),
            (&[8, 8, 4], [2245, 1853], [89.8, 74.1, 44.9, 37.1], 4.49),
            (&[4, 8, 4], [2005, 1661], [80.2, 66.4, 40.1, 33.2], 4.01),
            (&[6, 8], [1555, 1283], [62.2, 51.3, 31.1, 25.7], 3.11),
            (&[8, 8, 3, 8], [2995, 2471], [119.8, 98.8, 59.9, 49.4], 5.99),
        ];
        for (lengths, bits, loads, busy) in rows {
            let cycle = cycle_bits(6, lengths.iter().copied());
            assert_eq!([cycle.worst, cycle.nominal], bits, "{lengths:?}");
            let at = |bitrate| Budget {
                bitrate,
                period: 5000,
                cycle,
                setpoints: Bits::frames(6, lengths[0]),
                heartbeats: Bits::default(),
            };
            let (half, full) = (at(500_000), at(1_000_000));
            let found = [half.worst_load(), half.nominal_load(), full.worst_load(), full.nominal_load()];
            for (found, stated) in found.iter().zip(loads) {
                assert!((100.0 * found - stated).abs() < 0.06, "{lengths:?}: {found} {stated}");
            }
            assert_eq!(half.duration(cycle.worst), (busy * 1000.0) as u64);
            assert_eq!(half.verdict() == Verdict::TooMuch, busy > 5.0);
        }
    }

    /// The figures of `docs/bus.md`.
    #[test]
    fn the_arms_own_budget() {
        use crate::driver::lwa4p::LWA4P;
        let budget = Budget::of(&LWA4P, &LWA4P.interpolated_position.unwrap());
        assert!((budget.worst_load() - 0.887).abs() < 5e-4, "{budget}");
        assert_eq!((budget.setpoint_slot(), budget.compute_time()), (3520, 530));
        assert_eq!((budget.heartbeats.worst, budget.verdict()), (6500, Verdict::Fits));
        assert!((Budget::of(&LWA4P, &LWA4P.velocity.unwrap()).worst_load() - 0.839).abs() < 5e-4);
    }

    /// Seven heartbeats at 10 Hz need 0.9 % of 500 kbit/s.
    #[test]
    fn heartbeats_are_counted() {
        let heartbeats = Bits::frames(70, 1);
        assert!((f64::from(heartbeats.worst) / 500_000.0 - 0.009).abs() < 2e-4);
    }
}
