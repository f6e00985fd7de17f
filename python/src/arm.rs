//! An arm with its model, derived when it is first needed, and its functions.

use crate::evaluate::{States, evaluate};
use crate::failure::{input, refused, value};
use crate::work;
use dyngen::arm::{Convention, JointKind};
use dyngen::describe::{Description, sets_json};
use dyngen::dynamics::function::Argument;
use dyngen::exact::rational;
use dyngen::import::{self, Options};
use dyngen::{Evaluator, Function, Model, SetKind, Values};
use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// The robot description that an arm was imported from.
#[derive(Clone, Debug)]
pub(crate) struct Origin {
    pub(crate) text: String,
    pub(crate) file: String,
    pub(crate) options: Options,
    pub(crate) mjcf: bool,
}

/// An arm: its file, and what was derived of it so far.
#[pyclass(frozen, module = "powerball._core")]
pub(crate) struct Arm {
    pub(crate) arm: dyngen::Arm,
    pub(crate) origin: Option<Origin>,
    /// The arm file, where the arm is of one.
    pub(crate) file: Option<PathBuf>,
    text: String,
    pub(crate) values: Vec<(String, f64)>,
    base: Option<[[f64; 4]; 4]>,
    notes: Vec<String>,
    model: OnceLock<Arc<Model>>,
    evaluators: Mutex<BTreeMap<(&'static str, SetKind), Arc<Evaluator>>>,
}

/// Position limits, velocity, acceleration, torque, torque constant: what the file states about a joint.
type Limits = (Option<[f64; 2]>, Option<f64>, Option<f64>, Option<f64>, Option<f64>);

impl Arm {
    fn new(arm: dyngen::Arm, text: String) -> Arm {
        Arm {
            notes: arm.notes(),
            arm,
            origin: None,
            file: None,
            text,
            values: Vec::new(),
            base: None,
            model: OnceLock::new(),
            evaluators: Mutex::default(),
        }
    }

    /// The model with its parameter sets.
    pub(crate) fn model(&self, py: Python<'_>) -> PyResult<Arc<Model>> {
        if let Some(model) = self.model.get() {
            return Ok(Arc::clone(model));
        }
        let arm = self.arm.clone();
        let model = work::run(py, None, move |_| Model::derive(arm))?.map_err(refused)?;
        Ok(Arc::clone(self.model.get_or_init(|| Arc::new(model))))
    }

    /// A function, built and proven when it is first asked for.
    fn evaluator(&self, py: Python<'_>, function: Function, kind: SetKind) -> PyResult<Arc<Evaluator>> {
        // Kinematics is the same for every set.
        let kind = if function.is_kinematic() { SetKind::Full } else { kind };
        let key = (function.name(), kind);
        let known = self.evaluators.lock().unwrap_or_else(PoisonError::into_inner).get(&key).cloned();
        if let Some(evaluator) = known {
            return Ok(evaluator);
        }
        let model = match function.is_kinematic() {
            true => Arc::new(Model::kinematic(self.arm.clone())),
            false => self.model(py)?,
        };
        let built = work::run(py, None, move |_| Evaluator::new(&model, function, kind))?.map_err(refused)?;
        let mut evaluators = self.evaluators.lock().unwrap_or_else(PoisonError::into_inner);
        Ok(Arc::clone(evaluators.entry(key).or_insert(Arc::new(built))))
    }
}

/// A parameter set by its name.
pub(crate) fn set_kind(name: &str) -> PyResult<SetKind> {
    let names = SetKind::ALL.map(SetKind::name).join(", ");
    SetKind::parse(name)
        .ok_or_else(|| value(format!("parameters must be one of {names}; there is no set '{name}'")))
}

/// A function by its name.
pub(crate) fn function(name: &str) -> PyResult<Function> {
    let names = Function::ALL.map(Function::name).join(", ");
    Function::parse(name).ok_or_else(|| value(format!("there is no function '{name}': there are {names}")))
}

/// Parameter values by name, from a file or as they are.
pub(crate) fn named_values(file: Option<PathBuf>, named: &BTreeMap<String, f64>) -> PyResult<Values> {
    if let Some(file) = file {
        return Values::read(&file).map_err(input);
    }
    if let Some((name, x)) = named.iter().find(|(_, x)| !x.is_finite()) {
        return Err(value(format!("values must be finite numbers: '{name}' is {x}")));
    }
    Ok(Values::named(named.iter().map(|(name, x)| (name.as_str(), *x)), "values"))
}

#[pymethods]
impl Arm {
    /// An arm from the text of an arm file: its name in errors, and where it is.
    #[staticmethod]
    fn parse(text: String, file: &str, place: Option<PathBuf>) -> PyResult<Arm> {
        let arm = Arm::new(dyngen::Arm::parse(&text, file).map_err(input)?, text);
        Ok(Arm { file: place, ..arm })
    }

