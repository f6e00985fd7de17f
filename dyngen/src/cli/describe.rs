//! `dyngen describe`.

use super::digits::Digits;
use super::weak::{self, Weak};
use super::{Failure, Progress, model, print};
use dyngen::arm::{Convention, JointKind, Placement, Transmission};
use dyngen::base::choice;
use dyngen::base::sets::{Class, combination_text};
use dyngen::base::symmetry::{self, Removed, Symmetry};
use dyngen::base::{ParameterSet, SetKind};
use dyngen::exact::rational;
use dyngen::graph::{Operations, Preparation};
use dyngen::{Function, Model};
use serde_json::{Map, Value, json};
use std::fmt::Write;
use std::path::PathBuf;
use std::process::ExitCode;

#[derive(clap::Args)]
#[command(after_help = "Example: dyngen describe powerball/arm.toml")]
pub(super) struct Args {
    /// The arm file.
    arm: PathBuf,
    /// One JSON object on standard output.
    #[arg(long)]
    json: bool,
    /// Every digit of every number, in place of six; the JSON object has them all.
    #[arg(long)]
    exact: bool,
}

pub(super) fn run(args: &Args) -> Result<ExitCode, Failure> {
    let model = model(&args.arm)?;
    let progress = Progress::new(model.arm());
    let mut preparation = Preparation::default();
    let mut operations: Vec<(&str, Operations)> = Function::ALL
        .into_iter()
        .map(|function| {
            progress.say(&format!("proving {function}"));
            let built = model.function(function, SetKind::Minimal).map_err(Failure::refused)?;
            let built = built.without_preparation(&mut preparation);
            Ok((function.name(), built.operations()))
        })
        .collect::<Result<_, Failure>>()?;
    // What every function together needs of the parameters alone.
    operations.push(("prepare", preparation.operations()));
    progress.say("parameters that hardly show");
    let weak = weak::weak(&model).map_err(Failure::refused)?;
    drop(progress);
    let symmetries = symmetry::symmetries(model.arm(), model.sets()).map_err(Failure::refused)?;
    let text = match args.json {
        true => format!("{}\n", json_text(&model, &operations, &symmetries, &weak)),
        false => {
            let digits = if args.exact { Digits::All } else { Digits::Six };
            table(&model, &operations, &symmetries, &weak, digits)
        }
    };
    print(&text)?;
    Ok(ExitCode::SUCCESS)
}

fn json_text(
    model: &Model,
    operations: &[(&str, Operations)],
    symmetries: &[Symmetry],
    weak: &[Weak],
) -> Value {
    let hardly = |w: &Weak| json!({"singular_value": w.singular_value, "parameters": w.parameters});
    let arm = model.arm();
    let kept = arm.kept_parameters();
    let names: Vec<String> = kept.iter().map(ToString::to_string).collect();
    let of_class = |class: Class| -> Vec<String> {
        kept.iter().filter(|p| model.sets().class(**p) == class).map(ToString::to_string).collect()
    };
    let mut sets = Map::new();
    for set in &model.sets().sets {
        sets.insert(set.kind.name().to_string(), set_json(model, set));
    }
    let operations: Map<String, Value> = operations
        .iter()
        .map(|(f, o)| {
            ((*f).to_string(), json!({"mul": o.mul, "add": o.add, "div": o.div, "sin_cos": o.sin_cos}))
        })
        .collect();
    let choice: Vec<Value> = (model.sets().candidates.iter())
        .map(|c| json!({"rule": c.preference.to_string(), "operations": c.operations}))
        .collect();
    json!({
        "arm": arm.name,
        "joints": arm.dof(),
        "joint_names": arm.joint_names(),
        "transmissions": arm.transmissions.iter().map(transmission_json).collect::<Vec<_>>(),
        "parameters": names,
        "sets": sets,
        "unidentifiable": of_class(Class::Unidentifiable),
        "identifiable_alone": of_class(Class::Alone),
        "identifiable_in_combination": of_class(Class::InCombination),
        "hardly_identifiable": weak.iter().map(hardly).collect::<Vec<_>>(),
        "operations": operations,
        "choice": choice,
        "symmetries": symmetries.iter().map(|s| symmetry_json(model, s)).collect::<Vec<_>>(),
        "notes": arm.notes(),
    })
}

