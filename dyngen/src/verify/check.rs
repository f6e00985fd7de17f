//! The functions of a file against the Lagrangian, at random points of the prime field.

use super::head::{Head, Literals};
use super::language::{Routines, Stop, Value, World};
use super::{Checked, Difference, Report, Source, Unreadable, c, rust, structure_of, wgsl};
use crate::Language;
use crate::arm::{Arm, JointKind};
use crate::dynamics::Function;
use crate::dynamics::function::Argument;
use crate::exact::angle::Angle;
use crate::exact::prime::{Draws, Fp};
use crate::exact::rational;
use crate::exact::rational::Rational;
use crate::lagrangian::elements::angle_symbols;
use crate::model::{self, Model};
use crate::parameters::{ParameterSet, SetKind};
use crate::prove::{POINTS, Point, expected};
use std::cell::RefCell;
use std::collections::{BTreeMap, HashMap};
use std::fmt;

/// Of the points; the proof before a file is written has another one.
const SEED: u64 = 0x7665_7269_6679;

/// Proves files of one arm, set and, where they are baked in, values.
#[derive(Debug)]
pub struct Verifier {
    model: Model,
    frames: Vec<(String, Model)>,
    set: SetKind,
    language: Language,
    values: Option<Vec<f64>>,
    /// What the Lagrangian says, by function and point.
    known: RefCell<BTreeMap<(String, usize), Vec<Fp>>>,
}

/// Why a file cannot be verified.
#[derive(Debug)]
pub enum Error {
    /// The file cannot be read.
    Unreadable(Unreadable),
    /// The file was generated for another arm: the hash in the file, and the arm's.
    OtherArm(String, String),
    /// The arm's model is not to be had.
    Model(model::Error),
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Error::Unreadable(e) => e.fmt(f),
            Error::OtherArm(of_file, of_arm) => write!(
                f,
                "the file was generated for the arm {of_file}, and this arm is {of_arm}: generate it again, \
                 or give the arm file that it was generated from"
            ),
            Error::Model(e) => e.fmt(f),
        }
    }
}

impl std::error::Error for Error {}

impl From<Unreadable> for Error {
    fn from(e: Unreadable) -> Self {
        Error::Unreadable(e)
    }
}

fn read(text: &str, language: Language, arm: &Arm) -> Checked<Source> {
    let literals = Literals::read(text, &angle_symbols(arm))?;
    let frames: Vec<String> = arm.frames.iter().map(|frame| frame.name.clone()).collect();
    match language {
        Language::Rust => rust::read(text, &literals),
        Language::C | Language::Cuda => c::read(text, language == Language::Cuda, &literals, &frames),
        Language::Wgsl => wgsl::read(text, &literals, &frames),
    }
}

/// A point with what a file's functions are evaluated at.
struct Place<'p> {
    /// The point, and the one at which its input angles are zero.
    points: [Point<'p>; 2],
    angles: [HashMap<Fp, (Fp, Fp)>; 2],
    pi: Fp,
}

impl Verifier {
    /// For files like this one of an arm.
    ///
    /// # Errors
    /// As [`Error`] says.
    pub fn new(arm: Arm, language: Language, text: &str) -> Result<Verifier, Error> {
        let head = Head::read(text)?;
        let hash = format!("{:016x}", arm.hash());
        if head.arm != hash {
            return Err(Error::OtherArm(head.arm, hash));
        }
        let source = read(text, language, &arm)?;
        let has = |f: &Function| source.routines.contains_key(f.name());
        let kinematic = Function::ALL.iter().filter(|f| has(f)).all(|f| f.is_kinematic());
        let values = source.constants.get("PARAMETER_VALUES");
        // Values that are no numbers are what no file has.
        let values =
            values.map(|(_, entries)| entries.iter().map(|x| x.parse().unwrap_or(f64::NAN)).collect());
        let model = match kinematic && head.set == SetKind::Full && values.is_none() {
            true => Model::kinematic(arm),
            false => Model::derive(arm).map_err(Error::Model)?,
        };
        model.set(head.set).map_err(Error::Model)?;
        let frames =
            model.arm().frames.iter().filter_map(|f| Some((f.name.clone(), model.at_frame(&f.name)?)));
        Ok(Verifier {
            frames: frames.collect(),
            model,
            set: head.set,
            language,
            values,
            known: RefCell::default(),
        })
    }

    /// The arm's model.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// The set of the file.
    pub fn set(&self) -> SetKind {
        self.set
    }

    /// The values that are baked into the file.
    pub fn values(&self) -> Option<&[f64]> {
        self.values.as_deref()
    }

