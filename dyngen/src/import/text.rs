//! The arm file of an imported chain, and the inertial values in its frames.

use super::Options;
use super::chain::{Chain, ChainJoint, Mass};
use super::frames::{Frames, Row};
use super::loops::ChainLoop;
use super::pose::{Pose, twelfths};
use crate::arm::{Arm, Convention, JointKind, Parameter, ParameterKind, is_name};
use crate::consistency::parameters_of_body;
use crate::diagnostic::is_unseen;
use crate::exact::angle::Angle;
use crate::exact::rational;
use nalgebra::{Matrix3, Vector3};
use std::fmt::Write;

/// A gear ratio for rotors of which only the inertia on the joint's side is known.
const RATIO: f64 = 100.0;

/// The arm file, with comments that say where everything comes from and what an arm file cannot hold.
pub(super) fn arm_file(chain: &Chain, frames: &Frames, file: &str, options: &Options) -> String {
    let mut text = String::new();
    heading(&mut text, chain, frames, file, options.convention);
    for ((joint, row), link) in chain.joints.iter().zip(&frames.rows).zip(&frames.links) {
        table_of_joint(&mut text, joint, row, options.angle_tolerance);
        drive(&mut text, joint);
        limits(&mut text, joint);
        link_frame(&mut text, joint, link, options);
    }
    for closed in &chain.loops {
        loop_table(&mut text, closed, chain, frames, options.angle_tolerance);
    }
    let (base, tool) =
        (format!("frame 0 in link '{}'", chain.root), format!("link '{}' in the last frame", chain.tip));
    placement(&mut text, &base, "base", &frames.base, options);
    placement(&mut text, &tool, "tool", &tip(chain, frames), options);
    named_frames(&mut text, chain, frames, options);
    text
}

/// The frames that have names in the file, but the tip's, which is the tool's.
fn named_frames(text: &mut String, chain: &Chain, frames: &Frames, options: &Options) {
    let mut taken: Vec<String> = Vec::new();
    for (k, (joint, link)) in chain.joints.iter().zip(&frames.links).enumerate() {
        for (given, pose) in joint.frames.iter().filter(|(name, _)| *name != chain.tip) {
            let name = module_name(given, &taken);
            let (xyz, rpy) = numbers(&link.see(pose), options);
            // A String takes every write.
            let _ = write!(
                text,
                "\n# '{}'\n[[frame]]\nname = \"{name}\"\nlink = {}\nxyz = [{xyz}]\nrpy = [{rpy}]\n",
                plain(given),
                k + 1
            );
            taken.push(name);
        }
    }
}

/// A name as an arm file's frames have it, that no other one has.
fn module_name(given: &str, taken: &[String]) -> String {
    let kept = |c: char| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '_' };
    let mut name: String = given.chars().map(kept).collect();
    if !is_name(&name) {
        name.insert_str(0, "frame_");
    }
    let again = |count: usize| if count == 1 { name.clone() } else { format!("{name}_{count}") };
    (1..).map(again).find(|name| !taken.contains(name)).unwrap_or(name.clone())
}

/// Where the arm comes from, what the import reports about it, and what holds for all joints.
fn heading(text: &mut String, chain: &Chain, frames: &Frames, file: &str, convention: Convention) {
    let mut comment = |line: String| {
        // A String takes every write.
        let _ = writeln!(text, "# {}", plain(&line));
    };
    comment(format!("Imported by dyngen from {file}: link '{}' to link '{}'.", chain.root, chain.tip));
    comment("Gravity is that of frame 0. Friction and meshes are left out.".to_string());
    chain.notes.iter().for_each(|note| comment(format!("Note: {note}.")));
    let convention = match convention {
        Convention::Standard => "standard",
        Convention::Modified => "modified",
    };
    let name = if chain.name.trim().is_empty() { "robot" } else { &chain.name };
    let gravity = frames.base.rotation.transpose() * chain.gravity;
    let gravity: Vec<String> = gravity.iter().map(|g| length(*g)).collect();
    let _ = write!(
        text,
        "name = \"{}\"\nconvention = \"{convention}\"\ngravity = [{}]\n",
        quoted(name),
        gravity.join(", ")
    );
}

