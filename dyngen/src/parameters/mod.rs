//! Parameter sets as values: the sums of a set's parameters, and how they enter the dynamics. The sets of an
//! arm are found later, from its Lagrangian.

pub mod span;

use crate::arm::Parameter;
use crate::exact::constant::{Constant, ConstantField};
use crate::exact::elimination::Dependence;
use std::collections::BTreeMap;
use std::fmt;

/// Which parameter set.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum SetKind {
    /// Every parameter that the declared symmetries leave.
    Full,
    /// Exact for the numbers in the file: as many as the rank.
    Minimal,
    /// Exact for every size of the arm: lengths and ratios are variables. Pins of bars are numbers.
    Symbolic,
    /// The file's `[[grouping]]`.
    Published,
}

impl SetKind {
    /// All four.
    pub const ALL: [SetKind; 4] = [SetKind::Full, SetKind::Minimal, SetKind::Symbolic, SetKind::Published];

    /// The name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            SetKind::Full => "full",
            SetKind::Minimal => "minimal",
            SetKind::Symbolic => "symbolic",
            SetKind::Published => "published",
        }
    }

    /// The set of that name.
    pub fn parse(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }
}

impl fmt::Display for SetKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// A linear combination of the arm's parameters.
pub type Combination = Vec<(Parameter, Constant)>;

/// One parameter of a set.
#[derive(Clone, Debug)]
pub struct SetParameter {
    /// The sum of the parameter as text, or the name in the publication.
    pub name: String,
    /// The sum of the parameter.
    pub terms: Combination,
    /// How it enters the dynamics: the inertial parameters that carry its value when all others are zero.
    pub carriers: Combination,
}

/// A parameter set with what is known exactly of it.
#[derive(Clone, Debug)]
pub struct ParameterSet {
    /// Which one.
    pub kind: SetKind,
    /// The set's parameters, in order.
    pub parameters: Vec<SetParameter>,
    /// The rank of its columns for the numbers in the file.
    pub rank: usize,
    /// The linear relations that hold between its columns for the numbers in the file, one text each.
    pub relations: Vec<String>,
    /// Whether the torque stays the same when all parameters are replaced by the set's sums.
    pub exact: bool,
    /// If the set is not exact: the parameters that the sums lose, and the reason.
    pub lost: Vec<(Parameter, String)>,
}

impl ParameterSet {
    /// The names, in order.
    pub fn names(&self) -> Vec<String> {
        self.parameters.iter().map(|p| p.name.clone()).collect()
    }
}

/// A combination of parameters in coordinates of the minimal columns.
pub fn minimal_coordinates(
    field: &ConstantField,
    minimal: &Dependence,
    combination: &[(Parameter, Constant)],
) -> Vec<(usize, Constant)> {
    let mut sum: BTreeMap<usize, Constant> = BTreeMap::new();
    for (parameter, factor) in combination {
        for (position, coordinate) in &minimal.coordinates[parameter.index()] {
            let term = field.mul(factor, coordinate);
            let total = match sum.get(position) {
                Some(old) => field.add(old, &term),
                None => term,
            };
            sum.insert(*position, total);
        }
    }
    sum.into_iter().filter(|(_, c)| !c.is_zero()).collect()
}
