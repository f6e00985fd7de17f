//! Which blocks are held out together.

use crate::logs::regression::Data;

/// Parts that are held out in turn: whole logs where there are enough, else stretches of each with a guard.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Folds {
    /// The cell of each block; grams are summed by cell.
    pub cell_of_block: Vec<usize>,
    /// Number of cells.
    pub cells: usize,
    /// Whether folds are whole logs.
    pub by_log: bool,
    logs: Parts,
    stretches: Parts,
}

/// By fold: the cells that are predicted, and the cells that are not fitted (held ones and guards).
#[derive(Clone, Debug, Default, PartialEq, Eq)]
struct Parts {
    held: Vec<Vec<usize>>,
    left_out: Vec<Vec<usize>>,
}

/// Folds wanted.
const FOLDS: usize = 5;
/// More folds than this cost time and test no more.
const MOST: usize = 8;

impl Folds {
    /// Lays out both kinds of folds.
    ///
    /// Whole logs: at least five, at most eight folds of neighbouring logs. Stretches: the f-th fifth of
    /// every log is fold f, and the blocks beside it are not fitted either.
    #[must_use]
    pub fn new(data: &Data<'_>) -> Folds {
        let mut names: Vec<usize> = data.blocks.iter().map(|b| b.log).collect();
        names.dedup();
        let mut cell_of_block = vec![0; data.blocks.len()];
        let mut cells = 0;
        let mut stretches = Parts { held: vec![Vec::new(); FOLDS], left_out: vec![Vec::new(); FOLDS] };
        let folds = names.len().clamp(1, MOST);
        let mut logs = Parts { held: vec![Vec::new(); folds], left_out: vec![Vec::new(); folds] };
        for (at, log) in names.iter().enumerate() {
            let members: Vec<usize> =
                (0..data.blocks.len()).filter(|b| data.blocks[*b].log == *log).collect();
            let part_of = |k: usize| k * FOLDS / members.len();
            let mut previous = None;
            for (k, block) in members.iter().enumerate() {
                // The first and last block of a stretch guard its neighbours, so they are cells of their own.
                let part = part_of(k);
                let first = k == 0 || part_of(k - 1) != part;
                let last = k + 1 == members.len() || part_of(k + 1) != part;
                let key = (part, first, last);
                if previous != Some(key) {
                    cells += 1;
                    previous = Some(key);
                }
                let cell = cells - 1;
                cell_of_block[*block] = cell;
                stretches.held[part].push(cell);
                stretches.left_out[part].push(cell);
                if first && k > 0 {
                    stretches.left_out[part_of(k - 1)].push(cell);
                }
                if last && k + 1 < members.len() {
                    stretches.left_out[part_of(k + 1)].push(cell);
                }
                let fold = at * folds / names.len();
                logs.held[fold].push(cell);
                logs.left_out[fold].push(cell);
            }
        }
        stretches.held.retain(|f| !f.is_empty());
        stretches.left_out.retain(|f| !f.is_empty());
        for list in [&mut logs.held, &mut logs.left_out, &mut stretches.held, &mut stretches.left_out] {
            for fold in list.iter_mut() {
                fold.dedup();
            }
        }
        Folds { cell_of_block, cells, by_log: names.len() >= FOLDS, logs, stretches }
    }

    /// The folds for what happens everywhere, or for what happens in some logs only (`local`): held cells,
    /// and cells that are not fitted.
    #[must_use]
    pub fn folds(&self, local: bool) -> (&[Vec<usize>], &[Vec<usize>]) {
        let parts = if self.by_log && !local { &self.logs } else { &self.stretches };
        (&parts.held, &parts.left_out)
    }
}