/// A joint's name, kind and Denavit–Hartenberg row, and what it follows.
fn table_of_joint(text: &mut String, joint: &ChainJoint, row: &Row, tolerance: f64) {
    let angle = |value: f64| angle(value, tolerance);
    let kind = match joint.kind {
        JointKind::Revolute => "revolute",
        JointKind::Prismatic => "prismatic",
    };
    let offset = match length(row.b).as_str() {
        "0" => String::new(),
        b => format!("b = {b}\n"),
    };
    let _ = write!(
        text,
        "\n# links {}\n[[joint]]\nname = \"{}\"\nkind = \"{kind}\"\na = {}\n{offset}alpha = {}\nd = \
         {}\ntheta = {}\n",
        plain(&joint.links.iter().map(|l| format!("'{l}'")).collect::<Vec<_>>().join(", ")),
        quoted(&joint.name),
        length(row.a),
        angle(row.alpha),
        length(row.d),
        angle(row.theta),
    );
    if let Some((leader, mimic)) = &joint.follows {
        let (ratio, offset) = (mimic.ratio, mimic.offset);
        let _ =
            writeln!(text, "mimic = {{ joint = {}, ratio = {ratio:?}, offset = {offset:?} }}", leader + 1);
    }
}

/// A loop that closes on the chain.
fn loop_table(text: &mut String, closed: &ChainLoop, chain: &Chain, frames: &Frames, tolerance: f64) {
    let (first, last) = (closed.first, closed.last);
    let joints: Vec<String> = (first..=last).map(|k| (k + 1).to_string()).collect();
    let pins = closed.pins.iter().map(|pin| format!("\"{}\"", quoted(pin)));
    let joints: Vec<String> = joints.into_iter().chain(pins).collect();
    let lengths: Vec<String> = closed.lengths.iter().map(|x| length(*x)).collect();
    // From the x axis of a joint's row at q = 0, about its z.
    let from_x = |joint: usize, way: &Vector3<f64>| {
        let (x, z) = (frames.links[joint].rotation.column(0).into_owned(), chain.joints[joint].direction);
        z.dot(&x.cross(way)).atan2(x.dot(way))
    };
    let (outer, inner) =
        (from_x(last, &closed.outer), from_x(first, &closed.inner) + frames.rows[first].theta);
    let bars: Vec<String> =
        closed.bars.iter().map(|bar| format!("{{ name = \"{}\" }}", quoted(&bar.name))).collect();
    let _ = write!(
        text,
        "\n[[loop]]\njoints = [{}]\nlengths = [{}]\nouter = {}\ninner = {}\n{}bar = [{}]\n",
        joints.join(", "),
        lengths.join(", "),
        angle(outer, tolerance),
        angle(inner.sin().atan2(inner.cos()), tolerance),
        closed.left.map_or(String::new(), |left| {
            format!("middle = \"{}\"\n", if left { "left" } else { "right" })
        }),
        bars.join(", ")
    );
}

/// The ratio of a joint's gear, and what the file states about its friction.
fn drive(text: &mut String, joint: &ChainJoint) {
    let Some(motor) = joint.motor else { return };
    if let Some(ratio) = ratio(joint) {
        let _ = writeln!(text, "rotor_ratio = {ratio:?}  # armature {:?}", motor.armature);
    }
    if motor.damping != 0.0 || motor.friction != 0.0 {
        let (damping, friction) = (motor.damping, motor.friction);
        let _ =
            writeln!(text, "# damping {damping:?} N·m·s/rad, frictionloss {friction:?} N·m (or N·s/m, N)");
    }
}

/// The limits of a joint that the file gives.
fn limits(text: &mut String, joint: &ChainJoint) {
    if let Some([lower, upper]) = joint.position {
        let _ = writeln!(text, "position = [{lower:?}, {upper:?}]");
    }
    for (key, limit) in [("velocity", joint.velocity), ("torque", joint.torque)] {
        if let Some(limit) = limit {
            let _ = writeln!(text, "{key} = {limit:?}");
        }
    }
}

/// The frame that the description gives the link behind a joint, where it is another than that of the table.
fn link_frame(text: &mut String, joint: &ChainJoint, link: &Pose, options: &Options) {
    let Some(pose) = joint.poses.first() else { return };
    let (xyz, rpy) = numbers(&link.see(pose), options);
    if [&xyz, &rpy].iter().any(|numbers| *numbers != "0, 0, 0") {
        // A String takes every write.
        let _ = writeln!(text, "link_frame = {{ xyz = [{xyz}], rpy = [{rpy}] }}");
    }
}

/// The table of a fixed frame, where it is another than the one it stands in.
fn placement(text: &mut String, what: &str, table: &str, pose: &Pose, options: &Options) {
    let (xyz, rpy) = numbers(pose, options);
    if [&xyz, &rpy].iter().any(|numbers| *numbers != "0, 0, 0") {
        // A String takes every write.
        let _ = write!(text, "\n# {}\n[{table}]\nxyz = [{xyz}]\nrpy = [{rpy}]\n", plain(what));
    }
}

/// `xyz` and `rpy` of a pose.
fn numbers(pose: &Pose, options: &Options) -> (String, String) {
    let xyz: Vec<String> = pose.origin.iter().map(|x| length(*x)).collect();
    let rpy = pose.rpy().map(|turn| angle(turn, options.angle_tolerance));
    (xyz.join(", "), rpy.join(", "))
}

