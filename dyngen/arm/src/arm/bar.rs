//! Bodies of closed loops that are no links of the chain: their bars.

use super::linkage::{Hinge, Linkage};
use super::{Arm, ParameterKind};
use crate::exact::rational::Rational;
use std::fmt;

/// A bar of a closed loop. One of its pins is a point of a link. In a parallelogram it turns with another
/// link: its frame has the axes of that one's frame, and its origin at the pin. In another loop of four bars
/// it turns on the link that carries its pin: its frame has x along the bar and z along the joint's axis.
///
/// So its pose is known without a coordinate of its own, and no force between the bars does any work: its
/// weight and inertia act at the pin, on the link that it turns with and on the joint that turns it.
#[derive(Clone, PartialEq)]
pub struct Bar {
    /// The bar's name.
    pub name: String,
    /// The link that carries its pin, from 0; `None` is the base.
    pub carrier: Option<usize>,
    /// The pin in that link's frame, m.
    pub pin: [Rational; 3],
    /// The link that it turns with, from 0; `None` is the base. It is the one that carries its pin where it
    /// has a hinge.
    pub parallel: Option<usize>,
    /// How it turns on that link, where it is no bar of a parallelogram.
    pub hinge: Option<Hinge>,
    /// Inertial parameters that are declared zero.
    pub zero: Vec<ParameterKind>,
}

/// What the file does not say is left out, as for [`Arm`].
impl fmt::Debug for Bar {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut text = f.debug_struct("Bar");
        text.field("name", &self.name)
            .field("carrier", &self.carrier)
            .field("pin", &self.pin)
            .field("parallel", &self.parallel);
        if let Some(hinge) = &self.hinge {
            text.field("hinge", hinge);
        }
        text.field("zero", &self.zero).finish()
    }
}

impl Arm {
    /// The number of bodies: the links of the chain, then the bars.
    pub fn bodies(&self) -> usize {
        self.links() + self.bars.len()
    }

    /// The bar of a body, from 0 in the order of the parameters; `None` for a link of the chain.
    pub fn bar(&self, body: usize) -> Option<&Bar> {
        self.bars.get(body.checked_sub(self.links())?)
    }

    /// A body in words: `link 3`, or a bar by its name.
    pub fn body_name(&self, body: usize) -> String {
        self.bar(body).map_or_else(|| format!("link {}", body + 1), |bar| format!("bar {}", bar.name))
    }

    /// The last joint that moves a body, from 0: a link's own, and of a bar that of the links that it hangs
    /// on. `None` where none does.
    pub fn last_joint(&self, body: usize) -> Option<usize> {
        let of_bar = |bar: &Bar| {
            let hinge = bar.hinge.as_ref().map(|hinge| hinge.linkage.joint);
            bar.carrier.max(bar.parallel).max(hinge)
        };
        self.bar(body).map_or(Some(body), of_bar)
    }

    /// The linkages of its loops that are no parallelograms, each once.
    pub fn linkages(&self) -> impl Iterator<Item = &Linkage> {
        let hinges = self.bars.iter().filter_map(|bar| bar.hinge.as_ref());
        hinges.filter(|hinge| !hinge.rocker).map(|hinge| &hinge.linkage)
    }

    /// The parameters of a body that are declared zero.
    ///
    /// # Panics
    /// If the arm has no such body.
    pub fn declared_zero_mut(&mut self, body: usize) -> &mut Vec<ParameterKind> {
        let links = self.links();
        match body.checked_sub(links) {
            None => &mut self.joints[body].zero,
            Some(bar) => &mut self.bars[bar].zero,
        }
    }

    /// For whoever takes an arm to be a chain alone.
    ///
    /// # Errors
    /// Which bars it has.
    pub fn without_bars(&self, who: &str) -> Result<(), String> {
        if self.bars.is_empty() {
            return Ok(());
        }
        let names = self.bar_names();
        Err(format!("{who} knows no bars of closed loops: the arm file's [[loop]] has {names}"))
    }

    /// The names of its bars, for messages.
    pub fn bar_names(&self) -> String {
        self.bars.iter().map(|bar| format!("'{}'", bar.name)).collect::<Vec<_>>().join(", ")
    }
}
