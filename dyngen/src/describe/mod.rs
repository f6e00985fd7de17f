//! What is known of an arm, as `dyngen describe --json` prints it.

mod bounds;
mod weak;

pub use bounds::{ParameterRange, Rounding, poses_of, why_unbounded};
pub use weak::Weak;

use crate::arm::{Arm, Bar, Joint, Transmission};
use crate::base::sets::{Class, combination_text};
use crate::base::symmetry::{self, Removed, Symmetry};
use crate::dynamics::{Function, FunctionGraph};
use crate::exact::rational;
use crate::graph::{Operations, Preparation};
use crate::model::{Error, Model};
use crate::parameters::{ParameterSet, SetKind};
use crate::rounding::Bounder;
use serde_json::{Map, Value, json};
use std::num::NonZero;
use std::sync::atomic::{AtomicUsize, Ordering};

/// What is known of an arm in addition to its sets: what its functions cost and what its symmetries removed.
#[derive(Clone, Debug)]
pub struct Description {
    /// What each function costs with the minimal set as arguments; last, as `prepare`, what all of them
    /// together need of the parameters alone.
    pub operations: Vec<(&'static str, Operations)>,
    /// What each declared symmetry removed.
    pub symmetries: Vec<Symmetry>,
    /// Sums of the minimal set that torques hardly show, the weakest first.
    pub weak: Vec<Weak>,
    /// By how much each function may be off; none where the arm file gives no limits.
    pub rounding: Option<Rounding>,
}

/// For what code and for which numbers rounding is bounded.
#[derive(Clone, Copy, Debug, Default)]
pub struct BoundsFor<'v> {
    /// Values of the minimal set; without them each parameter is within ±1 SI unit.
    pub values: Option<&'v [f64]>,
    /// Values of the full set, where they are known.
    pub links: Option<&'v [f64]>,
    /// Whether products are formed within sums.
    pub contracted: bool,
}

impl Description {
    /// Builds and proves every function to count its operations.
    ///
    /// # Errors
    /// As [`Model::function`].
    pub fn of(model: &Model) -> Result<Description, Error> {
        Description::with_progress(model, BoundsFor::default(), |_| {})
    }

    /// As [`Self::of`], with progress reported and bounds of rounding for what is given.
    ///
    /// # Errors
    /// As [`Model::function`].
    pub fn with_progress(
        model: &Model,
        BoundsFor { values, links, contracted }: BoundsFor<'_>,
        say: impl Fn(&str),
    ) -> Result<Description, Error> {
        let mut preparation = Preparation::default();
        let mut operations = Vec::new();
        let mut rounding = Rounding::of(model.arm(), values, contracted);
        let functions: Vec<Function> = model.functions(SetKind::Minimal).collect();
        let bounded = rounding.is_some();
        let bounder = Bounder::new(model, values).with_links(links);
        let of = |function: Function| {
            let built = FunctionGraph { contracted, ..model.function(function, SetKind::Minimal)? };
            let bounds = bounded.then(|| bounder.bounds(&built));
            Ok::<_, Error>((built, bounds))
        };
        say(&format!("proving {} functions", functions.len()));
        for found in on_every_core(&functions, of) {
            let (built, bounds) = found?;
            if let (Some(rounding), Some(bounds)) = (&mut rounding, bounds) {
                rounding.functions.push((built.function, bounds));
            }
            operations
                .push((built.function.name(), built.without_preparation(&mut preparation).operations()));
        }
        operations.push(("prepare", preparation.operations()));
        say("parameters that hardly show");
        let weak = weak::weak(model)?;
        let symmetries = symmetry::symmetries(model.arm(), model.sets())?;
        Ok(Description { operations, symmetries, weak, rounding })
    }

    /// One JSON object of all that is known of a model's arm.
    pub fn json(&self, model: &Model) -> Value {
        let arm = model.arm();
        let kept = arm.kept_parameters();
        let names: Vec<String> = kept.iter().map(ToString::to_string).collect();
        let of_class = |class: Class| -> Vec<String> {
            kept.iter().filter(|p| model.sets().class(**p) == class).map(ToString::to_string).collect()
        };
        let hardly = |w: &Weak| json!({"singular_value": w.singular_value, "parameters": w.parameters});
        let operations: Map<String, Value> = self
            .operations
            .iter()
            .map(|(f, o)| {
                let mut counts = json!({"mul": o.mul, "add": o.add, "div": o.div, "sin_cos": o.sin_cos});
                if o.sqrt > 0 {
                    counts["sqrt"] = o.sqrt.into();
                }
                ((*f).to_string(), counts)
            })
            .collect();
        let choice: Vec<Value> = (model.sets().candidates.iter())
            .map(|c| json!({"rule": c.preference.to_string(), "operations": c.operations}))
            .collect();
        let mut object = json!({
            "arm": arm.name,
            "joints": arm.dof(),
            "joint_names": arm.joint_names(),
            "mimics": mimics_json(arm),
            "bars": bars_json(arm),
            "transmissions": arm.transmissions.iter().map(transmission_json).collect::<Vec<_>>(),
            "parameters": names,
            "sets": sets_json(model),
            "unidentifiable": of_class(Class::Unidentifiable),
            "identifiable_alone": of_class(Class::Alone),
            "identifiable_in_combination": of_class(Class::InCombination),
            "hardly_identifiable": self.weak.iter().map(hardly).collect::<Vec<_>>(),
            "operations": operations,
            "choice": choice,
            "symmetries": self.symmetries.iter().map(|s| symmetry_json(model, s)).collect::<Vec<_>>(),
            "notes": arm.notes(),
        });
        if let Some(rounding) = &self.rounding {
            object["rounding"] = rounding.json();
            if rounding.contracted {
                object["contract"] = json!(true);
            }
            object["rounding_parameters"] = json!(rounding.parameters.text());
        }
        object
    }
}

