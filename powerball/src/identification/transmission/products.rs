//! What the logs say of one joint's transmission: products of its columns, by block.

use super::columns::{Column, Scales};
use super::grid::Grid;
use crate::controller::JointNumber;
use crate::identification::estimate::noise_in_band;
use crate::logs::regression::{Recording, top_velocity};
use crate::logs::signal::rest;
use dyngen::Arm;
use faer::Mat;

/// Length of a block, s: one to three correlation times of what is left.
const BLOCK: f64 = 0.5;
/// Fewer blocks of motion say nothing.
const FEWEST_BLOCKS: usize = 12;

/// Products of all columns over some rows.
#[derive(Clone, Debug)]
pub(super) struct Products {
    pub rows: f64,
    gram: Vec<f64>,
}

/// A stretch of rows that counts as independent of the others.
#[derive(Clone, Debug)]
pub(super) struct Block {
    pub part: usize,
    pub products: Products,
}

/// Everything that a joint's transmission is told by.
#[derive(Debug)]
pub(super) struct Evidence {
    pub blocks: Vec<Block>,
    /// By part.
    pub parts: Vec<Products>,
    /// Whether the last part is of the logs to judge on.
    pub held_out: bool,
    /// Variance of the link torque's noise in the band.
    pub noise: f64,
}

impl Products {
    fn empty() -> Products {
        Products { rows: 0.0, gram: vec![0.0; Column::COUNT * Column::COUNT] }
    }

    /// Adds the row of all columns.
    fn push(&mut self, row: &[f64]) {
        self.rows += 1.0;
        for (products, x) in self.gram.chunks_exact_mut(Column::COUNT).zip(row) {
            products.iter_mut().zip(row).for_each(|(product, y)| *product += x * y);
        }
    }

    /// The sum of some.
    pub(super) fn sum<'p>(all: impl IntoIterator<Item = &'p Products>) -> Products {
        let mut sum = Products::empty();
        for one in all {
            sum.rows += one.rows;
            sum.gram.iter_mut().zip(&one.gram).for_each(|(a, b)| *a += b);
        }
        sum
    }

    /// The product of two columns.
    pub(super) fn of(&self, a: Column, b: Column) -> f64 {
        self.gram[a.index() * Column::COUNT + b.index()]
    }

    /// Of some columns with each other, and with the motor's torque.
    pub(super) fn normal(&self, columns: &[Column]) -> (Mat<f64>, Vec<f64>) {
        let gram = Mat::from_fn(columns.len(), columns.len(), |r, c| self.of(columns[r], columns[c]));
        (gram, columns.iter().map(|c| self.of(*c, Column::Motor)).collect())
    }
}

impl Evidence {
    /// The parts for which something holds, together.
    pub(super) fn of(&self, wanted: impl Fn(usize) -> bool) -> Products {
        Products::sum(self.parts.iter().enumerate().filter(|(k, _)| wanted(*k)).map(|(_, part)| part))
    }

    /// The logs that are fitted.
    pub(super) fn fitted(&self) -> Products {
        self.of(|part| self.is_fitted(part))
    }

    /// Whether a part is not of the logs to judge on.
    pub(super) fn is_fitted(&self, part: usize) -> bool {
        !self.held_out || part + 1 != self.parts.len()
    }
}

/// What the logs say of a joint.
///
/// # Errors
/// In words, where they say nothing.
pub(super) fn evidence(arm: &Arm, grid: &Grid, joint: JointNumber) -> Result<(Evidence, Scales), String> {
    let j = joint.index();
    let used = || grid.pieces.iter().filter(move |piece| !piece.motor(j).is_empty());
    let changes = |x: &[f64]| x.windows(2).any(|pair| pair[0] != pair[1]);
    if !used().any(|piece| changes(piece.motor(j))) {
        return Err(format!("motor{joint} never changes: it was not recorded, or its drive is dead"));
    }
    let recordings: Vec<&Recording> = used().map(|piece| &piece.recording).collect();
    let top = top_velocity(recordings.iter().copied(), j);
    let velocities = recordings.iter().flat_map(|r| r.velocity(j).map(f64::abs)).collect();
    let rest_velocity = rest::rest_velocity(velocities, arm.joints[j].velocity);
    let scales = Scales::new(top);
    let torques: Vec<&[f64]> = recordings.iter().map(|r| r.torque[j].as_slice()).collect();
    let noise = noise_in_band(&torques, &grid.band, grid.rate).powi(2);
    let per_block = ((BLOCK * grid.rate) as usize).max(1);
    let mut blocks: Vec<Block> = Vec::new();
    for piece in used() {
        let recording = &piece.recording;
        let moving = rest::moving(&recording.velocity(j).collect::<Vec<_>>(), recording.rate, rest_velocity);
        let kept = grid.band.kept(recording.len());
        let in_band = |column: Column| match column {
            Column::Motor => grid.band.pass(piece.motor(j)),
            other => grid.band.pass(&other.signal(&scales, recording, j)),
        };
        let columns: Vec<Vec<f64>> = Column::all().into_iter().map(in_band).collect();
        let mut last = None;
        for (k, sample) in kept.iter().enumerate().filter(|(_, s)| moving[**s] && piece.knows(j, **s)) {
            let half = usize::from(2 * sample >= recording.len());
            let (number, part) = (sample / per_block, piece.part.unwrap_or(half));
            if last != Some((number, part)) {
                last = Some((number, part));
                blocks.push(Block { part, products: Products::empty() });
            }
            let row: Vec<f64> = columns.iter().map(|column| column[k]).collect();
            if let Some(block) = blocks.last_mut() {
                block.products.push(&row);
            }
        }
    }
    let count = |part: usize| blocks.iter().filter(|block| block.part == part).count();
    if blocks.len() < FEWEST_BLOCKS || (0..grid.parts).any(|part| count(part) < FEWEST_BLOCKS / 3) {
        let seconds = BLOCK * blocks.len() as f64;
        return Err(format!(
            "its logs with both torques hold {seconds:.1} s of motion, or one of them hardly any: record \
             longer"
        ));
    }
    let parts = (0..grid.parts)
        .map(|part| Products::sum(blocks.iter().filter(|b| b.part == part).map(|b| &b.products)))
        .collect();
    Ok((Evidence { blocks, parts, held_out: grid.held_out, noise }, scales))
}