    /// An arm from the text of a URDF or of a MuJoCo model.
    #[staticmethod]
    #[pyo3(signature = (text, file, mjcf, base, tip, lock, exact, convention, angle_tolerance))]
    fn import_from(
        text: String,
        file: String,
        mjcf: bool,
        base: Option<String>,
        tip: Option<String>,
        lock: Vec<(String, f64)>,
        exact: bool,
        convention: &str,
        angle_tolerance: f64,
    ) -> PyResult<Arm> {
        let convention = match convention {
            "modified" => Convention::Modified,
            "standard" => Convention::Standard,
            other => {
                return Err(value(format!("convention must be 'modified' or 'standard', not '{other}'")));
            }
        };
        if !(0.0..=0.01).contains(&angle_tolerance) {
            return Err(value("angle_tolerance must be a number of radians from 0 to 0.01"));
        }
        let options = Options { base, lock, tip, convention, angle_tolerance, exact };
        let read = if mjcf { import::mjcf } else { import::urdf };
        let imported = read(&text, &file, &options).map_err(input)?;
        let mut arm = Arm::new(imported.arm, imported.text);
        arm.notes.splice(0..0, imported.notes);
        arm.values = imported.values.iter().map(|(p, x)| (p.to_string(), *x)).collect();
        arm.base = Some(imported.base);
        arm.origin = Some(Origin { text, file, options, mjcf });
        Ok(arm)
    }

    #[getter]
    fn name(&self) -> &str {
        &self.arm.name
    }

    #[getter]
    fn dof(&self) -> usize {
        self.arm.dof()
    }

    #[getter]
    fn joint_names(&self) -> Vec<String> {
        self.arm.joint_names()
    }

    #[getter]
    fn joint_kinds(&self) -> Vec<&'static str> {
        let kind = |joint: &dyngen::arm::Joint| match joint.kind {
            JointKind::Revolute => "revolute",
            JointKind::Prismatic => "prismatic",
        };
        self.arm.moving_joints().map(kind).collect()
    }

    #[getter]
    fn limits(&self) -> Vec<Limits> {
        let of =
            |j: &dyngen::arm::Joint| (j.position, j.velocity, j.acceleration, j.torque, j.torque_constant);
        self.arm.moving_joints().map(of).collect()
    }

    #[getter]
    fn gravity_vector(&self) -> [f64; 3] {
        self.arm.gravity.each_ref().map(rational::to_f64)
    }

    #[getter]
    fn parameters(&self) -> Vec<String> {
        self.arm.kept_parameters().iter().map(ToString::to_string).collect()
    }

    #[getter]
    fn text(&self) -> &str {
        &self.text
    }

    #[getter]
    fn notes(&self) -> Vec<String> {
        self.notes.clone()
    }

    /// The values of a robot description, in order.
    #[getter]
    fn values(&self) -> Vec<(String, f64)> {
        self.values.clone()
    }

    /// Frame 0 in the root link of a robot description.
    #[getter]
    fn base(&self) -> Option<[[f64; 4]; 4]> {
        self.base
    }