/// Joints from 1; the matrix as exact text.
fn transmission_json(block: &Transmission) -> Value {
    let joints: Vec<usize> = block.joints.iter().map(|j| j + 1).collect();
    json!({"joints": joints, "matrix": exact_rows(block)})
}

fn exact_rows(block: &Transmission) -> Vec<Vec<String>> {
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

fn table(
    model: &Model,
    operations: &[(&str, Operations)],
    symmetries: &[Symmetry],
    weak: &[Weak],
    digits: Digits,
) -> String {
    let arm = model.arm();
    let mut t = String::new();
    let gravity: Vec<String> = arm.gravity.iter().map(|g| digits.number(rational::to_f64(g))).collect();
    let convention = match arm.convention {
        Convention::Standard => "standard",
        Convention::Modified => "modified",
    };
    // A String takes every write.
    let _ = writeln!(
        t,
        "{}: {} joints, {convention} DH, gravity [{}] m/s²\n",
        arm.name,
        arm.dof(),
        gravity.join(", ")
    );
    // Names where the file has some.
    let names = arm.joint_names();
    let width = match arm.has_joint_names() {
        true => names.iter().map(|name| name.chars().count()).max().unwrap_or(0).max(4) + 2,
        false => 0,
    };
    let offsets = arm.joints.iter().any(|joint| rational::to_f64(&joint.b) != 0.0);
    let beside_title = if offsets { format!("  {:>8}", "b [m]") } else { String::new() };
    let _ = writeln!(
        t,
        "  {:>2}  {:<width$}{:<9}  {:>8}{beside_title}  {:>8}  {:>8}  {:>8}  {:>6}  declared zero",
        "i",
        if width > 0 { "name" } else { "" },
        "kind",
        "a [m]",
        "alpha",
        "d [m]",
        "theta",
        "rotor"
    );
    for (i, joint) in arm.joints.iter().enumerate() {
        let kind = match joint.kind {
            JointKind::Revolute => "revolute",
            JointKind::Prismatic => "prismatic",
        };
        let number = |r: &rational::Rational| digits.number(rational::to_f64(r));
        let beside = if offsets { format!("  {:>8}", number(&joint.b)) } else { String::new() };
        let rotor = joint.rotor_ratio.as_ref().map_or("-".to_string(), number);
        let zero: Vec<&str> = joint.zero.iter().map(|k| k.name()).collect();
        let (alpha, theta) = (digits.angle(&joint.alpha), digits.angle(&joint.theta));
        let _ = writeln!(
            t,
            "  {:>2}  {:<width$}{kind:<9}  {:>8}{beside}  {alpha:>8}  {:>8}  {theta:>8}  {rotor:>6}  {}",
            i + 1,
            if width > 0 { names[i].as_str() } else { "" },
            number(&joint.a),
            number(&joint.d),
            zero.join(" ")
        );
    }
    for (name, frame) in
        [("base: frame 0 in the root link", &arm.base), ("tool: in the last frame", &arm.tool)]
    {
        if let Some(frame) = frame {
            let _ = writeln!(t, "  {name}: {}", placement_text(frame, digits));
        }
    }
    for block in &arm.transmissions {
        let rows: Vec<String> = exact_rows(block).iter().map(|row| format!("[{}]", row.join(", "))).collect();
        let joints: Vec<String> = block.joints.iter().map(|j| (j + 1).to_string()).collect();
        let _ = writeln!(t, "  motors {0} = [{1}] · joints {0}", joints.join(", "), rows.join(", "));
    }
    let kept = arm.kept_parameters();
    let _ = writeln!(t, "\n{} of {} parameters are kept:", kept.len(), arm.all_parameters().len());
    for class in [Class::Unidentifiable, Class::Alone, Class::InCombination] {
        let names: Vec<String> =
            kept.iter().filter(|p| model.sets().class(**p) == class).map(ToString::to_string).collect();
        let _ = writeln!(t, "  {:<30} {:>2}: {}", class.name(), names.len(), names.join(" "));
    }
    if !symmetries.is_empty() {
        let _ = writeln!(t, "\nwhat each declared symmetry removed:");
        symmetry_table(&mut t, model, symmetries, digits);
    }
    if !weak.is_empty() {
        let _ = writeln!(
            t,
            "\nhardly identifiable, through residues of the file's numbers alone (an angle such as 1.5708, or axes \
             that almost\nmeet), with the singular value of the scaled regressor:"
        );
        for w in weak {
            let _ = writeln!(t, "  {:.1e}: sums of {}", w.singular_value, w.parameters.join(" "));
        }
    }
    for set in model.sets().sets.iter().filter(|s| s.kind != SetKind::Full) {
        set_table(&mut t, model, set, digits);
    }
    let candidates = &model.sets().candidates;
    if let Some(chosen) = choice::chosen(candidates) {
        let counts: Vec<String> = candidates.iter().map(|c| c.operations.to_string()).collect();
        let _ = writeln!(
            t,
            "\nminimal set's columns chosen by code: {} ({} rules cost {} operations in Y)",
            chosen.preference,
            counts.len(),
            counts.join(", ")
        );
    }
    let _ = writeln!(t, "\noperations with the minimal set as arguments:");
    let _ = writeln!(t, "  {:<20} {:>6} {:>6} {:>5} {:>8}", "function", "mul", "add", "div", "sin_cos");
    for (function, o) in operations {
        let _ = writeln!(t, "  {:<20} {:>6} {:>6} {:>5} {:>8}", function, o.mul, o.add, o.div, o.sin_cos);
    }
    t
}

fn placement_text(frame: &Placement, digits: Digits) -> String {
    let xyz: Vec<String> = frame.xyz.iter().map(|x| digits.number(rational::to_f64(x))).collect();
    let rpy: Vec<String> = frame.rpy.iter().map(|angle| digits.angle(angle)).collect();
    format!("xyz = [{}] m, rpy = [{}] rad", xyz.join(", "), rpy.join(", "))
}

fn symmetry_table(t: &mut String, model: &Model, symmetries: &[Symmetry], digits: Digits) {
    let names = |wanted: fn(&Removed) -> bool| -> Vec<String> {
        let some = symmetries.iter().filter(|s| wanted(&s.removed));
        some.map(|s| s.parameter.to_string()).collect()
    };
    let nothing = names(|r| matches!(r, Removed::Nothing));
    let own = names(|r| matches!(r, Removed::BaseParameter));
    for (what, names) in [("nothing that torques show", nothing), ("a base parameter of its own", own)] {
        if !names.is_empty() {
            let _ = writeln!(t, "  {what:<30} {:>2}: {}", names.len(), names.join(" "));
        }
    }
    for symmetry in symmetries {
        if let Removed::Term(terms) = &symmetry.removed {
            let field = &model.sets().field;
            let sum = digits.sum(field, terms, &combination_text(field, terms));
            let _ = writeln!(t, "  {:<30}  a term that acts as {sum}", symmetry.parameter.to_string());
        }
    }
}

fn set_table(t: &mut String, model: &Model, set: &ParameterSet, digits: Digits) {
    let meaning = match set.kind {
        SetKind::Minimal => "exact for the numbers in the file",
        SetKind::Symbolic => "exact for every length and ratio",
        _ => "the file's grouping",
    };
    let _ =
        writeln!(t, "\n{}: {} parameters of rank {}, {meaning}", set.kind, set.parameters.len(), set.rank);
    for (i, p) in set.parameters.iter().enumerate() {
        let sum = dyngen::arm::sum::sum_text(
            p.terms
                .iter()
                .filter_map(|(q, c)| c.as_rational().map(|r| (q, r)))
                .collect::<Vec<_>>()
                .iter()
                .map(|(q, r)| (*q, r)),
        );
        let text = if set.kind == SetKind::Published && p.name != sum {
            format!("{} = {sum}", p.name)
        } else {
            digits.sum(&model.sets().field, &p.terms, &p.name)
        };
        let _ = writeln!(t, "  {:>2}  {text}", i + 1);
    }
    if !set.exact {
        let _ = writeln!(t, "  NOT exact: replacing the parameters by these sums changes the torque.");
        set.lost.iter().for_each(|(_, why)| {
            let _ = writeln!(t, "    {why}");
        });
    }
    if !set.relations.is_empty() {
        let _ = writeln!(t, "  relations that hold between its columns for the numbers in the file:");
        set.relations.iter().for_each(|r| {
            let _ = writeln!(t, "    {}", digits.text(r));
        });
    }
}
