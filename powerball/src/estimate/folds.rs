//! Which blocks are held out together.

use crate::regression::Data;

/// Five or more parts that are held out in turn: whole logs where there are enough, else stretches with a guard.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Folds {
    /// Number of folds.
    pub count: usize,
    /// The cell of each block; grams are summed by cell.
    pub cell_of_block: Vec<usize>,
    /// Number of cells.
    pub cells: usize,
    /// By fold: the cells that are predicted.
    pub held: Vec<Vec<usize>>,
    /// By fold: the cells that are not fitted, held ones and guards.
    pub left_out: Vec<Vec<usize>>,
    /// Whether folds are whole logs.
    pub by_log: bool,
}

/// Folds wanted.
const FOLDS: usize = 5;
/// More folds than this cost time and test no more.
const MOST: usize = 8;

impl Folds {
    /// Whole logs if there are at least five, at most eight folds; otherwise each log is cut into equal stretches and
    /// the blocks next to a held stretch are not fitted either.
    #[must_use]
    pub fn new(data: &Data<'_>) -> Folds {
        let mut logs: Vec<usize> = data.blocks.iter().map(|b| b.log).collect();
        logs.dedup();
        if logs.len() >= FOLDS {
            let count = logs.len().min(MOST);
            let fold_of = |log: usize| {
                let at = logs.iter().position(|l| *l == log).unwrap_or(0);
                at * count / logs.len()
            };
            let own: Vec<Vec<usize>> = (0..count).map(|f| vec![f]).collect();
            return Folds {
                count,
                cell_of_block: data.blocks.iter().map(|b| fold_of(b.log)).collect(),
                cells: count,
                held: own.clone(),
                left_out: own,
                by_log: true,
            };
        }
        let parts = FOLDS.div_ceil(logs.len().max(1));
        let (mut cell_of_block, mut held, mut left_out) = (vec![0; data.blocks.len()], Vec::new(), Vec::new());
        let mut cells = 0;
        for log in logs {
            let members: Vec<usize> =
                (0..data.blocks.len()).filter(|b| data.blocks[*b].log == log).collect();
            // Every block is a cell: few enough, and guards are then single blocks.
            for b in &members {
                cell_of_block[*b] = cells;
                cells += 1;
            }
            let first = cell_of_block[members[0]];
            for part in 0..parts {
                let (from, to) = (members.len() * part / parts, members.len() * (part + 1) / parts);
                if from == to {
                    continue;
                }
                held.push((first + from..first + to).collect());
                let guarded = from.saturating_sub(1)..(to + 1).min(members.len());
                left_out.push(guarded.map(|k| first + k).collect());
            }
        }
        Folds { count: held.len(), cell_of_block, cells, held, left_out, by_log: false }
    }
}
