//! Joints' positions and torques from the process data of an arm that another master drives. Nothing is sent.

use super::profile::Profile;
use crate::canopen::cob::Cob;
use crate::canopen::pdo::sign_extend;
use crate::canopen::{Frame, NodeId};
use crate::cia402::objects;

/// All joints at one SYNC.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Heard<const N: usize> {
    /// Since the first SYNC that was heard, by the profile's period, s.
    pub t: f64,
    /// rad.
    pub position: [f64; N],
    /// N·m, by the profile's torque constants.
    pub torque: [f64; N],
}

/// Process data that has not the bytes that the profile's mapping has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OtherMapping {
    /// Who sent it.
    pub node: NodeId,
    /// The number of its transmit PDO.
    pub number: u8,
    /// Bytes received, and bytes of the mapping.
    pub bytes: [usize; 2],
}

impl core::fmt::Display for OtherMapping {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let [has, needs] = self.bytes;
        write!(
            f,
            "transmit PDO {} of node {} has {has} bytes, the profile's mapping {needs}: another master has \
            mapped it otherwise",
            self.number,
            self.node.raw()
        )
    }
}

/// Hears what the drives of a profile send.
#[derive(Clone, Debug)]
pub struct Listener<const N: usize> {
    profile: Profile<N>,
    syncs: Option<u64>,
    joints: [Option<[f64; 2]>; N],
}

impl<const N: usize> Listener<N> {
    /// For an arm with this profile.
    #[must_use]
    pub fn new(profile: Profile<N>) -> Self {
        Listener { profile, syncs: None, joints: [None; N] }
    }

    /// Takes a frame. A SYNC closes the cycle before it, which is given where all joints have sent; one
    /// without all is left out, and its time passes.
    ///
    /// # Errors
    /// Process data of another length than the profile's mapping.
    pub fn hear(&mut self, frame: &Frame) -> Result<Option<Heard<N>>, OtherMapping> {
        match Cob::of(frame) {
            Some(Cob::Sync) => Ok(self.close()),
            Some(Cob::Tpdo(number, node)) => self.take(number, node, frame).map(|()| None),
            _ => Ok(None),
        }
    }

    fn close(&mut self) -> Option<Heard<N>> {
        let cycle = self.syncs;
        self.syncs = Some(cycle.map_or(0, |k| k + 1));
        let joints = core::mem::replace(&mut self.joints, [None; N]);
        let (mut position, mut torque) = ([0.0; N], [0.0; N]);
        for ((joint, position), torque) in joints.iter().zip(&mut position).zip(&mut torque) {
            [*position, *torque] = (*joint)?;
        }
        // Data that came before the first SYNC belongs to none.
        Some(Heard { t: cycle? as f64 * self.profile.period_seconds(), position, torque })
    }

    fn take(&mut self, number: u8, node: NodeId, frame: &Frame) -> Result<(), OtherMapping> {
        let mapping = usize::from(number).checked_sub(1).and_then(|k| self.profile.tpdos.get(k));
        let known = self.profile.joints.iter().zip(&mut self.joints).find(|(joint, _)| joint.node == node);
        let (Some(mapping), Some((joint, last))) = (mapping, known) else { return Ok(()) };
        if !(mapping.contains(objects::POSITION) && mapping.contains(objects::TORQUE)) {
            return Ok(());
        }
        let bytes = [frame.bytes().len(), mapping.len()];
        let values = mapping.unpack(frame.bytes()).ok_or(OtherMapping { node, number, bytes })?;
        let mut now = [0.0; 2];
        for (entry, raw) in values {
            let signed = sign_extend(raw, entry.bits);
            match entry.object {
                objects::POSITION => now[0] = joint.units.position(signed),
                objects::TORQUE => now[1] = joint.units.torque(signed),
                _ => {}
            }
        }
        *last = Some(now);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::driver::lwa4p::LWA4P;

    fn tpdo(node: u8, torque: i16, position: i32) -> Frame {
        let mut bytes = [0u8; 8];
        bytes[2..4].copy_from_slice(&torque.to_le_bytes());
        bytes[4..8].copy_from_slice(&position.to_le_bytes());
        Frame::from_raw(0x180 + u16::from(node), &bytes).unwrap()
    }

    fn sync() -> Frame {
        Frame::from_raw(0x80, &[]).unwrap()
    }

    #[test]
    fn a_cycle_counts_where_all_joints_have_sent_and_its_time_is_that_of_its_sync() {
        let mut listener = Listener::new(LWA4P);
        let cycle = |listener: &mut Listener<6>, nodes: std::ops::RangeInclusive<u8>| {
            for node in nodes {
                // 90°, and the rated current backwards.
                assert_eq!(listener.hear(&tpdo(node, -1000, 90_000)), Ok(None));
            }
            listener.hear(&sync()).unwrap()
        };
        // Before the first SYNC.
        assert_eq!(cycle(&mut listener, 3..=8), None);
        let heard = cycle(&mut listener, 3..=8).unwrap();
        assert!((heard.position[5] - std::f64::consts::FRAC_PI_2).abs() < 1e-9 && heard.t == 0.0);
        assert_eq!(heard.torque[0], -LWA4P.joints[0].units.rated_torque);
        assert_eq!(cycle(&mut listener, 3..=7), None, "a joint is missing");
        assert_eq!(cycle(&mut listener, 3..=8).unwrap().t, 2.0 * LWA4P.period_seconds());
    }

    #[test]
    fn another_mapping_is_an_error_and_other_frames_are_nothing() {
        let mut listener = Listener::new(LWA4P);
        let short = Frame::from_raw(0x183, &[1, 2, 3, 4]).unwrap();
        let other = listener.hear(&short).unwrap_err();
        assert_eq!((other.node.raw(), other.bytes), (3, [4, 8]));
        assert!(other.to_string().contains("node 3 has 4 bytes"));
        for id in [0x701, 0x19F, 0x283, 0x5FF] {
            assert_eq!(listener.hear(&Frame::from_raw(id, &[0]).unwrap()), Ok(None), "{id:x}");
        }
    }
}
