//! `dyngen describe`.

use super::digits::Digits;
use super::{Failure, Progress, model, print};
use dyngen::arm::{Arm, Convention, Joint, JointKind, Placement};
use dyngen::base::choice;
use dyngen::base::sets::{Class, combination_text};
use dyngen::base::symmetry::{Removed, Symmetry};
use dyngen::base::{ParameterSet, SetKind};
use dyngen::describe::{BoundsFor, Description, Rounding, Weak, exact_rows, poses_of, why_unbounded};
use dyngen::exact::rational::{self, Rational};
use dyngen::graph::Operations;
use dyngen::{Function, Model, Values};
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::PathBuf;
use std::process::ExitCode;

#[derive(clap::Args)]
#[command(after_help = "Example: dyngen describe powerball/arm.toml")]
pub(super) struct Args {
    /// The arm file.
    arm: PathBuf,
    /// Parameter values, JSON, for which rounding is bounded; without them each parameter is within ±1 SI
    /// unit.
    #[arg(long, value_name = "FILE.json")]
    values: Option<PathBuf>,
    /// Bound the rounding of code that is generated with --contract.
    #[arg(long)]
    contract: bool,
    /// One JSON object on standard output.
    #[arg(long)]
    json: bool,
    /// Every digit of every number, in place of six; the JSON object has them all.
    #[arg(long)]
    exact: bool,
}

pub(super) fn run(args: &Args) -> Result<ExitCode, Failure> {
    let model = model(&args.arm)?;
    let set = model.set(SetKind::Minimal).map_err(Failure::refused)?;
    let (mut values, mut links) = (None, None);
    if let Some(file) = &args.values {
        let given = Values::read(file).map_err(Failure::input)?;
        values = Some(given.of_set(&model, set).map_err(Failure::input)?);
        // Sums of parameters determine no link.
        links = model.set(SetKind::Full).ok().and_then(|full| given.of_set(&model, full).ok());
    }
    let progress = Progress::new(model.arm());
    let bounds = BoundsFor { values: values.as_deref(), links: links.as_deref(), contracted: args.contract };
    let description = Description::with_progress(&model, bounds, |what| progress.say(what));
    let description = description.map_err(Failure::refused)?;
    drop(progress);
    let digits = if args.exact { Digits::All } else { Digits::Six };
    let text = match args.json {
        true => format!("{}\n", description.json(&model)),
        false => table(&model, &description, digits),
    };
    print(&text)?;
    Ok(ExitCode::SUCCESS)
}

/// Everything that is known of an arm, section by section.
fn table(model: &Model, description: &Description, digits: Digits) -> String {
    let Description { operations, symmetries, weak, rounding } = description;
    let arm = model.arm();
    let mut t = String::new();
    heading(&mut t, arm, digits);
    joint_table(&mut t, arm, digits);
    frames(&mut t, arm, digits);
    followers(&mut t, arm, digits);
    bars(&mut t, arm, digits);
    transmissions(&mut t, arm);
    classes(&mut t, model);
    symmetry_table(&mut t, model, symmetries, digits);
    weak_sums(&mut t, weak);
    for set in model.sets().sets.iter().filter(|s| s.kind != SetKind::Full) {
        set_table(&mut t, model, set, digits);
    }
    choice_of_columns(&mut t, model);
    operation_table(&mut t, operations);
    if let Some(rounding) = rounding {
        rounding_table(&mut t, arm, rounding);
    }
    t
}

/// The arm's name, size, convention and gravity.
fn heading(t: &mut String, arm: &Arm, digits: Digits) {
    let gravity: Vec<String> = arm.gravity.iter().map(|g| digits.number(rational::to_f64(g))).collect();
    let convention = match arm.convention {
        Convention::Standard => "standard",
        Convention::Modified => "modified",
    };
    // A String takes every write.
    let _ = writeln!(
        t,
        "{}: {} joints{}, {convention} DH, gravity [{}] m/s²\n",
        arm.name,
        arm.links(),
        if arm.has_mimics() { format!(", {} of them coordinates", arm.dof()) } else { String::new() },
        gravity.join(", ")
    );
}

/// The Denavit–Hartenberg rows; names and offsets b have columns where the file has some.
fn joint_table(t: &mut String, arm: &Arm, digits: Digits) {
    let name = |joint: &Joint| joint.name.clone().unwrap_or_default();
    let names: Vec<String> = arm.joints.iter().map(name).collect();
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
        let number = |r: &Rational| digits.number(rational::to_f64(r));
        let offset = if offsets { format!("  {:>8}", number(&joint.b)) } else { String::new() };
        let rotor = joint.rotor_ratio.as_ref().map_or("-".to_string(), number);
        let zero: Vec<&str> = joint.zero.iter().map(|k| k.name()).collect();
        let (alpha, theta) = (digits.angle(&joint.alpha), digits.angle(&joint.theta));
        let _ = writeln!(
            t,
            "  {:>2}  {:<width$}{kind:<9}  {:>8}{offset}  {alpha:>8}  {:>8}  {theta:>8}  {rotor:>6}  {}",
            i + 1,
            if width > 0 { names[i].as_str() } else { "" },
            number(&joint.a),
            number(&joint.d),
            zero.join(" ")
        );
    }
}