/// What a computation gives for each item, in their order, on as many threads as there are cores.
fn on_every_core<T: Copy + Sync, R: Send>(items: &[T], of: impl Fn(T) -> R + Sync) -> Vec<R> {
    let next = AtomicUsize::new(0);
    let work = || {
        let mine = std::iter::from_fn(|| {
            let k = next.fetch_add(1, Ordering::Relaxed);
            Some((k, of(*items.get(k)?)))
        });
        mine.collect::<Vec<_>>()
    };
    let cores = std::thread::available_parallelism().map_or(1, NonZero::get).min(items.len());
    let mut all: Vec<(usize, R)> = std::thread::scope(|scope| {
        let others: Vec<_> = (1..cores).map(|_| scope.spawn(work)).collect();
        let mut all = work();
        for other in others {
            all.extend(other.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)));
        }
        all
    });
    all.sort_by_key(|(k, _)| *k);
    all.into_iter().map(|(_, found)| found).collect()
}

/// The sets of a model by name, each with its parameters and the sums that they stand for.
pub fn sets_json(model: &Model) -> Value {
    let of = |set: &ParameterSet| (set.kind.name().to_string(), set_json(model, set));
    Value::Object(model.sets().sets.iter().map(of).collect())
}

/// Joints that follow others, from 1; ratio and offset as exact text.
fn mimics_json(arm: &Arm) -> Vec<Value> {
    let of = |(i, joint): (usize, &Joint)| {
        let mimic = joint.mimic.as_ref()?;
        let (ratio, offset) = (rational::to_text(&mimic.ratio), rational::to_text(&mimic.offset));
        let (joint, follows) = (i + 1, mimic.joint + 1);
        Some(json!({"joint": joint, "follows": follows, "ratio": ratio, "offset": offset}))
    };
    arm.joints.iter().enumerate().filter_map(of).collect()
}

/// Bars of closed loops: bodies, links and joints from 1, 0 is the base; the pin as exact text, m.
fn bars_json(arm: &Arm) -> Vec<Value> {
    let number = |link: Option<usize>| link.map_or(0, |link| link + 1);
    let of = |(bar, body): (&Bar, usize)| {
        let pin = bar.pin.each_ref().map(rational::to_text);
        let (link, parallel) = (number(bar.carrier), number(bar.parallel));
        match &bar.hinge {
            None => json!({"name": bar.name, "body": body, "link": link, "pin": pin, "parallel": parallel}),
            Some(hinge) => {
                let joint = hinge.linkage.joint + 1;
                json!({"name": bar.name, "body": body, "link": link, "pin": pin, "turned_by": joint})
            }
        }
    };
    arm.bars.iter().zip(arm.links() + 1..).map(of).collect()
}

/// Joints from 1; the matrix as exact text.
fn transmission_json(block: &Transmission) -> Value {
    let joints: Vec<usize> = block.joints.iter().map(|j| j + 1).collect();
    json!({"joints": joints, "matrix": exact_rows(block)})
}

/// The matrix of a transmission as exact text.
pub fn exact_rows(block: &Transmission) -> Vec<Vec<String>> {
    block.matrix.iter().map(|row| row.iter().map(rational::to_text).collect()).collect()
}

fn symmetry_json(model: &Model, symmetry: &Symmetry) -> Value {
    let (removed, equals) = match &symmetry.removed {
        Removed::Nothing => ("nothing", None),
        Removed::BaseParameter => ("base parameter", None),
        Removed::Term(terms) => ("term", Some(combination_text(&model.sets().field, terms))),
    };
    json!({"parameter": symmetry.parameter.to_string(), "removed": removed, "equals": equals})
}

fn set_json(model: &Model, set: &ParameterSet) -> Value {
    let field = &model.sets().field;
    let parameters: Vec<Value> = set
        .parameters
        .iter()
        .map(|p| {
            let terms: Vec<Value> = p
                .terms
                .iter()
                .map(|(q, c)| {
                    let coefficient = field.text(c);
                    json!({"parameter": q.to_string(), "coefficient": coefficient, "value": field.value(c)})
                })
                .collect();
            json!({"name": p.name, "terms": terms})
        })
        .collect();
    let mut object = json!({
        "count": set.parameters.len(),
        "rank": set.rank,
        "exact": set.exact,
        "relations": set.relations,
        "parameters": parameters,
    });
    if !set.exact {
        object["lost"] =
            set.lost.iter().map(|(p, why)| json!({"parameter": p.to_string(), "why": why})).collect();
    }
    object
}
