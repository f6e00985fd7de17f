//! The objects that are read from and written to each drive before it may move, as lists without allocation.

use super::demand::ControlMode;
use super::profile::{ModeProfile, Profile};
use crate::canopen::client::Value;
use crate::canopen::objects::{
    CONSUMER_HEARTBEAT, DEVICE_TYPE, PRODUCER_HEARTBEAT, PRODUCT_CODE, REVISION, SERIAL_NUMBER, VENDOR_ID,
    rpdo_mapping, rpdo_parameter, tpdo_mapping, tpdo_parameter,
};
use crate::canopen::pdo::{EVERY_SYNC, INVALID, Mapping};
use crate::canopen::{Cob, NodeId, Object};
use crate::cia402::{objects, schunk};

/// One write, and how it is verified.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Write {
    pub(super) object: Object,
    number: i64,
    size: u8,
    /// Bits that must read back as written; 0 where a later write, or nothing, settles it.
    pub(super) verify: u32,
}

impl Write {
    const fn new(object: Object, number: i64, size: u8) -> Write {
        let verify = match size {
            1 => 0xFF,
            2 => 0xFFFF,
            _ => u32::MAX,
        };
        Write { object, number, size, verify }
    }

    const fn interim(object: Object, number: i64, size: u8) -> Write {
        Write { verify: 0, ..Write::new(object, number, size) }
    }

    /// A COB-ID of a PDO: of what reads back, the identifier and the invalid bit count; the others are the
    /// drive's affair.
    const fn cob(object: Object, number: u32) -> Write {
        Write { verify: INVALID | 0x7FF, ..Write::new(object, number as i64, 4) }
    }

    pub(super) fn value(&self) -> Value {
        Value::number(self.number, usize::from(self.size))
    }

    /// The bits that must read back.
    pub(super) fn expected(&self) -> u32 {
        self.number as u32 & self.verify
    }

    /// For a setting that a drive need not have: a bit by which it is known. What declines it is watched by
    /// the driver alone.
    pub(super) fn optional(&self) -> Option<u8> {
        match self.object {
            objects::FOLLOWING_ERROR_WINDOW => Some(1),
            objects::FOLLOWING_ERROR_TIME => Some(2),
            _ => None,
        }
    }

    /// Whether the drive's watching of the master depends on it.
    pub(super) fn is_watch(&self) -> bool {
        self.object == CONSUMER_HEARTBEAT || self.object == schunk::SYNC_TIMEOUT_FACTOR
    }
}

/// Sub-objects of one PDO.
struct Pdo {
    number: u8,
    cob: u16,
    parameter: fn(u8, u8) -> Object,
    mapping: fn(u8, u8) -> Object,
}

impl Pdo {
    fn receive(number: u8, node: NodeId) -> Pdo {
        Pdo { number, cob: Cob::Rpdo(number, node).id(), parameter: rpdo_parameter, mapping: rpdo_mapping }
    }

    fn transmit(number: u8, node: NodeId) -> Pdo {
        Pdo { number, cob: Cob::Tpdo(number, node).id(), parameter: tpdo_parameter, mapping: tpdo_mapping }
    }

    /// Switches a PDO off, maps it again and switches it on, in the order that CiA 301 requires; an empty one
    /// is only switched off.
    fn configure(self, mapping: Mapping) -> impl Iterator<Item = Write> {
        let Pdo { number, cob, parameter, mapping: mapped } = self;
        let used = !mapping.is_empty();
        let off = u32::from(cob) | INVALID;
        let off = Write { verify: if used { 0 } else { INVALID }, ..Write::cob(parameter(number, 1), off) };
        let count = mapping.entries().len();
        let entries = (0..count).filter_map(move |k| {
            let entry = mapping.entries().get(k)?;
            Some(Write::new(mapped(number, k as u8 + 1), i64::from(entry.to_u32()), 4))
        });
        let behind = [
            Write::new(mapped(number, 0), count as i64, 1),
            Write::new(parameter(number, 2), i64::from(EVERY_SYNC), 1),
            Write::cob(parameter(number, 1), u32::from(cob)),
        ];
        [off, Write::interim(mapped(number, 0), 0, 1)]
            .into_iter()
            .take(if used { 2 } else { 1 })
            .chain(entries)
            .chain(behind.into_iter().filter(move |_| used))
    }
}

