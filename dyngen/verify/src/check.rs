//! The functions of a file against the Lagrangian, at random points of the prime field.

use crate::angles::{Affine, Circle, constant_angles, of_joint};
use crate::language::{Called, ONE_BY_ONE, Routines, Stop, Value, World, by_rows};
use crate::matrix::{reduce, times};
use crate::point::Point;
use crate::read::head::{Head, Literals};
use crate::read::{c, rust, wgsl};
use crate::{
    Angles, Checked, Difference, Report, Source, Unreadable, friction, is_structure, structure_of, sums,
};
use dyngen_arm::Language;
use dyngen_arm::arm::{Arm, JointKind};
use dyngen_arm::exact::prime::{Draws, Fp};
use dyngen_arm::exact::rational::{self, integer};
use dyngen_arm::function::{Argument, Function, Size};
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::fmt;
use std::hash::{DefaultHasher, Hash, Hasher};

/// Random points for each function. A wrong formula is a polynomial that is not zero; with degrees below 100
/// it vanishes at one point with probability below 2⁻⁵⁴.
const POINTS: usize = 2;

/// Of the points, with the text, so that another text is proven at other points. The proof before a file is
/// written has another one.
const SEED: u64 = 0x7665_7269_6679;

/// Proves files of one arm.
#[derive(Debug)]
pub struct Verifier {
    /// The arm, then with its tool at each of its frames; each with what names of functions begin with.
    arms: Vec<(String, Arm)>,
    set: String,
    language: Language,
    seed: u64,
    values: Option<Vec<f64>>,
    /// What the Lagrangian says, by function and point, where that does not depend on the file.
    known: RefCell<BTreeMap<(String, usize), Vec<Fp>>>,
}

/// Why a file cannot be verified.
#[derive(Debug)]
pub enum Error {
    /// The file cannot be read.
    Unreadable(Unreadable),
    /// The file was generated for another arm: the hash in the file, and the arm's.
    OtherArm(String, String),
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
    let literals = Literals::read(text, arm)?;
    let frames: Vec<String> = arm.frames.iter().map(|frame| frame.name.clone()).collect();
    let source = match language {
        Language::Rust => rust::read(text, &literals),
        Language::C | Language::Cuda => c::read(text, language == Language::Cuda, &literals, &frames),
        Language::Wgsl => wgsl::read(text, &literals, &frames),
    }?;
    Ok(Source { angles: angles_said(text), terms: terms_said(text), ..source })
}

/// The terms of friction in a file's comments: a list as `2. `coulomb``.
fn terms_said(text: &str) -> Vec<String> {
    let said = |line: &str| {
        let (number, term) = line.trim().trim_start_matches(['/', '*', ' ']).split_once(". `")?;
        number.parse::<usize>().ok()?;
        Some(term.strip_suffix('`')?.to_string())
    };
    text.lines().filter_map(said).collect()
}

/// The sums of coordinates that a file's comments call angles: `Angle 5: q1 − q2, across parallel axes.`
/// Those with multiples of coordinates are left out, since constants of joints that follow others are not in
/// the text.
fn angles_said(text: &str) -> Angles {
    let said = |(i, line): (usize, &str)| {
        let (number, rest) =
            line.trim_start_matches(['/', '*', ' ']).strip_prefix("Angle ")?.split_once(": ")?;
        let sum = rest.strip_suffix(", across parallel axes.")?;
        let term = |term: &str| {
            let (sign, name) = term.strip_prefix("- ").map_or((1, term), |name| (-1, name));
            Some((name.strip_prefix('q')?.parse::<usize>().ok()?.checked_sub(1)?, sign))
        };
        let signed = sum.replace(" − ", "|- ").replace(" + ", "|");
        let terms = signed.split('|').map(term).collect::<Option<Vec<_>>>()?;
        Some((number.parse::<usize>().ok()?.checked_sub(1)?, (i + 1, terms)))
    };
    text.lines().enumerate().filter_map(said).collect()
}

/// The entries of a constant as numbers; one that is no number is what no file has.
fn numbers(entries: &[String]) -> Vec<f64> {
    entries.iter().map(|x| x.parse().unwrap_or(f64::NAN)).collect()
}

