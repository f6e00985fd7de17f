//! The effects that a torque model may lack: one file for each effect, all behind one trait.
//!
//! **The input of an effect** is its [`Context`]: the logs as rows, the model fitted so far, its residual,
//! and the thresholds of the rule. An effect does not depend on other effects, on the search or on results.
//! These use an effect through [`Effect`], never by its name.
//!
//! **How a log row becomes a column**: [`Effect::columns`] takes the logs of a context and gives, for each
//! coefficient of a [`Candidate`], one value for each row of the regression. Where the effect is a torque of
//! one joint, its [`Effect::laws`] are enough: the same laws run in a controller.
//!
//! **Adding an effect** means adding a file with three types: its `Settings` (which a search varies), its
//! `Figures` (the numbers and words of a result) and a unit struct that implements [`Effect`]; and naming
//! that file below, once as a module and once in the list. The list is in the order in which equals are
//! preferred.

pub mod asymmetry;
pub mod backlash;
pub mod base_tilt;
pub mod broken_symmetry;
mod candidate;
pub mod contact_wrench;
mod context;
mod effect;
pub mod encoder_offset;
pub mod friction_by_position;
pub mod hysteresis;
pub mod joint_coupling;
pub mod joint_elasticity;
mod link_body;
pub mod load_friction;
mod made;
pub mod payload;
pub mod position_ripple;
pub mod spring;
pub mod stribeck;
pub mod temperature;
pub mod time_delay;
pub mod torque_constant;
pub mod unnamed_law;
pub mod velocity_nonlinearity;
mod windows;
pub mod words;

pub use candidate::{Axis, ByJoint, Candidate, Found, Window};
pub use context::Context;
pub(crate) use context::{PASSES, SOFT, each_instant, move_link};
pub use effect::{Class, Effect, Part, Placed};
pub(crate) use made::Made;
pub(crate) use windows::mask;

/// Makes of the list of effects what must know all of them: [`Settings`], [`Figures`] and [`all`].
macro_rules! library {
    ($($module:ident::$Effect:ident),* $(,)?) => {
        /// The settings of a candidate, which also determine the effect it belongs to.
        #[derive(Clone, Debug, PartialEq)]
        pub enum Settings {
            $(#[doc = concat!("Of [`", stringify!($module), "`].")] $Effect($module::Settings),)*
        }

        /// The physical reading of an effect, in SI units; as JSON an object of its figures.
        #[derive(Clone, Debug, PartialEq, serde::Serialize)]
        #[serde(untagged)]
        pub enum Figures {
            $(#[doc = concat!("Of [`", stringify!($module), "`].")] $Effect($module::Figures),)*
        }

        impl Figures {
            /// The figures in words, with units.
            #[must_use]
            pub fn in_words(&self, words: &words::Words<'_>) -> String {
                match self {
                    $(Figures::$Effect(figures) => figures.in_words(words),)*
                }
            }
        }

        impl Settings {
            /// The effect whose settings these are.
            #[must_use]
            pub fn effect(&self) -> &'static dyn Effect {
                match self {
                    $(Settings::$Effect(_) => &$module::$Effect,)*
                }
            }
        }

        $(
            impl From<$module::Settings> for Settings {
                fn from(settings: $module::Settings) -> Settings {
                    Settings::$Effect(settings)
                }
            }

            impl $module::Settings {
                /// The settings of a candidate of this effect; `None` for another effect's.
                #[must_use]
                pub fn of(candidate: &Candidate) -> Option<&Self> {
                    match &candidate.settings {
                        Settings::$Effect(settings) => Some(settings),
                        _ => None,
                    }
                }
            }

            impl From<$module::Figures> for Figures {
                fn from(figures: $module::Figures) -> Figures {
                    Figures::$Effect(figures)
                }
            }
        )*

        static ALL: &[&dyn Effect] = &[$(&$module::$Effect),*];
    };
}

library! {
    load_friction::LoadFriction,
    stribeck::Stribeck,
    velocity_nonlinearity::VelocityNonlinearity,
    asymmetry::Asymmetry,
    hysteresis::Hysteresis,
    friction_by_position::FrictionByPosition,
    payload::Payload,
    spring::Spring,
    position_ripple::PositionRipple,
    temperature::Temperature,
    time_delay::TimeDelay,
    torque_constant::TorqueConstant,
    encoder_offset::EncoderOffset,
    base_tilt::BaseTilt,
    broken_symmetry::BrokenSymmetry,
    contact_wrench::ContactWrench,
    joint_coupling::JointCoupling,
    backlash::Backlash,
    joint_elasticity::JointElasticity,
    unnamed_law::UnnamedLaw,
}

/// Every effect, in the order in which equals are preferred.
#[must_use]
pub fn all() -> &'static [&'static dyn Effect] {
    ALL
}
