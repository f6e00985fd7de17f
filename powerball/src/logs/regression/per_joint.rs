//! A fit of each joint by itself, for logs that repeat one path.
//!
//! One path, however often it is run, tells little of a rigid body, and whatever else depends on positions is
//! one more function of that path. Where that does not fit, what it leaves is large and smooth on every
//! joint, and what changes from one repeat to the next, or within a motor's turn, drowns in it. Then each
//! joint is given inertial parameters of its own, an offset, and a slope with its position: what the path
//! alone can explain is taken to be explained, and only what goes beyond is asked for.

use super::prepare::Data;
use crate::logs::parallel;

impl Data<'_> {
    /// Gives every joint columns of its own for the minimal set, an offset and its position; `false` takes
    /// that back.
    pub fn set_per_joint(&mut self, per_joint: bool) {
        if per_joint == self.per_joint {
            return;
        }
        self.per_joint = per_joint;
        let set = self.body.names().len();
        if !per_joint {
            self.joints.iter_mut().for_each(|joint| joint.inertial.truncate(set));
            return;
        }
        let joints: Vec<usize> = (0..self.dof()).collect();
        let added = parallel::map(&joints, |&j| {
            let column = |signal: &dyn Fn(usize) -> Vec<f64>| {
                self.joints[j].column(&self.recordings, |r, _| signal(r))
            };
            let offset = column(&|r| vec![1.0; self.recordings[r].len()]);
            let slope = column(&|r| self.recordings[r].position(j).collect());
            [offset, slope]
        });
        for (joint, columns) in self.joints.iter_mut().zip(added) {
            joint.inertial.extend(columns);
        }
    }

    /// Inertial columns of a joint: the minimal set, and where each joint has its own fit what stands beside it.
    #[must_use]
    pub fn inertial_columns(&self) -> usize {
        self.joints.iter().map(|joint| joint.inertial.len()).max().unwrap_or(0)
    }
}
