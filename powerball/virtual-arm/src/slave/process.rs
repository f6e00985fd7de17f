//! The drive's process data: communication and mapping objects with the device's own rules.
//!
//! As on the real drive a PDO is changed in pre-operational only, after its COB-ID was made invalid; its
//! mapping only while it maps nothing.
//!
//! The module also computes the demanded position of a joint.

use super::dictionary::Dictionary;
use powerball_bus::canopen::pdo::{Entry, INVALID, Mapping};
use powerball_bus::canopen::sdo::AbortCode;
use powerball_bus::canopen::{Frame, Object};

/// Receive PDOs of the drive.
pub(super) const RECEIVE: u16 = 2;
/// Transmit PDOs of the drive.
pub(super) const TRANSMIT: u16 = 4;

/// Whether an object describes a PDO, and may be written as the rules say.
///
/// # Errors
/// Where a rule forbids it.
pub(super) fn check(
    dictionary: &Dictionary,
    object: Object,
    value: i64,
    pre_operational: bool,
) -> Result<(), AbortCode> {
    let (parameter, receive) = match object.index {
        0x1400..=0x1403 | 0x1600..=0x1603 => (0x1400 + (object.index & 3), true),
        0x1800..=0x1803 | 0x1A00..=0x1A03 => (0x1800 + (object.index & 3), false),
        _ => return Ok(()),
    };
    if !pre_operational {
        return Err(AbortCode::DEVICE_STATE);
    }
    let cob = dictionary.get(Object::new(parameter, 1)) as u32;
    let valid = cob & INVALID == 0;
    if object.index == parameter {
        return match object.sub {
            // The identifier may only change while the PDO is or becomes invalid.
            1 if valid && value as u32 & INVALID == 0 && value as u32 != cob => Err(AbortCode::VALUE),
            1 if value & 0x2000_0000 != 0 => Err(AbortCode::VALUE),
            2 if (241..=251).contains(&value) => Err(AbortCode::VALUE),
            _ => Ok(()),
        };
    }
    let count = dictionary.get(Object::new(object.index, 0));
    if valid {
        return Err(AbortCode::DEVICE_STATE);
    }
    match object.sub {
        0 => mapping_of(dictionary, object.index, value).map(|_| ()),
        _ if count != 0 => Err(AbortCode::DEVICE_STATE),
        _ => mappable(dictionary, Entry::from_u32(value as u32), receive),
    }
}

fn mappable(dictionary: &Dictionary, entry: Entry, receive: bool) -> Result<(), AbortCode> {
    let target = dictionary.entry(entry.object)?;
    let direction = if receive { target.writable } else { target.readable };
    let size = target.kind.size().is_some_and(|size| 8 * size == usize::from(entry.bits));
    if target.mappable && direction && size { Ok(()) } else { Err(AbortCode::NOT_MAPPABLE) }
}

fn mapping_of(dictionary: &Dictionary, index: u16, count: i64) -> Result<Mapping, AbortCode> {
    let entries: Vec<Entry> = (1..=count.clamp(0, 9) as u8)
        .map(|sub| Entry::from_u32(dictionary.get(Object::new(index, sub)) as u32))
        .collect();
    if entries.len() > 8 {
        return Err(AbortCode::VALUE);
    }
    Mapping::new(&entries).map_err(|_| AbortCode::PDO_LENGTH)
}

/// One PDO as it is set up.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pdo {
    /// The PDO's identifier.
    pub(super) id: u16,
    /// The PDO's transmission type.
    pub(super) kind: u8,
    /// The PDO's objects.
    pub(super) mapping: Mapping,
}

/// The valid PDOs of a drive.
#[derive(Clone, Debug, Default)]
pub(super) struct Pdos {
    pub(super) receive: Vec<Pdo>,
    pub(super) transmit: Vec<Pdo>,
}

impl Pdos {
    /// Reads them from the dictionary.
    pub(super) fn read(dictionary: &Dictionary) -> Self {
        let all = |base: u16, count: u16| {
            (0..count)
                .filter_map(|k| {
                    let cob = dictionary.get(Object::new(base + k, 1)) as u32;
                    let mapping = base + 0x200 + k;
                    let count = dictionary.get(Object::new(mapping, 0));
                    let mapping = mapping_of(dictionary, mapping, count).ok()?;
                    let kind = dictionary.get(Object::new(base + k, 2)) as u8;
                    let used = cob & INVALID == 0 && !mapping.is_empty();
                    used.then_some(Pdo { id: (cob & 0x7FF) as u16, kind, mapping })
                })
                .collect()
        };
        Pdos { receive: all(0x1400, RECEIVE), transmit: all(0x1800, TRANSMIT) }
    }
}

impl Pdo {
    /// The frame with the dictionary's present values.
    pub(super) fn frame(&self, dictionary: &Dictionary) -> Option<Frame> {
        let (bytes, len) = self.mapping.pack(|object| match dictionary.entry(object).map(|e| &e.value) {
            Ok(super::dictionary::Value::Number(number)) => *number,
            Ok(super::dictionary::Value::Real(number)) => i64::from((*number as f32).to_bits()),
            _ => 0,
        });
        Frame::from_raw(self.id, &bytes[..len])
    }

    /// Whether it is sent with this SYNC, the `count`-th since the drive went operational.
    pub(super) fn due(&self, count: u64) -> bool {
        (1..=240).contains(&self.kind) && count.is_multiple_of(u64::from(self.kind))
    }
}

