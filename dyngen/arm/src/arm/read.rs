//! From TOML to [`Arm`]: the typed description, or every error with its place.

use super::table::{Reader, Table, Value, describe, two_brackets};
use super::{
    Angle, Arm, Bar, Convention, Frame, Grouping, Joint, JointKind, MAX_JOINTS, Parameter, ParameterKind,
    Placement, loops, mimic, servo, sum, transmission,
};
use crate::diagnostic::{Collector, Diagnostics, is_unseen, unseen};
use crate::exact::rational::{self, Rational};
use num_traits::{Signed, Zero};
use std::ops::Range;
use toml::de::DeTable;

const ARM_KEYS: [&str; 10] =
    ["name", "convention", "gravity", "joint", "loop", "base", "tool", "frame", "grouping", "transmission"];
const FRAME_KEYS: [&str; 4] = ["name", "link", "xyz", "rpy"];
const PLACEMENT_KEYS: [&str; 2] = ["xyz", "rpy"];
const JOINT_KEYS: [&str; 17] = [
    "name",
    "kind",
    "a",
    "b",
    "alpha",
    "d",
    "theta",
    "zero",
    "rotor_ratio",
    "position",
    "velocity",
    "acceleration",
    "torque",
    "torque_constant",
    "mimic",
    "link_frame",
    "servo",
];
const GROUPING_KEYS: [&str; 2] = ["name", "sum"];
/// A larger file is no arm.
const LARGEST_FILE: usize = 1 << 20;

pub(super) fn parse(text: &str, file: &str) -> Result<Arm, Diagnostics> {
    if text.len() > LARGEST_FILE {
        return Err(Diagnostics::whole_file(file, "larger than 1 MiB: this is no arm file"));
    }
    let mut reader = Reader { errors: Collector::new(file, text) };
    if let Some((at, c)) = text.char_indices().find(|(_, c)| is_unseen(*c)) {
        reader.errors.error(at..at, format!("the text holds {}", unseen(c)));
        return reader.errors.finish(None);
    }
    let (document, errors) = DeTable::parse_recoverable(text);
    let broken = !errors.is_empty();
    let kind = || other_kind(text).map(|kind| (0..0, kind.to_string()));
    let other = broken.then(|| kind().or_else(|| one_bracket(text))).flatten();
    if let Some((span, kind)) = other.clone() {
        reader.errors.error(span, kind);
    }
    for error in errors.into_iter().filter(|_| other.is_none()) {
        reader.errors.error(error.span().unwrap_or(0..0), format!("not valid TOML: {}", error.message()));
    }
    // A document that does not parse would only add errors about what the parser skipped.
    let arm = if broken { None } else { reader.arm(document.get_ref()) };
    reader.errors.finish(arm)
}

/// Whether a table of a list stands in one bracket, which TOML takes for one table that is given twice.
fn one_bracket(text: &str) -> Option<(Range<usize>, String)> {
    LISTS.into_iter().find_map(|key| {
        let header = format!("[{key}]");
        let mut lines = text.split_inclusive('\n').scan(0, |at, line| {
            *at += line.len();
            Some((*at - line.len(), line))
        });
        let mut found = lines.by_ref().filter(|(_, line)| line.trim() == header);
        let (at, _) = found.next()?;
        found.next()?;
        Some((at..at + header.len(), two_brackets(key)))
    })
}

/// The keys whose tables are entries of a list.
const LISTS: [&str; 5] = ["joint", "loop", "frame", "transmission", "grouping"];

/// Whether a module may have this name.
pub fn is_name(name: &str) -> bool {
    let mut letters = name.chars();
    letters.next().is_some_and(|c| c.is_ascii_lowercase())
        && letters.all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_')
        // What a file has of its own, and what it calls.
        && !["batch", "discrete", "trigonometry", "tests", "nalgebra", "core", "std"].contains(&name)
        // No word of the language.
        && syn::parse_str::<syn::Ident>(name).is_ok()
}