    /// The names of its frames.
    #[getter]
    fn frames(&self) -> Vec<String> {
        self.arm.frames.iter().map(|frame| frame.name.clone()).collect()
    }

    /// This arm with its tool at one of its frames.
    fn at_frame(&self, name: &str) -> PyResult<Arm> {
        let arm = self.arm.at_frame(name).ok_or_else(|| {
            value(format!("the arm has no frame '{name}': it has {}", self.frames().join(", ")))
        })?;
        let model = OnceLock::new();
        if let Some(derived) = self.model.get().and_then(|model| model.at_frame(name)) {
            model.get_or_init(|| Arc::new(derived));
        }
        Ok(Arm {
            arm,
            origin: None,
            file: self.file.clone(),
            text: self.text.clone(),
            values: self.values.clone(),
            base: self.base,
            notes: self.notes.clone(),
            model,
            evaluators: Mutex::default(),
        })
    }

    /// What `dyngen describe --json` prints.
    fn describe(&self, py: Python<'_>) -> PyResult<String> {
        let model = self.model(py)?;
        let describe = move |_: powerball::logs::Progress<'_>| {
            Description::of(&model).map(|description| description.json(&model).to_string())
        };
        work::run(py, None, describe)?.map_err(refused)
    }

    /// The sets of `describe` alone.
    fn sets(&self, py: Python<'_>) -> PyResult<String> {
        Ok(sets_json(&*self.model(py)?).to_string())
    }

    /// The values of a set's parameters, in order.
    fn set_values<'py>(
        &self,
        py: Python<'py>,
        set: &str,
        file: Option<PathBuf>,
        named: BTreeMap<String, f64>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let (kind, model) = (set_kind(set)?, self.model(py)?);
        let set = model.set(kind).map_err(refused)?;
        let values = named_values(file, &named)?.of_set(&model, set).map_err(input)?;
        Ok(PyArray1::from_vec(py, values))
    }

    /// Whether a real arm can have values: possible, reasons, pose, least eigenvalue of the mass matrix.
    fn check(
        &self,
        py: Python<'_>,
        file: Option<PathBuf>,
        named: BTreeMap<String, f64>,
    ) -> PyResult<(bool, Vec<String>, Vec<f64>, f64)> {
        let model = self.model(py)?;
        let (kind, values) = named_values(file, &named)?.recognise(&model).map_err(input)?;
        let check = move |_: powerball::logs::Progress<'_>| dyngen::consistency::check(&model, kind, &values);
        let verdict = work::run(py, None, check)?.map_err(refused)?;
        Ok((verdict.possible, verdict.reasons, verdict.pose, verdict.min_eigenvalue))
    }

    /// A function over states of shape (n,) or (N, n); `parameters` in the order of the set.
    fn evaluate<'py>(
        &self,
        py: Python<'py>,
        name: &str,
        set: &str,
        states: States<'py>,
        parameters: Option<PyReadonlyArray1<'py, f64>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (function, kind) = (function(name)?, set_kind(set)?);
        let evaluator = self.evaluator(py, function, kind)?;
        let parameters = match (&parameters, function.takes(Argument::Parameters)) {
            (Some(given), true) => given.as_slice().map_err(|_| value("values must be C-contiguous"))?,
            _ => &[],
        };
        if function.takes(Argument::Parameters) {
            let count = self.model(py)?.set(kind).map_err(refused)?.parameters.len();
            if parameters.len() != count {
                let given = parameters.len();
                return Err(value(format!(
                    "values must have shape ({count},) for the set {kind}, it has ({given},)"
                )));
            }
            if let Some(at) = parameters.iter().position(|x| !x.is_finite()) {
                return Err(value(format!(
                    "values must be finite, shape ({count},): {} at [{at}]",
                    parameters[at]
                )));
            }
        }
        evaluate(py, &evaluator, self.arm.dof(), &states, parameters)
    }
}