/// All that is written to joint `j` in a mode, in order.
pub(super) fn configuration<const N: usize>(
    profile: &Profile<N>,
    mode: &ModeProfile,
    control: ControlMode,
    j: usize,
) -> impl Iterator<Item = Write> {
    let joint = profile.joints.get(j).copied();
    let (tpdos, rpdo) = (profile.tpdos, mode.rpdo);
    let watch = i64::from(profile.master.raw()) << 16 | i64::from(profile.master_watch_ms);
    let (period, exponent) = profile.interpolation_period().unwrap_or((0, -3));
    let sync_timeout = profile
        .sync_timeout_factor
        .map(|cycles| Write::new(schunk::SYNC_TIMEOUT_FACTOR, i64::from(cycles), 1));
    let general = [
        Some(Write::new(CONSUMER_HEARTBEAT, watch, 4)),
        sync_timeout,
        Some(Write::new(PRODUCER_HEARTBEAT, i64::from(profile.node_heartbeat_ms), 2)),
        Some(Write::new(objects::INTERPOLATION_PERIOD, i64::from(period), 1)),
        Some(Write::new(objects::INTERPOLATION_PERIOD_EXPONENT, i64::from(exponent), 1)),
    ];
    let mode_code = i64::from(mode.mode.code());
    joint.into_iter().flat_map(move |joint| {
        let node = joint.node;
        let receive = (1..=2u8).flat_map(move |k| {
            let mapping = if k == 1 { rpdo } else { Mapping::EMPTY };
            Pdo::receive(k, node).configure(mapping)
        });
        let transmit =
            (1u8..).zip(tpdos).flat_map(move |(k, mapping)| Pdo::transmit(k, node).configure(mapping));
        let counts = |value: f64| i64::from(joint.units.counts(value).value);
        let [a, b] = joint.position.map(counts);
        let limits = [
            Write::new(objects::POSITION_LIMIT_MIN, a.min(b), 4),
            Write::new(objects::POSITION_LIMIT_MAX, a.max(b), 4),
        ];
        let following_time = u64::from(profile.reactions.following_cycles) * profile.sync_period / 1000;
        let following = [
            Write::new(objects::FOLLOWING_ERROR_WINDOW, counts(joint.following_error).abs(), 4),
            Write::new(objects::FOLLOWING_ERROR_TIME, following_time as i64, 2),
        ];
        let profile_position = [
            Write::new(objects::PROFILE_VELOCITY, counts(joint.velocity).abs(), 4),
            Write::new(objects::PROFILE_ACCELERATION, counts(joint.acceleration).abs(), 4),
        ];
        let moves = control == ControlMode::ProfilePosition;
        let linear = control == ControlMode::InterpolatedPosition;
        receive
            .chain(transmit)
            .chain(general.into_iter().flatten())
            .chain(limits)
            .chain(following.into_iter().filter(move |_| control.is_position()))
            .chain(profile_position.into_iter().filter(move |_| moves))
            .chain(linear.then_some(Write::new(objects::INTERPOLATION_SUB_MODE, 0, 2)))
            .chain([Write::new(objects::MODE, mode_code, 1)])
    })
}

/// The objects that are read from each drive before anything is written, in order: device type, identity,
/// supported modes, scales.
pub(super) fn questions(mode: &ModeProfile, control: ControlMode) -> impl Iterator<Item = Object> {
    let identity = [DEVICE_TYPE, VENDOR_ID, PRODUCT_CODE, REVISION, SERIAL_NUMBER];
    let always = identity.into_iter().chain([objects::SUPPORTED_MODES, objects::RATED_CURRENT]);
    // The greatest current is per mille of the rated one, and so it is read after it.
    let always = always.chain([objects::MAX_CURRENT]);
    let velocity = [objects::VL_FACTOR_NUMERATOR, objects::VL_FACTOR_DENOMINATOR];
    let scaled = control == ControlMode::Velocity;
    // The target itself: a drive that has it not says so now, and not in the middle of its mapping.
    always.chain(velocity.into_iter().filter(move |_| scaled)).chain([mode.setpoint])
}

#[cfg(test)]
mod tests {
    use super::super::lwa4p::{DICTIONARY, LWA4P};
    use super::*;
    use crate::driver::dictionary;

    fn writes(control: ControlMode) -> Vec<Write> {
        configuration(&LWA4P, LWA4P.mode(control).unwrap(), control, 2).collect()
    }

    /// Every write but the current mode's goes to an object that the drive has, can be written, and is of
    /// that size.
    #[test]
    fn the_drives_dictionary_takes_the_configuration() {
        for control in ControlMode::ALL {
            for write in writes(control) {
                let entry = dictionary::find(DICTIONARY, write.object);
                // This drive has a window for the following error, and no time for it.
                if write.object == objects::FOLLOWING_ERROR_TIME {
                    assert!(entry.is_none() && write.optional().is_some());
                    continue;
                }
                let entry = entry.unwrap_or_else(|| panic!("{}", write.object));
                assert!(entry.writable, "{}", write.object);
                assert_eq!(entry.data_type.size(), Some(usize::from(write.size)), "{}", write.object);
                assert!(write.verify == 0 || entry.readable, "{}", write.object);
            }
        }
    }

    /// Mapping an active PDO is refused by drives: off, count 0, entries, count, type, on.
    #[test]
    fn a_pdo_is_off_while_it_is_mapped() {
        let writes = writes(ControlMode::InterpolatedPosition);
        let of = |index: u16| {
            writes.iter().filter(move |w| w.object.index == index || w.object.index == index + 0x200)
        };
        let order: Vec<(u16, u8, u32)> =
            of(0x1400).map(|w| (w.object.index, w.object.sub, w.number as u32)).collect();
        assert_eq!(
            order,
            [
                (0x1400, 1, 0x8000_0205),
                (0x1600, 0, 0),
                (0x1600, 1, 0x6040_0010),
                (0x1600, 2, 0x60C1_0120),
                (0x1600, 0, 2),
                (0x1400, 2, 1),
                (0x1400, 1, 0x205),
            ]
        );
        assert_eq!(of(0x1401).map(|w| w.number as u32).collect::<Vec<_>>(), [0x8000_0305]);
    }

    #[test]
    fn the_drives_watch_the_master_and_know_the_period() {
        let writes = writes(ControlMode::Velocity);
        let number = |object| writes.iter().find(|w| w.object == object).map(|w| w.number);
        assert_eq!(number(CONSUMER_HEARTBEAT), Some(0x0001_0064));
        assert_eq!(number(schunk::SYNC_TIMEOUT_FACTOR), Some(6));
        assert_eq!(number(objects::INTERPOLATION_PERIOD), Some(5));
        assert_eq!(number(objects::POSITION_LIMIT_MAX), Some(154_985));
    }
}