    /// Proves a file; where `only` names functions, no more than those.
    ///
    /// # Errors
    /// Where the text is nothing that dyngen writes.
    pub fn verify(&self, text: &str, only: Option<&[Function]>) -> Result<Report, Error> {
        let source = read(text, self.language, self.model.arm())?;
        let set = self.model.set(self.set).map_err(Error::Model)?;
        if let Some((module, line)) =
            source.modules.iter().find(|(m, _)| !self.frames.iter().any(|f| f.0 == *m))
        {
            return Ok(super::wrong(*line, &format!("the arm has no frame {module}"))?);
        }
        let mut report = Report { not_checked: source.not_checked.clone(), ..Report::default() };
        report.difference = self.constants(&source, set);
        let mut modules = vec![(String::new(), &self.model)];
        modules.extend(self.frames.iter().map(|(name, model)| (format!("{name}::"), model)));
        for (module, model) in modules {
            if report.difference.is_none() {
                report.difference = self.module(&source, set, &module, model, only, &mut report.proven);
            }
        }
        if report.difference.is_none() && only.is_none() {
            report.proven.extend(source.kernels);
        }
        Ok(report)
    }

    /// What the constants of the file must be.
    fn constants(&self, source: &Source, set: &ParameterSet) -> Option<Difference> {
        let arm = self.model.arm();
        let number = |n: usize| vec![n.to_string()];
        let taken = self.model.angles().taken().len();
        let right = [
            ("JOINTS", Some(number(arm.dof()))),
            ("PARAMETERS", Some(number(set.parameters.len()))),
            ("PARAMETER_NAMES", Some(set.names())),
            ("ANGLES", Some(number(taken))),
            ("JOINT_NAMES", arm.has_joint_names().then(|| arm.joint_names())),
        ];
        let found = |name: &str| source.constants.get(name);
        // In C the sizes stand in the header.
        let here = |(name, _): &(&str, _)| self.language != Language::C || name.ends_with("_NAMES");
        let differs = right
            .into_iter()
            .filter(here)
            .find(|(name, right)| found(name).map(|(_, x)| x) != right.as_ref());
        let values =
            found("PARAMETER_VALUES").map(|(_, x)| x.iter().map(|x| x.parse().ok()).collect::<Vec<_>>());
        let same = values == self.values.as_ref().map(|x| x.iter().copied().map(Some).collect());
        let name = differs.map(|(name, _)| name).or((!same).then_some("PARAMETER_VALUES"))?;
        Some(Difference {
            function: name.to_string(),
            entry: None,
            line: found(name).map_or(1, |(line, _)| *line),
            message: "is not what the arm says".to_string(),
        })
    }

    fn places<'p>(&self, model: &'p Model, set: &ParameterSet) -> Vec<Place<'p>> {
        let mut draws = Draws::new(SEED);
        let exact = |x: &f64| rational::from_f64(*x).unwrap_or_default();
        let values: Option<Vec<Rational>> = self.values.as_ref().map(|v| v.iter().map(exact).collect());
        let place = |_| {
            let pi = draws.element();
            let mut point = Point::draw(model.arm(), model.symbols(), model.sets(), &mut draws);
            if let Some(values) = &values {
                point.carry(set, values);
            }
            let points = [point.at_zero(), point];
            let [zero, drawn] = [0, 1].map(|k| angles(model, &points[k], pi));
            let [at_zero, point] = points;
            Place { points: [point, at_zero], angles: [drawn, zero], pi }
        };
        (0..POINTS).map(place).collect()
    }

    /// The functions of the file itself, or of the module of a frame.
    fn module(
        &self,
        source: &Source,
        set: &ParameterSet,
        module: &str,
        model: &Model,
        only: Option<&[Function]>,
        proven: &mut Vec<String>,
    ) -> Option<Difference> {
        let has = |f: &Function| source.routines.contains_key(&format!("{module}{f}"));
        let functions: Vec<Function> = Function::ALL.into_iter().filter(has).collect();
        let wished = |f: &Function| only.is_none_or(|only| only.contains(f));
        let symbol = |index, sine| model.sets().field.modular_symbol(index, sine);
        for (k, place) in self.places(model, set).iter().enumerate() {
            let world = |zero: usize| World {
                routines: &source.routines,
                symbol: &symbol,
                pi: place.pi,
                angles: &place.angles[zero],
            };
            let worlds = [world(0), world(1)];
            if module.is_empty()
                && let Some(difference) = trig(&worlds[0], model, set, place)
            {
                return Some(difference);
            }
            for function in functions.iter().copied().filter(wished) {
                let name = format!("{module}{function}");
                let mut right = self.known.borrow().get(&(name.clone(), k)).cloned().unwrap_or_default();
                if right.is_empty() {
                    right = compared(function, |zero| Ok(expected(&place.points[zero], set, function)))
                        .unwrap_or_default();
                    self.known.borrow_mut().insert((name.clone(), k), right.clone());
                }
                if let Some(difference) =
                    structure(source, &name, &right, function.shape(model.arm().dof(), set.parameters.len()))
                {
                    return Some(difference);
                }
                for with in [false, true] {
                    let name = format!("{name}{}", if with { "_with" } else { "" });
                    let prepared = with && self.language != Language::Rust;
                    let call =
                        Call { function, name: &name, with, prepared, baked: self.values.is_some(), set };
                    let found = compared(function, |zero| call.result(&worlds[zero], &place.points[zero]));
                    if let Some(difference) = difference(&call, &source.routines, &right, found, model) {
                        return Some(explained(difference, source));
                    }
                }
            }
        }
        if module.is_empty() {
            let shared =
                ["Trig::new", "prepare"].into_iter().filter(|name| source.routines.contains_key(*name));
            proven.extend(shared.map(str::to_string));
        }
        for function in functions.into_iter().filter(wished) {
            proven.extend([format!("{module}{function}"), format!("{module}{function}_with")]);
        }
        None
    }
}