/// A point, the one at which its angles are zero, and the sums of parameters there.
struct Place<'p> {
    points: [Point<'p>; 2],
    sums: Vec<Vec<Fp>>,
}

impl Verifier {
    /// For files like this one of an arm; the text decides the random points.
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
        has_sines(&arm)?;
        let values = source.constants.get("PARAMETER_VALUES").map(|(_, entries)| numbers(entries));
        let at_frame = |name: &str| Some((format!("{name}::"), arm.at_frame(name)?));
        let frames: Vec<_> = arm.frames.iter().filter_map(|frame| at_frame(&frame.name)).collect();
        let arms = std::iter::once((String::new(), arm)).chain(frames).collect();
        let mut hasher = DefaultHasher::new();
        text.hash(&mut hasher);
        let seed = SEED ^ hasher.finish();
        Ok(Verifier { arms, set: head.set, language, seed, values, known: RefCell::default() })
    }

    /// The name of the set of the file.
    pub fn set(&self) -> &str {
        &self.set
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
        let source = read(text, self.language, &self.arms[0].1)?;
        let is_there = |module: &str| self.arms.iter().any(|(name, _)| *name == format!("{module}::"));
        if let Some((module, line)) = source.modules.iter().find(|(module, _)| !is_there(module)) {
            return Ok(crate::wrong(*line, &format!("the arm has no frame {module}"))?);
        }
        let mut report = Report { not_checked: source.not_checked.clone(), ..Report::default() };
        let called = Called::default();
        report.difference = self.constants(&source);
        for (module, arm) in &self.arms {
            if report.difference.is_none() {
                report.difference = self.module(&source, module, arm, only, &called, &mut report.proven);
            }
        }
        if report.difference.is_none() && only.is_none() {
            let arm = &self.arms[0].1;
            report.difference = friction::check(&source, arm, self.seed, &called, &mut report.proven)
                .or_else(|| superfluous(&source, &called, &report.proven));
            report.proven.extend(source.kernels);
        }
        Ok(report)
    }

    /// What the constants of the file must be.
    fn constants(&self, source: &Source) -> Option<Difference> {
        let arm = &self.arms[0].1;
        let found = |name: &str| source.constants.get(name);
        let names = found("PARAMETER_NAMES").map_or(0, |(_, names)| names.len());
        let said = match self.set.as_str() {
            "full" => Some(arm.kept_parameters().iter().map(ToString::to_string).collect()),
            "published" => Some(arm.groupings.iter().map(|grouping| grouping.name.clone()).collect()),
            // Which sums they are is proven.
            _ => found("PARAMETER_NAMES").map(|(_, names)| names.clone()),
        };
        let right = [
            ("PARAMETER_NAMES", said),
            ("JOINTS", Some(vec![arm.dof().to_string()])),
            ("PARAMETERS", Some(vec![names.to_string()])),
            // How many there are is compared where they are made.
            ("ANGLES", Some(found("ANGLES").map_or(Vec::new(), |(_, said)| said.clone()))),
            ("JOINT_NAMES", arm.has_joint_names().then(|| arm.joint_names())),
        ];
        // In C the sizes stand in the header.
        let here = |(name, _): &(&str, _)| self.language != Language::C || name.ends_with("_NAMES");
        let differs = right
            .into_iter()
            .filter(here)
            .find(|(name, right)| found(name).map(|(_, x)| x) != right.as_ref());
        let values = found("PARAMETER_VALUES").map(|(_, entries)| numbers(entries));
        let other = (values != self.values).then_some("PARAMETER_VALUES");
        let name = differs.map(|(name, _)| name).or(other)?;
        Some(Difference {
            function: name.to_string(),
            entry: None,
            line: found(name).map_or(1, |(line, _)| *line),
            message: "is not what the arm says".to_string(),
        })
    }

    fn places<'p>(&self, source: &Source, arm: &'p Arm) -> Result<Vec<Place<'p>>, Difference> {
        let none = (1, Vec::new());
        let (line, names) = source.constants.get("PARAMETER_NAMES").unwrap_or(&none);
        let wrong = |message: String| Difference {
            function: "PARAMETER_NAMES".to_string(),
            entry: None,
            line: *line,
            message,
        };
        let (mut draws, constants) = (Draws::new(self.seed), constant_angles(&self.arms[0].1));
        let mut place = || {
            let mut point = Point::draw(arm, &constants, &mut draws);
            let of = |name: &String| {
                let sum = sums::of_name(name, arm, &point.circle);
                sum.ok_or_else(|| wrong(format!("has {name}, which is no sum of the arm's parameters")))
            };
            let sums = names.iter().map(of).collect::<Result<Vec<_>, _>>()?;
            if let Some(values) = &self.values {
                let exact = |x: &f64| rational::from_f64(*x).and_then(|x| Fp::from_rational(&x));
                let wanted: Option<Vec<Fp>> = values.iter().map(exact).collect();
                let values = wanted.and_then(|wanted| sums::with_sums(&sums, &wanted, &point.values));
                point.values = values.ok_or_else(|| wrong("has sums without values of their own".into()))?;
            }
            Ok(Place { points: [point.clone(), point.at_zero()], sums })
        };
        (0..POINTS).map(|_| place()).collect()
    }

    /// The functions of the file itself, or of the module of a frame.
    fn module(
        &self,
        source: &Source,
        module: &str,
        arm: &Arm,
        only: Option<&[Function]>,
        called: &Called,
        proven: &mut Vec<String>,
    ) -> Option<Difference> {
        let has = |f: &Function| {
            ["", "_with"].iter().any(|end| source.routines.contains_key(&format!("{module}{f}{end}")))
        };
        let wished = |f: &Function| only.is_none_or(|only| only.contains(f));
        let functions: Vec<Function> = Function::ALL.into_iter().filter(has).filter(wished).collect();
        let places = match self.places(source, arm) {
            Ok(places) => places,
            Err(difference) => return Some(difference),
        };
        for (k, place) in places.iter().enumerate() {
            let world = |point| World { routines: &source.routines, point, called };
            let worlds = place.points.each_ref().map(world);
            if module.is_empty() && !self.sums_determine_torques(place, k) {
                let line = source.constants.get("PARAMETER_NAMES").map_or(1, |(line, _)| *line);
                let message = "has sums that do not determine the torques of the arm".to_string();
                return Some(Difference { function: "PARAMETER_NAMES".into(), entry: None, line, message });
            }
            if module.is_empty()
                && let Some(difference) = trig(&worlds[0], place, source)
            {
                return Some(difference);
            }
            for function in functions.iter().copied() {
                let name = format!("{module}{function}");
                let Some(right) = self.expected(place, k, &name, function) else {
                    let mut calls = self.calls(source, &name, function).into_iter();
                    let line = calls.find_map(|call| source.routines.get(&call.name)).map_or(1, |r| r.line);
                    let message = "has no value for this arm".to_string();
                    return Some(Difference { function: name, entry: None, line, message });
                };
                for call in self.calls(source, &name, function) {
                    let found = compared(function, |zero| call.result(&worlds[zero], place));
                    let difference = match &found {
                        Err(Stop { line, message }) => Some(Difference {
                            function: call.name.clone(),
                            entry: None,
                            line: *line,
                            message: message.clone(),
                        }),
                        Ok(found) => difference(&call, place, &source.routines, &right, found)
                            .or_else(|| structure(source, &name, found, call.shape(place))),
                    };
                    if let Some(difference) = difference {
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
        for function in functions {
            let calls = self.calls(source, &format!("{module}{function}"), function);
            let whole = calls.into_iter().filter(|call| call.form != Form::OneByOne);
            proven.extend(whole.map(|call| call.name));
        }
        None
    }

    /// What the Lagrangian says of a function at a point; nothing where it has no value.
    fn expected(&self, place: &Place<'_>, k: usize, name: &str, function: Function) -> Option<Vec<Fp>> {
        let key = (name.to_string(), k);
        // Values that are baked in belong to the names of a file.
        if let Some(known) = self.known.borrow().get(&key).filter(|_| self.values.is_none()) {
            return Some(known.clone());
        }
        let none = || Stop { line: 1, message: String::new() };
        let right = compared(function, |zero| place.points[zero].expected(function).ok_or_else(none)).ok()?;
        self.known.borrow_mut().insert(key, right.clone());
        Some(right)
    }

    /// Whether the sums of the set determine the torques: the regressor of all the arm's parameters is a
    /// combination of them.
    fn sums_determine_torques(&self, place: &Place<'_>, k: usize) -> bool {
        let arm = place.points[0].arm;
        let parameters = arm.all_parameters();
        let (mut sums, all) = (place.sums.clone(), parameters.len());
        let pivots = reduce(&mut sums, all);
        let Some(regressor) = self.expected(place, k, Function::Regressor.name(), Function::Regressor) else {
            return false;
        };
        let is_combination = |row: &[Fp]| {
            let rest = pivots.iter().zip(&sums).fold(row.to_vec(), |rest, (pivot, sum)| {
                rest.iter().zip(sum).map(|(x, y)| *x - row[*pivot] * *y).collect()
            });
            rest.iter().zip(&parameters).all(|(x, p)| *x == Fp::ZERO || !arm.keeps(*p))
        };
        regressor.chunks(all).all(is_combination)
    }

    /// The ways in which a file has a function.
    fn calls(&self, source: &Source, name: &str, function: Function) -> Vec<Call> {
        let (module, of) = name.rsplit_once("::").map_or(("", name), |(module, of)| (module, of));
        let batch = format!("{module}{}batch::{of}", if module.is_empty() { "" } else { "::" });
        let with = match self.language {
            Language::Rust => Form::With,
            _ => Form::WithPrepared,
        };
        let call = |form, name| Call { function, name, form, baked: self.values.is_some() };
        let mut calls = vec![call(Form::Plain, name.to_string()), call(with, format!("{name}_with"))];
        for (form, name) in [(Form::Batch, batch.clone()), (Form::OneByOne, batch + ONE_BY_ONE)] {
            calls.extend(source.routines.contains_key(&name).then(|| call(form, name)));
        }
        calls
    }
}

/// Whether the sine of each joint's angle can be formed, on which the Lagrangian relies.
fn has_sines(arm: &Arm) -> Checked<()> {
    let circle = Circle::draw(arm, &constant_angles(arm), &mut Draws::new(SEED));
    let lacks = |i: &usize| {
        arm.joints[*i].kind == JointKind::Revolute && circle.sine_and_cosine(&of_joint(arm, *i)).is_none()
    };
    match (0..arm.joints.len()).find(lacks) {
        Some(i) => crate::wrong(1, &format!("the sine of the angle of joint {} cannot be formed", i + 1)),
        None => Ok(()),
    }
}

/// What a file has and nothing has looked at: a function that was not called, or the structure of one that is
/// not proven.
fn superfluous(source: &Source, called: &Called, proven: &[String]) -> Option<Difference> {
    let called = called.borrow();
    let routine = source.routines.iter().find(|(name, _)| !called.contains(name.as_str()));
    let routine = routine.map(|(name, routine)| (name, routine.line));
    let is_proven = |name: &str| proven.iter().any(|function| structure_of(function) == name);
    let constant = || source.constants.iter().find(|(name, _)| is_structure(name) && !is_proven(name));
    let (name, line) = routine.or_else(|| constant().map(|(name, (line, _))| (name, *line)))?;
    let message = "is nothing that a file has here".to_string();
    Some(Difference { function: name.clone(), entry: None, line, message })
}

/// What a file states about where a matrix is not zero, against the entries at a point, which are proven: one
/// that is zero at random is always zero.
fn structure(
    source: &Source,
    name: &str,
    found: &[Fp],
    (rows, columns): (usize, usize),
) -> Option<Difference> {
    let (line, said) = source.constants.get(&structure_of(name))?;
    let all = (0..columns).flat_map(|j| (0..rows).map(move |i| (i, j)));
    let there = all.filter(|(i, j)| found.get(i * columns + j).is_some_and(|x| *x != Fp::ZERO));
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
    if function != Function::PotentialEnergy && function != Function::PotentialEnergyRegressor {
        return Ok(result);
    }
    Ok(result.iter().zip(at(1)?).map(|(x, zero)| *x - zero).collect())
}

/// A form in which a file has a function.
#[derive(Clone, Copy, PartialEq)]
enum Form {
    /// It takes the positions and the parameters.
    Plain,
    /// It takes sines and cosines, and what was prepared of the parameters under their name.
    With,
    /// It takes what was prepared under its own name.
    WithPrepared,
    /// For many samples, of which one is evaluated.
    Batch,
    /// Its way for samples whose angles are large.
    OneByOne,
}

/// A call of a file's function.
struct Call {
    function: Function,
    name: String,
    form: Form,
    baked: bool,
}

impl Call {
    /// Rows and columns of the result.
    fn shape(&self, place: &Place<'_>) -> (usize, usize) {
        self.function.shape(place.points[0].dof(), place.sums.len())
    }

    /// The function's result, row by row.
    fn result(&self, world: &World<'_>, place: &Place<'_>) -> Result<Vec<Fp>, Stop> {
        let Some(routine) = world.routines.get(&self.name) else {
            return Err(Stop { line: 1, message: format!("there is no {}", self.name) });
        };
        let stop = |message: &str| Stop { line: routine.line, message: message.to_string() };
        let with = matches!(self.form, Form::With | Form::WithPrepared);
        let taken = |a: &&Argument| !(self.baked && **a == Argument::Parameters);
        let arguments: Vec<Argument> = self.function.arguments().iter().filter(taken).copied().collect();
        let of = |argument: Argument| {
            let numbers = world.point.argument(self.function, argument, &place.sums);
            let flat = match argument {
                Argument::Positions => Value::positions(&numbers),
                _ => Value::numbers(numbers),
            };
            let in_batch = matches!(self.form, Form::Batch | Form::OneByOne);
            // Of a batch each number is an array over the samples, and parameters are a vector.
            let value = match in_batch && argument != Argument::Parameters {
                true => flat,
                false => Value::list(vec![flat]),
            };
            match argument {
                Argument::Positions if with => world.call(routine.line, "Trig::new", vec![value], 0),
                Argument::Parameters if with => world.call(routine.line, "prepare", vec![value], 0),
                _ => Ok(value),
            }
        };
        let name = |a: &Argument| match a {
            Argument::Positions if with => "trig",
            Argument::Parameters if self.form == Form::WithPrepared => "prepared",
            other => other.name(),
        };
        let named =
            routine.parameters.iter().map(|p| p.trim_start_matches('_')).eq(arguments.iter().map(name));
        if !named {
            return Err(stop("takes other arguments than dyngen writes"));
        }
        let values = arguments.into_iter().map(of).collect::<Result<_, _>>()?;
        let (rows, columns) = self.shape(place);
        by_rows(&world.call(routine.line, &self.name, values, 0)?, rows, columns)
            .ok_or(stop("has a result of another shape"))
    }
}

/// Where a result differs. What has a row or a column for each parameter of the set is, times the sums of the
/// set, what the Lagrangian says of all the arm's parameters.
fn difference(
    call: &Call,
    place: &Place<'_>,
    routines: &Routines,
    right: &[Fp],
    found: &[Fp],
) -> Option<Difference> {
    let all = 11 * place.points[0].arm.bodies();
    let by_parameter = matches!(call.function.size(), (_, Size::Parameters) | (Size::Parameters, _));
    let (_, columns) = call.shape(place);
    let entry = if by_parameter {
        let sums = place.sums.concat();
        let found =
            if sums.is_empty() { vec![Fp::ZERO; right.len()] } else { times(found, &sums, place.sums.len()) };
        let keeps = |k: usize| place.points[0].arm.keeps(place.points[0].arm.all_parameters()[k % all]);
        let wrong = (0..right.len()).find(|k| keeps(*k) && found.get(*k) != Some(&right[*k]))?;
        // The parameter of the set in whose sum that parameter of the arm occurs first.
        let column = place.sums.iter().position(|sum| sum[wrong % all] != Fp::ZERO).unwrap_or(0);
        if columns == 1 && call.function.size().0 == Size::Parameters {
            (column, 0)
        } else {
            (wrong / all, column)
        }
    } else {
        let same = |k: usize| right.len() == found.len() && right[k] == found[k];
        let wrong = (0..found.len()).find(|k| !same(*k))?;
        (wrong / columns, wrong % columns)
    };
    let of = call.name.replace("batch::", "").replace(ONE_BY_ONE, "");
    let routine = routines.get(&format!("{}_with", of.strip_suffix("_with").unwrap_or(&of)))?;
    Some(Difference {
        function: call.name.clone(),
        entry: Some(entry),
        line: routine.body.line_of_entry(entry.0, entry.1),
        message: "is not what the Lagrangian says".to_string(),
    })
}

/// Whether `Trig::new` gives the sines and cosines of the joints that move on their own, each with its theta
/// where that is no quarter turn, and the positions of those that slide.
fn trig(world: &World<'_>, place: &Place<'_>, source: &Source) -> Option<Difference> {
    let routine = world.routines.get("Trig::new")?;
    let difference = |line: usize, message: String| {
        Some(Difference { function: "Trig::new".to_string(), entry: None, line, message })
    };
    let point = &place.points[0];
    let found =
        match world.call(routine.line, "Trig::new", vec![Value::list(vec![Value::positions(&point.q)])], 0) {
            Ok(Value::Record(fields)) => fields,
            Ok(_) => return difference(routine.line, "is no record".to_string()),
            Err(Stop { line, message }) => return difference(line, message),
        };
    let field =
        |field: &str| found.iter().find(|(name, _)| name == field).and_then(|(_, list)| list.as_list());
    let entry = |of: &str, k: usize| field(of)?.get(k)?.as_number();
    if let Some((line, said)) = source.constants.get("ANGLES")
        && ["sin", "cos"]
            .iter()
            .any(|of| field(of).map(|list| vec![list.len().to_string()]).as_ref() != Some(said))
    {
        return difference(*line, "has another number of angles than ANGLES says".to_string());
    }
    let slides = |coordinate: usize| {
        let mut of = point.arm.drives().into_iter().zip(&point.arm.joints);
        of.any(|(drive, joint)| drive.coordinate == coordinate && joint.kind == JointKind::Prismatic)
    };
    for (i, joint) in point.arm.coordinates().into_iter().enumerate() {
        // What nobody reads is zero; in C it may be left out behind what is read.
        let unread = [None, Some(Fp::ZERO)];
        let turned = match point.arm.joints[joint].kind {
            JointKind::Revolute => {
                let (s, c) = point.circle.of_coordinate(i);
                [entry("sin", i), entry("cos", i)] == [Some(s), Some(c)]
            }
            JointKind::Prismatic => ["sin", "cos"].iter().all(|of| unread.contains(&entry(of, i))),
        };
        if !turned {
            return difference(routine.line, format!("has another sine or cosine of angle {}", i + 1));
        }
        let at = entry("position", i);
        if !(if slides(i) { at == Some(point.q[i]) } else { unread.contains(&at) }) {
            return difference(routine.line, format!("has another position of joint {}", i + 1));
        }
    }
    for (k, (line, terms)) in &source.angles {
        // A coordinate of a sum stands for its joint's angle.
        let sum = terms.iter().try_fold(Affine::default(), |sum, (coordinate, sign)| {
            let angle =
                Affine::coordinate(*coordinate).plus(&integer(1), point.circle.added_to(*coordinate)?);
            Some(sum.plus(&integer(*sign), &angle))
        });
        let right = sum.and_then(|sum| point.circle.sine_and_cosine(&sum));
        if right.is_none_or(|(s, c)| [entry("sin", *k), entry("cos", *k)] != [Some(s), Some(c)]) {
            return difference(
                *line,
                format!("has another sine or cosine of angle {} than said here", k + 1),
            );
        }
    }
    None
}