/// What a text is that is no arm file, and what to do with it.
fn other_kind(text: &str) -> Option<&'static str> {
    let first =
        text.trim_start_matches('\u{feff}').lines().find(|line| !line.trim().is_empty())?.trim_start();
    if first.starts_with('<') {
        return Some(
            "this is XML and no arm file: `dyngen import FILE -o arm.toml` makes one of a URDF or a MuJoCo \
            model",
        );
    }
    let separated = |by: char| first.matches(by).count() >= 2;
    let table =
        !first.contains('=') && !first.starts_with(['#', '[']) && [',', ';', '\t'].into_iter().any(separated);
    table.then_some(
        "this is a table and no arm file: a log is given with --log, states of `dyngen eval` with --states",
    )
}

impl Reader<'_> {
    fn arm(&mut self, document: &DeTable<'_>) -> Option<Arm> {
        let top = Table { table: document, span: 0..0, place: "arm".to_string() };
        self.unknown_keys(&top, &ARM_KEYS);
        let name = self.required(&top, "name").and_then(|v| self.text(v, "name"));
        let convention = self.required(&top, "convention").and_then(|v| self.convention(v));
        let gravity = self.required(&top, "gravity").and_then(|v| self.gravity(v));
        let joint_tables = self.tables(&top, "joint");
        if document.get("joint").is_none() {
            self.errors.error(
                0..0,
                "the arm has no [[joint]]: give one table for each joint, from the base outwards",
            );
        } else if document
            .get("joint")
            .and_then(|v| v.get_ref().as_array())
            .is_some_and(|list| list.is_empty())
        {
            let span = document.get("joint").map_or(0..0, toml::Spanned::span);
            self.errors.error(span, "an arm needs at least one joint: `[[joint]]`");
        } else if joint_tables.len() > MAX_JOINTS {
            let span = joint_tables[MAX_JOINTS].span.clone();
            self.errors
                .error(span, format!("{} joints: an arm may have 1 to {MAX_JOINTS}", joint_tables.len()));
            return None;
        }
        let dof = joint_tables.len();
        let joints: Vec<Option<Joint>> = joint_tables.iter().map(|t| self.joint(t, dof)).collect();
        self.same_names(&joint_tables);
        let base = self.optional(&top, "base", |r, v| r.placement(v, "base", "the root link"));
        let tool = self.optional(&top, "tool", |r, v| r.placement(v, "tool", "the last frame"));
        let frame_tables = self.tables(&top, "frame");
        let mut frames: Vec<Option<Frame>> = Vec::new();
        for table in &frame_tables {
            let frame = self.frame(table, dof, &frames);
            frames.push(frame);
        }
        let transmission_tables = self.tables(&top, "transmission");
        let transmissions = transmission::read(self, &transmission_tables, dof);
        let loop_tables = self.tables(&top, "loop");
        let mut whole: Option<Vec<Joint>> = joints.iter().cloned().collect();
        let bars = match (&mut whole, convention) {
            (Some(joints), Some(convention)) => loops::read(self, &loop_tables, convention, joints),
            _ => None,
        };
        let grouping_tables = self.tables(&top, "grouping");
        let mut groupings: Vec<Option<Grouping>> = Vec::new();
        for table in &grouping_tables {
            let grouping = self.grouping(table, &joints, bars.as_deref().unwrap_or_default());
            let earlier = grouping
                .as_ref()
                .and_then(|g| groupings.iter().flatten().position(|other: &Grouping| other.name == g.name));
            if let (Some(at), Some(g)) = (earlier, &grouping) {
                self.errors.error(
                    table.span.clone(),
                    format!("grouping name '{}' is already that of grouping {}", g.name, at + 1),
                );
            }
            groupings.push(grouping);
        }
        let mut joints = whole?;
        if let Err((joint, why)) = mimic::resolve(&mut joints) {
            let t = &joint_tables[joint];
            self.errors.error(t.span.clone(), format!("{}: mimic: {why}", t.place));
            return None;
        }
        Some(Arm {
            name: name?,
            convention: convention?,
            gravity: gravity?,
            joints,
            base: base?,
            tool: tool?,
            tool_link: None,
            frames: frames.into_iter().collect::<Option<_>>()?,
            groupings: groupings.into_iter().collect::<Option<_>>()?,
            transmissions: transmissions?,
            bars: bars?,
        })
    }

    fn joint(&mut self, t: &Table<'_, '_>, dof: usize) -> Option<Joint> {
        self.unknown_keys(t, &JOINT_KEYS);
        let place = t.place.clone();
        let name = self.optional(t, "name", |r, v| r.text(v, &format!("{place}: name")));
        let kind = self.required(t, "kind").and_then(|v| self.kind(v, &place));
        let a = self.required(t, "a").and_then(|v| self.number(v, &format!("{place}: a"), "m"));
        let b = self.optional(t, "b", |r, v| r.number(v, &format!("{place}: b"), "m"));
        let alpha = self.required(t, "alpha").and_then(|v| self.angle(v, &format!("{place}: alpha")));
        let d = self.required(t, "d").and_then(|v| self.number(v, &format!("{place}: d"), "m"));
        let theta = self.required(t, "theta").and_then(|v| self.angle(v, &format!("{place}: theta")));
        let zero = match t.table.get("zero") {
            Some(v) => self.symmetries(v, &place),
            None => Some(Vec::new()),
        };
        let rotor_ratio = self.optional(t, "rotor_ratio", |r, v| r.rotor_ratio(v, &place));
        let position = self.optional(t, "position", |r, v| r.position(v, &place));
        let mut limit = |key: &str, unit: &str| {
            self.optional(t, key, |r, v| r.limit(v, &format!("{place}: {key}"), unit))
        };
        let velocity = limit("velocity", "rad/s or m/s");
        let acceleration = limit("acceleration", "rad/s² or m/s²");
        let torque = limit("torque", "N·m or N");
        let torque_constant = limit("torque_constant", "N·m/A or N/A");
        let mimic = self.optional(t, "mimic", |r, v| mimic::read(r, v, &place, dof));
        let link_frame = self.optional(t, "link_frame", |r, v| {
            r.placement(v, &format!("{place}: link_frame"), "the link's frame")
        });
        let servo = self.optional(t, "servo", |r, v| servo::read(r, v, &place));
        Some(Joint {
            name: name?,
            kind: kind?,
            a: a?,
            b: b?.unwrap_or_else(Rational::zero),
            alpha: alpha?,
            d: d?,
            theta: theta?,
            zero: zero?,
            rotor_ratio: rotor_ratio?,
            position: position?,
            velocity: velocity?,
            acceleration: acceleration?,
            torque: torque?,
            torque_constant: torque_constant?,
            mimic: mimic?,
            link_frame: link_frame?,
            servo: servo?,
        })
    }

    fn kind(&mut self, v: &Value<'_>, place: &str) -> Option<JointKind> {
        match v.get_ref().as_str() {
            Some("revolute") => Some(JointKind::Revolute),
            Some("prismatic") => Some(JointKind::Prismatic),
            _ => {
                let found = describe(v);
                self.errors.error(
                    v.span(),
                    format!("{place}: kind must be \"revolute\" or \"prismatic\", found {found}"),
                );
                None
            }
        }
    }

    fn rotor_ratio(&mut self, v: &Value<'_>, place: &str) -> Option<Rational> {
        let ratio = self.number(v, &format!("{place}: rotor_ratio"), "1")?;
        if ratio.is_zero() {
            self.errors.error(
                v.span(),
                format!("{place}: rotor_ratio is zero: leave the key out where the joint has no rotor"),
            );
            return None;
        }
        Some(ratio)
    }

    /// A limit of a joint, in its unit.
    fn limit(&mut self, v: &Value<'_>, quantity: &str, unit: &str) -> Option<f64> {
        let value = self.number(v, quantity, unit)?;
        if !value.is_positive() {
            self.errors.error(v.span(), format!("{quantity} must be greater than zero"));
            return None;
        }
        Some(rational::to_f64(&value))
    }

    pub(super) fn symmetries(&mut self, v: &Value<'_>, place: &str) -> Option<Vec<ParameterKind>> {
        let Some(list) = v.get_ref().as_array() else {
            self.errors.error(
                v.span(),
                format!("{place}: zero must be a list of parameter names, found {}", describe(v)),
            );
            return None;
        };
        let mut kinds = Vec::new();
        let mut sound = true;
        for item in list.iter() {
            let name = item.get_ref().as_str().unwrap_or("");
            match ParameterKind::parse(name) {
                Some(ParameterKind::Im) => {
                    sound = false;
                    self.errors.error(
                        item.span(),
                        format!(
                            "{place}: Im is the rotor's and no inertial parameter of the body: leave \
                             rotor_ratio out where a joint has no rotor; bars have none"
                        ),
                    );
                }
                Some(kind) if kinds.contains(&kind) => {
                    sound = false;
                    self.errors.error(item.span(), format!("{place}: zero names {name} twice"));
                }
                Some(kind) => kinds.push(kind),
                None => {
                    sound = false;
                    self.errors.error(
                        item.span(),
                        format!(
                            "{place}: zero names {}, which is no parameter: \
                        they are m mx my mz Ixx Ixy Ixz Iyy Iyz Izz, without the link's \
                        number",
                            describe(item)
                        ),
                    );
                }
            }
        }
        sound.then_some(kinds)
    }

    fn grouping(&mut self, t: &Table<'_, '_>, joints: &[Option<Joint>], bars: &[Bar]) -> Option<Grouping> {
        self.unknown_keys(t, &GROUPING_KEYS);
        let place = t.place.clone();
        let name = self.required(t, "name").and_then(|v| self.text(v, &format!("{place}: name")));
        let sum = self.required(t, "sum").and_then(|v| {
            let text = self.text(v, &format!("{place}: sum"))?;
            match sum::parse_sum(&text) {
                Ok(terms) => {
                    let mut sound = true;
                    for (parameter, _) in &terms {
                        if let Some(reason) = unusable(*parameter, joints, bars) {
                            sound = false;
                            self.errors.error(v.span(), format!("{place}: {parameter} {reason}"));
                        }
                    }
                    sound.then_some(terms)
                }
                Err(reason) => {
                    self.errors.error(v.span(), format!("{place}: sum: {reason}"));
                    None
                }
            }
        });
        Some(Grouping { name: name?, terms: sum? })
    }

    fn convention(&mut self, v: &Value<'_>) -> Option<Convention> {
        match v.get_ref().as_str() {
            Some("standard") => Some(Convention::Standard),
            Some("modified") => Some(Convention::Modified),
            _ => {
                self.errors.error(
                    v.span(),
                    format!("convention must be \"standard\" or \"modified\", found {}", describe(v)),
                );
                None
            }
        }
    }

    fn gravity(&mut self, v: &Value<'_>) -> Option<[Rational; 3]> {
        let [x, y, z] = self.three(v, "gravity must be three numbers in m/s² in the base frame")?;
        let [x, y, z] = [x, y, z].map(|c| self.number(c, "gravity", "m/s²"));
        Some([x?, y?, z?])
    }

    /// Names say which joint is meant, so no two joints have one.
    fn same_names(&mut self, joints: &[Table<'_, '_>]) {
        let name =
            |t: &Table<'_, '_>| t.table.get("name").and_then(|v| v.get_ref().as_str().map(str::to_string));
        for (i, t) in joints.iter().enumerate() {
            let Some(own) = name(t) else { continue };
            if let Some(first) = joints[..i].iter().position(|other| name(other).as_ref() == Some(&own)) {
                let span = t.table.get("name").map_or(t.span.clone(), toml::Spanned::span);
                let message = format!("{}: the name '{own}' is already that of joint {}", t.place, first + 1);
                self.errors.error(span, message);
            }
        }
    }

    /// A frame's place in another, whose name is `within`.
    fn placement(&mut self, v: &Value<'_>, name: &str, within: &str) -> Option<Placement> {
        let Some(table) = v.get_ref().as_table() else {
            let message = format!("{name} must be a table: write [{name}], found {}", describe(v));
            self.errors.error(v.span(), message);
            return None;
        };
        let t = Table { table, span: v.span(), place: name.to_string() };
        self.unknown_keys(&t, &PLACEMENT_KEYS);
        self.placed(&t, name, within)
    }

    /// A frame on a link. Its name becomes that of a module.
    fn frame(&mut self, t: &Table<'_, '_>, links: usize, before: &[Option<Frame>]) -> Option<Frame> {
        self.unknown_keys(t, &FRAME_KEYS);
        let place = t.place.clone();
        let name = self.required(t, "name").and_then(|v| self.text(v, &format!("{place}: name")));
        let link = self.required(t, "link").and_then(|v| {
            let link =
                v.get_ref().as_integer().and_then(|i| usize::from_str_radix(i.as_str(), i.radix()).ok());
            let link = link.filter(|link| (1..=links).contains(link));
            if link.is_none() {
                let message =
                    format!("{place}: link must be one of the links 1 to {links}, found {}", describe(v));
                self.errors.error(v.span(), message);
            }
            link
        });
        let placement = self.placed(t, &place, "the link's frame");
        let name = name?;
        if !is_name(&name) {
            let message = format!(
                "{place}: name '{name}' becomes a module's: take lowercase letters, digits and _, a letter \
                 first, and no word of Rust or of the file's own"
            );
            self.errors.error(t.span.clone(), message);
            return None;
        }
        if before.iter().flatten().any(|other| other.name == name) {
            self.errors.error(t.span.clone(), format!("{place}: '{name}' is the name of another frame"));
            return None;
        }
        Some(Frame { name, link: link? - 1, placement: placement? })
    }

    /// `xyz` and `rpy` of a table.
    fn placed(&mut self, t: &Table<'_, '_>, name: &str, within: &str) -> Option<Placement> {
        let xyz = self.optional(t, "xyz", |r, v| {
            let [x, y, z] = r.three(v, &format!("{name}: xyz must be three numbers in m in {within}"))?;
            let [x, y, z] = [x, y, z].map(|c| r.number(c, &format!("{name}: xyz"), "m"));
            Some([x?, y?, z?])
        });
        let rpy = self.optional(t, "rpy", |r, v| {
            let [x, y, z] = r.three(v, &format!("{name}: rpy must be three angles, roll, pitch and yaw"))?;
            let [x, y, z] = [x, y, z].map(|c| r.angle(c, &format!("{name}: rpy")));
            Some([x?, y?, z?])
        });
        let straight = || Angle::PiMultiple(Rational::zero());
        Some(Placement {
            xyz: xyz?.unwrap_or_else(|| std::array::from_fn(|_| Rational::zero())),
            rpy: rpy?.unwrap_or_else(|| std::array::from_fn(|_| straight())),
        })
    }

    fn position(&mut self, v: &Value<'_>, place: &str) -> Option<[f64; 2]> {
        let list = v.get_ref().as_array().map(|a| a.iter().collect::<Vec<_>>()).unwrap_or_default();
        let [low, high] = list[..] else {
            self.errors.error(
                v.span(),
                format!("{place}: position must be [lower, upper] in rad or m, found {}", describe(v)),
            );
            return None;
        };
        let [low, high] = [low, high].map(|c| self.number(c, &format!("{place}: position"), "rad or m"));
        let (low, high) = (rational::to_f64(&low?), rational::to_f64(&high?));
        if low >= high {
            self.errors.error(
                v.span(),
                format!("{place}: position: the lower limit {low} is not below the upper limit {high}"),
            );
            return None;
        }
        Some([low, high])
    }
}

fn unusable(parameter: Parameter, joints: &[Option<Joint>], bars: &[Bar]) -> Option<String> {
    let bodies = joints.len() + bars.len();
    if parameter.link >= bodies {
        return Some(format!("names link {} of an arm with {bodies}", parameter.link + 1));
    }
    if let Some(bar) = parameter.link.checked_sub(joints.len()).map(|k| &bars[k]) {
        let rotor = parameter.kind == ParameterKind::Im;
        let zero = || bar.zero.contains(&parameter.kind).then(|| "is declared zero by its bar".to_string());
        return if rotor { Some("is a rotor inertia, but bars have no rotor".to_string()) } else { zero() };
    }
    let joint = joints[parameter.link].as_ref()?;
    if parameter.kind == ParameterKind::Im {
        return joint
            .rotor_ratio
            .is_none()
            .then(|| "is a rotor inertia, but its joint has no rotor_ratio".to_string());
    }
    joint.zero.contains(&parameter.kind).then(|| "is declared zero by its joint".to_string())
}
