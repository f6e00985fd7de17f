//! The TOML that goes with the DCF: data of the arm that the drive's file does not have.

use crate::canopen::Object;
use serde::Deserialize;
use std::collections::BTreeMap;

/// `powerball/lwa4p_bus.toml` and its like.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Arm {
    /// Name of the arm.
    pub name: String,
    /// bit/s.
    pub bitrate: u32,
    /// SYNC, Hz.
    pub rate: u32,
    /// Node id of the master.
    pub master: u8,
    /// Who watches whom.
    pub watch: Watch,
    /// Transmit PDOs by number: what the drives send each SYNC.
    pub transmit: BTreeMap<String, Vec<Mapped>>,
    /// Modes by name: `profile_position`, `velocity`, `interpolated_position`, `current`; those that the
    /// drive has not are left out.
    pub mode: BTreeMap<String, ModeTable>,
    /// Scale of mode VL, where it is among the modes.
    pub velocity_scale: Option<VelocityScaleTable>,
    /// The joints from the base on.
    pub joint: Vec<JointTable>,
}

/// Who watches whom; see [`super::super::Profile`].
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Watch {
    /// Period of the master's heartbeat.
    pub master_heartbeat_ms: u64,
    /// 0x1016.
    pub master_watch_ms: u16,
    /// 0x200E; left out for drives of another maker than SCHUNK.
    pub sync_timeout_factor: Option<u8>,
    /// 0x1017.
    pub node_heartbeat_ms: u16,
}

/// One mode.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModeTable {
    /// Number in 0x6060.
    pub mode: i8,
    /// The receive PDO.
    pub receive: Vec<Mapped>,
    /// Which of it is the set-point.
    pub setpoint: Mapped,
    /// Whether it was seen to work on the arm.
    pub verified_on_hardware: bool,
}

/// Scale of mode VL; see [`super::super::units::VelocityScale`].
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VelocityScaleTable {
    /// 0x604C:1.
    pub numerator: i32,
    /// 0x604C:2.
    pub denominator: i32,
    /// Velocity of one count, in thousandths of a degree per second.
    pub millidegrees_per_second: f64,
    /// Whether it was seen on the arm.
    pub verified_on_hardware: bool,
}

/// One joint; see [`super::super::JointProfile`].
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct JointTable {
    /// Node id of its drive.
    pub node: u8,
    /// rad.
    pub position: [f64; 2],
    /// rad/s.
    pub velocity: f64,
    /// rad/s².
    pub acceleration: f64,
    /// Greatest torque, N·m; not guarded where it is left out.
    #[serde(default = "unlimited")]
    pub torque: f64,
    /// N·m at the rated current.
    pub rated_torque: f64,
    /// Whether `rated_torque` was measured on this arm.
    #[serde(default)]
    pub torque_verified: bool,
    /// A, where the drive's 0x6075 reads 0.
    #[serde(default)]
    pub rated_current: f64,
    /// Greatest current, A.
    pub current: f64,
    /// Greatest following error, rad.
    #[serde(default = "following_error")]
    pub following_error: f64,
    /// Greatest velocity error, rad/s.
    #[serde(default = "velocity_error")]
    pub velocity_error: f64,
    /// Counts in a degree; negative where the drive counts against the joint. Where it is left out it is
    /// taken from 0x608F, 0x6091 and 0x6092 of the drive's file.
    pub counts_per_degree: Option<f64>,
    /// 0x1018:1; where it is left out, VendorNumber of the drive's file.
    pub vendor: Option<u32>,
    /// 0x1018:2, where it is known.
    pub product: Option<u32>,
    /// 0x1018:3, where it is known.
    pub revision: Option<u32>,
    /// 0x1018:4, where it is known.
    pub serial: Option<u32>,
}

fn unlimited() -> f64 {
    f64::INFINITY
}

fn following_error() -> f64 {
    0.05
}

fn velocity_error() -> f64 {
    0.3
}

/// `"6041"`, `"60C1:1"`, or with bits `"6071/16"` where the DCF does not know the object.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(try_from = "String")]
pub struct Mapped {
    /// Which object.
    pub object: Object,
    /// The object's bits, where given.
    pub bits: Option<u8>,
}

impl TryFrom<String> for Mapped {
    type Error = String;

    fn try_from(text: String) -> Result<Mapped, String> {
        let wrong =
            || format!("\"{text}\" is not an object; \"6041\", \"60C1:1\" or \"6071/16\" are expected");
        let (address, bits) = match text.split_once('/') {
            Some((address, bits)) => (address, Some(bits.parse().map_err(|_| wrong())?)),
            None => (text.as_str(), None),
        };
        let (index, sub) = address.split_once(':').unwrap_or((address, "0"));
        let index = u16::from_str_radix(index.trim_start_matches("0x"), 16).map_err(|_| wrong())?;
        let sub = sub.parse().map_err(|_| wrong())?;
        Ok(Mapped { object: Object::new(index, sub), bits })
    }
}