/// What a file states about where a matrix is not zero, against the entries at a point: one that is zero at
/// random is always zero.
fn structure(
    source: &Source,
    name: &str,
    right: &[Fp],
    (rows, columns): (usize, usize),
) -> Option<Difference> {
    let (line, said) = source.constants.get(&structure_of(name))?;
    let all = (0..columns).flat_map(|j| (0..rows).map(move |i| (i, j)));
    let there = all.filter(|(i, j)| right.get(i * columns + j).is_some_and(|x| *x != Fp::ZERO));
    let there: Vec<String> = there.map(|(i, j)| format!("({i},{j})")).collect();
    (*said != there).then(|| Difference {
        function: name.to_string(),
        entry: None,
        line: *line,
        message: "has other entries that are not always zero than the file says".to_string(),
    })
}

/// A literal that nothing explains may be why.
fn explained(mut difference: Difference, source: &Source) -> Difference {
    if let Some((line, digits)) = source.unexplained.first() {
        difference.message += &format!(
            "; the number {digits} in line {line} looks rounded, and no line 'Rounded' of the head explains \
            it"
        );
    }
    difference
}

/// A result; of the potential energy, which is known up to a constant, its difference to the one at zero.
fn compared(function: Function, at: impl Fn(usize) -> Result<Vec<Fp>, Stop>) -> Result<Vec<Fp>, Stop> {
    let result = at(0)?;
    if function != Function::PotentialEnergy {
        return Ok(result);
    }
    Ok(result.iter().zip(at(1)?).map(|(x, zero)| *x - zero).collect())
}

/// A call of a file's function.
struct Call<'a> {
    function: Function,
    name: &'a str,
    /// Whether sines and cosines are passed in, and what was prepared of the parameters.
    with: bool,
    /// Whether what was prepared has a name of its own.
    prepared: bool,
    baked: bool,
    set: &'a ParameterSet,
}

impl Call<'_> {
    /// The function's result, row by row.
    fn result(&self, world: &World<'_>, point: &Point<'_>) -> Result<Vec<Fp>, Stop> {
        let Some(routine) = world.routines.get(self.name) else {
            return Err(Stop { line: 1, message: format!("there is no {}", self.name) });
        };
        let stop = |message: &str| Stop { line: routine.line, message: message.to_string() };
        let taken = |a: &&Argument| !(self.baked && **a == Argument::Parameters);
        let arguments: Vec<Argument> = self.function.arguments().iter().filter(taken).copied().collect();
        let of = |argument: Argument| {
            let numbers = point.seen_by(self.function).argument(self.set, argument);
            let value = Value::list(vec![Value::numbers(numbers)]);
            match argument {
                Argument::Positions if self.with => world.call(routine.line, "Trig::new", vec![value], 0),
                Argument::Parameters if self.with => world.call(routine.line, "prepare", vec![value], 0),
                _ => Ok(value),
            }
        };
        let name = |a: &Argument| match a {
            Argument::Positions if self.with => "trig",
            Argument::Parameters if self.prepared => "prepared",
            other => other.name(),
        };
        let named =
            routine.parameters.iter().map(|p| p.trim_start_matches('_')).eq(arguments.iter().map(name));
        if !named {
            return Err(stop("takes other arguments than dyngen writes"));
        }
        let values = arguments.into_iter().map(of).collect::<Result<_, _>>()?;
        let (rows, columns) = self.function.shape(point.dof(), self.set.parameters.len());
        by_rows(&world.call(routine.line, self.name, values, 0)?, rows, columns)
            .ok_or(stop("has a result of another shape"))
    }
}