/// Where frame 0 and the tool are.
fn frames(t: &mut String, arm: &Arm, digits: Digits) {
    let frames = [("base: frame 0 in the root link", &arm.base), ("tool: in the last frame", &arm.tool)];
    for (name, frame) in frames {
        if let Some(frame) = frame {
            let _ = writeln!(t, "  {name}: {}", placement_text(frame, digits));
        }
    }
    for frame in &arm.frames {
        let place = placement_text(&frame.placement, digits);
        let _ = writeln!(t, "  frame {}: on link {}: {place}", frame.name, frame.link + 1);
    }
}

/// Joints that have no coordinate, and what they follow.
fn followers(t: &mut String, arm: &Arm, digits: Digits) {
    let number = |x: &Rational| digits.number(rational::to_f64(x));
    for (i, joint) in arm.joints.iter().enumerate() {
        if let Some(mimic) = &joint.mimic {
            let _ = writeln!(
                t,
                "  joint {} follows joint {}: {}·q + {}; it has no coordinate",
                i + 1,
                mimic.joint + 1,
                number(&mimic.ratio),
                number(&mimic.offset)
            );
        }
    }
}

/// The bars of closed loops, which have the numbers after the links'.
fn bars(t: &mut String, arm: &Arm, digits: Digits) {
    let link = |link: Option<usize>| link.map_or("the base".to_string(), |link| format!("link {}", link + 1));
    for (bar, number) in arm.bars.iter().zip(arm.links() + 1..) {
        let pin = bar.pin.each_ref().map(|x| digits.number(rational::to_f64(x)));
        let _ = writeln!(
            t,
            "  body {number}: bar {}, from a pin at [{}] m on {}; {}",
            bar.name,
            pin.join(", "),
            link(bar.carrier),
            match &bar.hinge {
                None => format!("its axes are those of {}", link(bar.parallel)),
                Some(hinge) => format!("it turns there with joint {}, x along it", hinge.linkage.joint + 1),
            }
        );
    }
}

/// How motors turn with several joints.
fn transmissions(t: &mut String, arm: &Arm) {
    for block in &arm.transmissions {
        let rows: Vec<String> = exact_rows(block).iter().map(|row| format!("[{}]", row.join(", "))).collect();
        let joints: Vec<String> = block.joints.iter().map(|j| (j + 1).to_string()).collect();
        let _ = writeln!(t, "  motors {0} = [{1}] · joints {0}", joints.join(", "), rows.join(", "));
    }
}

/// The kept parameters by what torques show of them.
fn classes(t: &mut String, model: &Model) {
    let arm = model.arm();
    let kept = arm.kept_parameters();
    let _ = writeln!(t, "\n{} of {} parameters are kept:", kept.len(), arm.all_parameters().len());
    for class in [Class::Unidentifiable, Class::Alone, Class::InCombination] {
        let names: Vec<String> =
            kept.iter().filter(|p| model.sets().class(**p) == class).map(ToString::to_string).collect();
        let _ = writeln!(t, "  {:<30} {:>2}: {}", class.name(), names.len(), names.join(" "));
    }
}

/// Sums of parameters that torques hardly show.
fn weak_sums(t: &mut String, weak: &[Weak]) {
    if weak.is_empty() {
        return;
    }
    let _ = writeln!(
        t,
        "\n\
         hardly identifiable, through residues of the file's numbers alone (an angle such as 1.5708, or axes \
         that almost\nmeet), with the singular value of the scaled regressor:"
    );
    for w in weak {
        let _ = writeln!(t, "  {:.1e}: sums of {}", w.singular_value, w.parameters.join(" "));
    }
}

/// By which rule the minimal set's columns were chosen, and what the others cost.
fn choice_of_columns(t: &mut String, model: &Model) {
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
}

