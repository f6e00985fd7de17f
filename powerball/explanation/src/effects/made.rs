//! Columns of one data set that were made already: every step of a search needs most of them again.

use super::Candidate;
use super::Settings;
use powerball_controller::JointNumber;
use powerball_controller::correction::Law;
use powerball_logs::regression::Column;
use std::collections::HashMap;
use std::mem::{Discriminant, discriminant, size_of};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// Largest memory for columns of laws of the motion, bytes. Further columns are computed each time.
const MOST: usize = 96 << 20;
/// Largest memory for columns of one model, bytes.
const MOST_OF_MODEL: usize = 32 << 20;
/// Models of which something is kept: the one that is searched with, the one before it, and those that are
/// tried next to it.
const MODELS: usize = 3;

/// The columns that were made of one data set.
#[derive(Debug, Default)]
pub(crate) struct Made {
    /// Columns of laws of the motion alone, by joint.
    pub(super) motion: ByLaw<JointNumber, Vec<f64>>,
    /// Columns of laws that are the same on every joint, after a band's filter, by recording and cutoff, Hz.
    pub(super) passed: ByLaw<f64, Vec<Vec<f64>>>,
    /// Columns of the last few models; the model that was used last is at the end.
    models: Mutex<Vec<Arc<OfModel>>>,
}

impl Made {
    /// The columns of a model with these coefficients and friction steepnesses; empty if none were made.
    pub(super) fn of_model(&self, theta: &[f64], shapes: &[[f64; 2]]) -> Arc<OfModel> {
        let mut models = self.models.lock().unwrap_or_else(PoisonError::into_inner);
        let known = models.iter().position(|model| model.theta == theta && model.shapes == shapes);
        let model = known.map_or_else(|| Arc::new(OfModel::new(theta, shapes)), |k| models.remove(k));
        models.push(Arc::clone(&model));
        if models.len() > MODELS {
            models.remove(0);
        }
        model
    }
}

/// Torques of a fitted model along the recordings of one data set, and the columns of candidates with it.
#[derive(Debug)]
pub(super) struct OfModel {
    theta: Vec<f64>,
    shapes: Vec<[f64; 2]>,
    /// By recording, n a sample, N·m.
    pub(super) rigid: OnceLock<Vec<Vec<f64>>>,
    pub(super) friction: OnceLock<Vec<Vec<f64>>>,
    pub(super) prediction: OnceLock<Vec<Vec<f64>>>,
    columns: Mutex<Columns>,
}

/// The joints and the effect of a candidate: others need not be compared.
type Key = (Vec<JointNumber>, Discriminant<Settings>);

#[derive(Debug, Default)]
struct Columns {
    made: HashMap<Key, Vec<(Candidate, Vec<Column>)>>,
    bytes: usize,
}

impl OfModel {
    pub(super) fn new(theta: &[f64], shapes: &[[f64; 2]]) -> OfModel {
        OfModel {
            theta: theta.to_vec(),
            shapes: shapes.to_vec(),
            rigid: OnceLock::new(),
            friction: OnceLock::new(),
            prediction: OnceLock::new(),
            columns: Mutex::default(),
        }
    }

    /// The columns of a candidate; `make` makes them where they have not been made.
    pub(super) fn columns(&self, candidate: &Candidate, make: impl FnOnce() -> Vec<Column>) -> Vec<Column> {
        let key = (candidate.joints.clone(), discriminant(&candidate.settings));
        let same =
            |known: &Candidate| known.settings == candidate.settings && known.windows == candidate.windows;
        let known = |made: &Columns| {
            let (_, columns) = made.made.get(&key)?.iter().find(|(known, _)| same(known))?;
            Some(columns.clone())
        };
        if let Some(columns) = known(&self.columns.lock().unwrap_or_else(PoisonError::into_inner)) {
            return columns;
        }
        // Other threads continue while they are made.
        let columns = make();
        let bytes: usize =
            columns.iter().flat_map(|c| &c.parts).map(|(_, v)| size_of::<f64>() * v.len()).sum();
        let mut made = self.columns.lock().unwrap_or_else(PoisonError::into_inner);
        if made.bytes + bytes <= MOST_OF_MODEL && known(&made).is_none() {
            made.bytes += bytes;
            made.made.entry(key).or_default().push((candidate.clone(), columns.clone()));
        }
        columns
    }
}

/// Values by a key with a law of the motion alone: changes of the model do not change them.
#[derive(Debug)]
pub(super) struct ByLaw<K, V> {
    made: Mutex<Laws<K, V>>,
}