/// The tip link's frame in the last frame.
fn tip(chain: &Chain, frames: &Frames) -> Pose {
    frames.links.last().unwrap_or(&frames.base).see(&chain.tip_pose)
}

/// The gear ratio of a joint whose rotor has an inertia: its actuator's, or one that is usual.
fn ratio(joint: &ChainJoint) -> Option<f64> {
    let motor = joint.motor.filter(|motor| motor.armature != 0.0)?;
    Some(motor.gear.unwrap_or(RATIO))
}

/// The inertial parameters of every link in its new frame, then of every bar.
pub(super) fn values(chain: &Chain, frames: &Frames, arm: &Arm) -> Vec<(Parameter, f64)> {
    let links = chain.joints.iter().zip(&frames.links).enumerate();
    let bars = chain.bars().zip(&arm.bars).zip(arm.links()..);
    let of_bars = bars.flat_map(|(((_, bar), of), link)| {
        let values = link_values(&bar.masses, &bar.frame(of, &frames.base, &frames.links));
        ParameterKind::ALL.into_iter().zip(values).map(move |(kind, value)| (Parameter { link, kind }, value))
    });
    links
        .flat_map(|(link, (joint, frame))| {
            let values = link_values(&joint.masses, frame).map(|x| if x == 0.0 { 0.0 } else { x });
            let armature = joint.motor.map_or(0.0, |motor| motor.armature);
            let rotor = ratio(joint).map(|ratio| armature / (ratio * ratio));
            ParameterKind::ALL
                .into_iter()
                .zip(values.into_iter().chain(rotor))
                .map(move |(kind, value)| (Parameter { link, kind }, value))
        })
        .chain(of_bars)
        .collect()
}

fn link_values(masses: &[Mass], frame: &Pose) -> [f64; 10] {
    let (mut mass, mut moment, mut tensor) = (0.0, Vector3::zeros(), Matrix3::zeros());
    let back = frame.rotation.transpose();
    for body in masses {
        let r = back * (body.centre - frame.origin);
        mass += body.mass;
        moment += r * body.mass;
        // Huygens–Steiner: from the centre of mass to the frame's origin.
        tensor += back * body.inertia * frame.rotation
            + (Matrix3::identity() * r.norm_squared() - r * r.transpose()) * body.mass;
    }
    parameters_of_body(mass, &moment, &tensor)
}

/// A length as a decimal: to 1e-12 m where that is the number but for rounding, so that lengths that are
/// meant to be equal are; to 1e-15 m otherwise, as a wheel of 1e-5 kg·m² feels its axis 1e-12 m aside.
fn length(value: f64) -> String {
    let short = decimal(value, 12);
    let meant = short.parse().is_ok_and(|short: f64| (value - short).abs() < ROUNDING * value.abs().max(1.0));
    if meant { short } else { decimal(value, 15) }
}

/// What sums and products of a chain's numbers are off by at most, relative.
const ROUNDING: f64 = 1e-14;

fn decimal(value: f64, digits: usize) -> String {
    let text = format!("{value:.digits$}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".to_string() } else { text.to_string() }
}

/// An angle in the arm file's notation: exact where it is a multiple of pi/12.
fn angle(value: f64, tolerance: f64) -> String {
    match twelfths(value, tolerance) {
        Some(0) => "0".to_string(),
        Some(count) => {
            let multiple = rational::integer(count) / rational::integer(12);
            format!("\"{}\"", Angle::PiMultiple(multiple))
        }
        None => decimal(value, 15),
    }
}

/// A name between the quotation marks of TOML.
fn quoted(name: &str) -> String {
    plain(name).replace('\\', "\\\\").replace('"', "\\\"")
}

/// Names as they may stand in a comment or a text: no letter ends the line or turns the text around.
pub(crate) fn plain(text: &str) -> String {
    text.chars().filter(|c| !is_unseen(*c)).map(|c| if c.is_control() { ' ' } else { c }).collect()
}

/// A note of each name in the arm file that is not the description's own, as letters of it are left out.
pub(super) fn unseen_names(chain: &Chain) -> Vec<String> {
    let joints = chain.joints.iter().map(|joint| ("joint", &joint.name));
    let named = std::iter::once(("robot", &chain.name)).chain(joints);
    let note = |(what, name): (&str, &String)| {
        let c = name.chars().find(|c| is_unseen(*c))?;
        let code = u32::from(c);
        Some(format!(
            "the name of {what} '{}' holds U+{code:04X}, which turns or breaks text: left out",
            plain(name)
        ))
    };
    named.filter_map(note).collect()
}