/// What each function costs.
fn operation_table(t: &mut String, operations: &[(&'static str, Operations)]) {
    let _ = writeln!(t, "\noperations with the minimal set as arguments:");
    // Only loops that are no parallelograms have roots.
    let has_roots = operations.iter().any(|(_, o)| o.sqrt > 0);
    let roots = |text: String| if has_roots { format!(" {text:>5}") } else { String::new() };
    let head = roots("sqrt".to_string());
    let _ = writeln!(t, "  {:<20} {:>6} {:>6} {:>5}{head} {:>8}", "function", "mul", "add", "div", "sin_cos");
    for (function, o) in operations {
        let (sqrt, trig) = (roots(o.sqrt.to_string()), o.sin_cos);
        let _ = writeln!(t, "  {:<20} {:>6} {:>6} {:>5}{sqrt} {trig:>8}", function, o.mul, o.add, o.div);
    }
}

/// By how much the worst entry of each function may be off.
fn rounding_table(t: &mut String, arm: &Arm, rounding: &Rounding) {
    let _ = writeln!(
        t,
        "\n\
         rounding: |emitted − exact| of each function's worst entry, in its unit, for every state within the \
         limits\n({}parameters: {}):",
        if rounding.contracted { "code with --contract; " } else { "" },
        rounding.parameters.text()
    );
    let _ = writeln!(t, "  {:<36} {:>8} {:>8}  decimals that hold in f32, f64", "function", "f32", "f64");
    for (function, bounds) in &rounding.functions {
        let Ok(of) = bounds else { continue };
        let [single, double] = [&of.single, &of.double].map(|all| all.iter().copied().fold(0.0, f64::max));
        if double.is_finite() {
            let name = function.name();
            let number = |x: f64| if x.is_finite() { format!("{x:.1e}") } else { "-".to_string() };
            let [few, many] = [single, double].map(decimals);
            let single = number(single);
            let _ = writeln!(t, "  {name:<36} {single:>8} {double:>8.1e}  {few:>8} {many:>4}");
        }
    }
    by_joint(t, arm, rounding);
    let mut only: BTreeMap<String, Vec<&str>> = BTreeMap::new();
    for (function, bounds) in &rounding.functions {
        if let Some(poses) = poses_of(bounds) {
            only.entry(poses.text()).or_default().push(function.name());
        }
    }
    for (poses, functions) in only {
        let _ = writeln!(t, "  {} {poses}", functions.join(", "));
    }
    let mut none: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for (function, bounds) in &rounding.functions {
        if let Some(why) = why_unbounded(bounds) {
            none.entry(why).or_default().push(function.name());
        }
    }
    for (why, functions) in none {
        let _ = writeln!(t, "  none for {}: {why}", functions.join(", "));
    }
}

/// How many digits after the point a bound leaves right to half a unit.
fn decimals(bound: f64) -> String {
    let digits = (-(2.0 * bound).log10()).floor();
    match bound {
        0.0 => "all".to_string(),
        _ if bound.is_infinite() => "-".to_string(),
        _ => format!("{:.0}", digits.max(0.0)),
    }
}

/// What each joint's torque and acceleration may be off.
fn by_joint(t: &mut String, arm: &Arm, rounding: &Rounding) {
    let units = [
        (Function::InverseDynamics, "τ", ["N·m", "N"]),
        (Function::ForwardDynamics, "q̈", ["rad/s²", "m/s²"]),
    ];
    for (function, letter, units) in units {
        let found = rounding.functions.iter().find(|(f, _)| *f == function);
        let Some((_, Ok(bounds))) = found else { continue };
        let both = [("f32", &bounds.single), ("f64", &bounds.double)];
        for (precision, all) in both.into_iter().filter(|(_, all)| all.iter().all(|x| x.is_finite())) {
            let entry = |(joint, bound): (&Joint, &f64)| {
                format!("{bound:.1e} {}", units[usize::from(joint.kind == JointKind::Prismatic)])
            };
            let entries: Vec<String> = arm.moving_joints().zip(all).map(entry).collect();
            let _ = writeln!(t, "  {letter} in {precision}, joint by joint: {}", entries.join(", "));
        }
    }
}

fn placement_text(frame: &Placement, digits: Digits) -> String {
    let xyz: Vec<String> = frame.xyz.iter().map(|x| digits.number(rational::to_f64(x))).collect();
    let rpy: Vec<String> = frame.rpy.iter().map(|angle| digits.angle(angle)).collect();
    format!("xyz = [{}] m, rpy = [{}] rad", xyz.join(", "), rpy.join(", "))
}

/// What each declared symmetry removed.
fn symmetry_table(t: &mut String, model: &Model, symmetries: &[Symmetry], digits: Digits) {
    if symmetries.is_empty() {
        return;
    }
    let _ = writeln!(t, "\nwhat each declared symmetry removed:");
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

/// A set: its sums, what they lose, and the relations between its columns.
fn set_table(t: &mut String, model: &Model, set: &ParameterSet, digits: Digits) {
    let meaning = match set.kind {
        SetKind::Minimal => "exact for the numbers in the file",
        SetKind::Symbolic if model.arm().bars.is_empty() => "exact for every length and ratio",
        SetKind::Symbolic => "exact for every length and ratio; pins of bars are numbers",
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