#[derive(Debug)]
struct Laws<K, V> {
    /// By kind of law: others need not be compared.
    made: HashMap<Discriminant<Law<f64>>, Vec<Known<K, V>>>,
    bytes: usize,
}

#[derive(Debug)]
struct Known<K, V> {
    of: (K, Law<f64>),
    values: Arc<V>,
}

impl<K, V> Default for ByLaw<K, V> {
    fn default() -> Self {
        ByLaw { made: Mutex::new(Laws { made: HashMap::new(), bytes: 0 }) }
    }
}

impl<K: PartialEq, V: Size> ByLaw<K, V> {
    /// The values of a law; `make` computes them at the first use. Laws of torques change with the model and
    /// are computed each time.
    pub(super) fn get(&self, key: (K, Law<f64>), make: impl FnOnce() -> V) -> Arc<V> {
        if key.1.needs_torque() {
            return Arc::new(make());
        }
        let kind = discriminant(&key.1);
        let known = |laws: &Laws<K, V>| {
            let found = laws.made.get(&kind)?.iter().find(|known| known.of == key)?;
            Some(Arc::clone(&found.values))
        };
        if let Some(values) = known(&self.made.lock().unwrap_or_else(PoisonError::into_inner)) {
            return values;
        }
        // Other threads continue while it is made.
        let values = Arc::new(make());
        let mut laws = self.made.lock().unwrap_or_else(PoisonError::into_inner);
        if laws.bytes + values.bytes() <= MOST && known(&laws).is_none() {
            laws.bytes += values.bytes();
            laws.made.entry(kind).or_default().push(Known { of: key, values: Arc::clone(&values) });
        }
        values
    }
}

/// How much memory values take.
pub(super) trait Size {
    fn bytes(&self) -> usize;
}

impl Size for Vec<f64> {
    fn bytes(&self) -> usize {
        size_of::<f64>() * self.len()
    }
}

impl Size for Vec<Vec<f64>> {
    fn bytes(&self) -> usize {
        self.iter().map(Size::bytes).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn laws_of_the_motion_are_made_once_and_laws_of_torques_each_time() {
        let columns = ByLaw::default();
        let joint = JointNumber::from_index;
        let get = |j, law, values: [f64; 2]| columns.get((joint(j), law), || values.to_vec()).to_vec();
        let sine = |order| Law::Sine { order };
        assert_eq!(get(0, sine(3.0), [1.0, 2.0]), [1.0, 2.0]);
        assert_eq!(get(0, sine(3.0), [9.0, 9.0]), [1.0, 2.0]);
        // Another setting, another joint, another law.
        assert_eq!(get(0, sine(4.0), [3.0, 4.0]), [3.0, 4.0]);
        assert_eq!(get(1, sine(3.0), [5.0, 6.0]), [5.0, 6.0]);
        assert_eq!(get(0, Law::Cosine { order: 3.0 }, [7.0, 8.0]), [7.0, 8.0]);
        let load = Law::Load { steepness: 10.0 };
        assert_eq!(get(0, load, [1.0, 1.0]), [1.0, 1.0]);
        assert_eq!(get(0, load, [2.0, 2.0]), [2.0, 2.0]);
    }

    #[test]
    fn columns_of_a_candidate_are_made_once_for_a_model() {
        let made = Made::default();
        let candidate = |order| {
            let settings = crate::effects::position_ripple::Settings { order };
            Candidate::on(JointNumber::from_index(0), settings, 1)
        };
        let get = |theta: f64, order, value: f64| {
            let model = made.of_model(&[theta], &[[1.0, 2.0]]);
            let columns = model.columns(&candidate(order), || vec![Column::on(0, vec![value])]);
            columns[0].parts[0].1[0]
        };
        assert_eq!(get(1.0, 3.0, 10.0), 10.0);
        assert_eq!(get(1.0, 3.0, 11.0), 10.0);
        // Another candidate, another model.
        assert_eq!(get(1.0, 4.0, 12.0), 12.0);
        assert_eq!(get(2.0, 3.0, 13.0), 13.0);
        assert_eq!(get(1.0, 3.0, 14.0), 10.0);
        // The model that was unused for the longest time is removed.
        for other in 3..3 + MODELS {
            assert_eq!(get(other as f64, 3.0, 20.0), 20.0);
        }
        assert_eq!(get(1.0, 3.0, 15.0), 15.0);
    }
}