// The demanded position of a joint: ramps, profiles and the interpolation of set-points.

/// Position and velocity that the servo follows, rad and rad/s.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Reference {
    pub(super) position: f64,
    pub(super) velocity: f64,
}

impl Reference {
    /// Slows down by `acceleration`, rad/s², to rest.
    pub(super) fn stop(&mut self, h: f64, acceleration: f64) {
        self.change(h, 0.0, acceleration);
    }

    fn change(&mut self, h: f64, wanted: f64, acceleration: f64) {
        let before = self.velocity;
        self.velocity += (wanted - self.velocity).clamp(-acceleration * h, acceleration * h);
        self.position += 0.5 * h * (before + self.velocity);
    }

    /// Ramps to a velocity; stops before the limits. False where a limit is in the way.
    pub(super) fn cruise(&mut self, h: f64, wanted: f64, acceleration: f64, limits: [f64; 2]) -> bool {
        if limits[0] >= limits[1] {
            self.change(h, wanted, acceleration);
            return true;
        }
        let room = |limit: f64| (2.0 * acceleration * (limit - self.position).abs()).sqrt();
        let high = if self.position < limits[1] { room(limits[1]) } else { 0.0 };
        let low = if self.position > limits[0] { -room(limits[0]) } else { 0.0 };
        let allowed = wanted.clamp(low, high);
        self.change(h, allowed, acceleration);
        allowed == wanted
    }

    /// A step of a trapezoidal profile to `target`; true once there.
    pub(super) fn approach(&mut self, h: f64, target: f64, velocity: f64, acceleration: f64) -> bool {
        let way = target - self.position;
        if way.abs() <= self.velocity.abs() * h + acceleration * h * h
            && self.velocity.abs() <= 2.0 * acceleration * h
        {
            *self = Reference { position: target, velocity: 0.0 };
            return true;
        }
        // The velocity from which it can still stop there, one step from now.
        let braking = (2.0 * acceleration * way.abs()).sqrt() - acceleration * h;
        self.change(h, way.signum() * velocity.min(braking.max(0.0)), acceleration);
        false
    }
}

/// Between set-points the drive follows the cubic B-spline of the last four: linear interpolation averaged
/// twice over one period, as a drive's jerk filter does. Acceleration is continuous, and a constant velocity
/// is followed exactly, two periods late. `phase` is the share of the period that has passed.
pub(super) fn spline(points: [f64; 4], phase: f64, period: f64) -> Reference {
    let x = phase.clamp(0.0, 1.0);
    let (y, x2, x3) = (1.0 - x, x * x, x * x * x);
    let place = [y * y * y, 3.0 * x3 - 6.0 * x2 + 4.0, -3.0 * x3 + 3.0 * x2 + 3.0 * x + 1.0, x3];
    let slope = [-y * y, 3.0 * x2 - 4.0 * x, -3.0 * x2 + 2.0 * x + 1.0, x2];
    let sum = |weights: [f64; 4]| weights.iter().zip(points).map(|(w, p)| w * p).sum::<f64>();
    // A SYNC that is late by up to a period lets the velocity stand; then the joint stops.
    let velocity = if phase > 2.0 { 0.0 } else { sum(slope) / (2.0 * period) };
    Reference { position: sum(place) / 6.0, velocity }
}

#[cfg(test)]
mod motion_tests {
    use super::*;

    #[test]
    fn a_profile_arrives_without_passing_its_target_or_its_limits() {
        for (target, h) in [(1.0, 1e-3), (-0.3, 1e-3), (0.001, 1e-3), (0.5, 5e-3)] {
            let mut r = Reference::default();
            let mut steps = 0;
            loop {
                let before = r;
                let there = r.approach(h, target, 0.8, 4.0);
                assert!(r.velocity.abs() <= 0.8 + 1e-12);
                assert!((r.velocity - before.velocity).abs() <= 4.0 * h * 2.0 + 1e-12);
                assert!(r.position.abs() <= target.abs() + 1e-9, "{target}: {r:?}");
                if there {
                    break;
                }
                steps += 1;
                assert!(steps < 10_000, "{target}: {r:?}");
            }
            assert_eq!(r, Reference { position: target, velocity: 0.0 });
        }
    }

    #[test]
    fn a_cruise_stops_at_its_limit() {
        let mut r = Reference::default();
        let free = (0..2000).map(|_| r.cruise(1e-3, 0.5, 2.0, [-0.4, 0.4])).filter(|free| !free).count();
        assert!(free > 100 && r.position <= 0.4 + 1e-3 && r.position > 0.39, "{r:?}");
    }

    #[test]
    fn the_spline_is_smooth_and_follows_a_line() {
        let period = 5e-3;
        let points = [0.2, 0.21, 0.23, 0.2];
        let end = spline(points, 1.0, period);
        let start = spline([0.21, 0.23, 0.2, 0.4], 0.0, period);
        approx::assert_relative_eq!(end.position, start.position, max_relative = 1e-12);
        approx::assert_relative_eq!(end.velocity, start.velocity, max_relative = 1e-9);
        let line = |phase| spline([0.0, 0.01, 0.02, 0.03], phase, period);
        for phase in [0.0, 0.3, 1.0] {
            approx::assert_relative_eq!(line(phase).velocity, 2.0, max_relative = 1e-12);
            approx::assert_relative_eq!(line(phase).position, 0.01 * (1.0 + phase), max_relative = 1e-12);
        }
    }
}