/// The numbers of a matrix of columns, row by row; a number is a matrix of one.
fn by_rows(value: &Value, rows: usize, columns: usize) -> Option<Vec<Fp>> {
    let list = |value: &Value, length: usize| match value {
        Value::List(values) if values.len() == length => Some(values.clone()),
        _ => None,
    };
    let number = |value: &Value| if let Value::Number(x) = value { Some(*x) } else { None };
    if (rows, columns) == (1, 1)
        && let Some(x) = number(value)
    {
        return Some(vec![x]);
    }
    let matrix = list(value, columns)?;
    let matrix: Vec<_> = matrix.iter().map(|column| list(column, rows)).collect::<Option<_>>()?;
    (0..rows * columns).map(|k| number(&matrix[k % columns][k / columns])).collect()
}

fn difference(
    call: &Call<'_>,
    routines: &Routines,
    right: &[Fp],
    found: Result<Vec<Fp>, Stop>,
    model: &Model,
) -> Option<Difference> {
    let function = call.name.to_string();
    let found = match found {
        Ok(found) => found,
        Err(Stop { line, message }) => return Some(Difference { function, entry: None, line, message }),
    };
    // A Lagrangian without a value proves nothing.
    let same = |k: usize| right.len() == found.len() && right[k] == found[k];
    let wrong = (0..found.len()).find(|k| !same(*k))?;
    let columns = call.function.shape(model.arm().dof(), call.set.parameters.len()).1;
    let (row, column) = (wrong / columns, wrong % columns);
    let of = call.name.strip_suffix("_with").unwrap_or(call.name);
    let routine = routines.get(&format!("{of}_with"))?;
    let line = routine.body.line_of_entry(row, column);
    let message = "is not what the Lagrangian says".to_string();
    Some(Difference { function, entry: Some((row, column)), line, message })
}

/// Whether `Trig::new` gives the sines and cosines that its fields say.
fn trig(world: &World<'_>, model: &Model, set: &ParameterSet, place: &Place<'_>) -> Option<Difference> {
    let routine = world.routines.get("Trig::new")?;
    let difference = |line: usize, message: String| {
        Some(Difference { function: "Trig::new".to_string(), entry: None, line, message })
    };
    let q = place.points[0].argument(set, Argument::Positions);
    let found =
        match world.call(routine.line, "Trig::new", vec![Value::list(vec![Value::numbers(q.clone())])], 0) {
            Ok(Value::Record(fields)) => fields,
            Ok(_) => return difference(routine.line, "is no record".to_string()),
            Err(Stop { line, message }) => return difference(line, message),
        };
    let entry = |field: &str, k: usize| match found.iter().find(|(name, _)| name == field) {
        Some((_, Value::List(values))) => values.get(k).cloned(),
        _ => None,
    };
    let arm = model.arm();
    for (k, sum) in model.angles().taken().iter().enumerate() {
        let joints: Vec<(usize, bool)> = sum.joints().collect();
        if joints.iter().all(|(i, _)| arm.joints[*i].kind == JointKind::Revolute) {
            let (s, c) = sum_of(&place.points[0], &joints);
            if [entry("sin", k), entry("cos", k)] != [Some(Value::Number(s)), Some(Value::Number(c))] {
                return difference(routine.line, format!("has another sine or cosine of angle {}", k + 1));
            }
        }
    }
    for (i, joint) in arm.coordinates().into_iter().enumerate() {
        let slides = arm.joints[joint].kind == JointKind::Prismatic;
        if slides && entry("position", i) != Some(Value::Number(q[i])) {
            return difference(routine.line, format!("has another position of joint {}", i + 1));
        }
    }
    None
}

/// Sine and cosine of a sum of joints' input angles (`true`: minus), by the addition theorem.
fn sum_of(point: &Point<'_>, joints: &[(usize, bool)]) -> (Fp, Fp) {
    joints.iter().fold((Fp::ZERO, Fp::ONE), |(s, c), (joint, minus)| {
        let (t, d) = point.input_angle(*joint);
        let t = if *minus { -t } else { t };
        (s * d + c * t, c * d - s * t)
    })
}

/// Sine and cosine of each of the arm's angles at a point, by the angle itself. Which sums there are is a
/// hint; what they are is the arm's.
fn angles(model: &Model, point: &Point<'_>, pi: Fp) -> HashMap<Fp, (Fp, Fp)> {
    let arm = model.arm();
    let residue = |x: &Rational| Fp::from_rational(x).unwrap_or(Fp::ZERO);
    let value = |(joint, minus): &(usize, bool)| {
        let theta = match arm.joints[*joint].theta_in_angle() {
            Angle::PiMultiple(turns) => residue(&turns) * pi,
            Angle::Radians(x) => residue(&x),
        };
        let angle = point.joint_position(*joint) + theta;
        if *minus { -angle } else { angle }
    };
    let of = |joints: Vec<(usize, bool)>| {
        let angle = joints.iter().fold(Fp::ZERO, |sum, joint| sum + value(joint));
        (angle, sum_of(point, &joints))
    };
    model.angles().taken().iter().map(|sum| of(sum.joints().collect())).collect()
}
