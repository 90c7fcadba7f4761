//! The numeric factorisation: each supernode is eliminated from a small dense matrix (Duff and Reid 1983).
//!
//! The front of a supernode holds its columns of the matrix and what its children have left for it and
//! for the nodes above. Eliminating its columns leaves a contribution to its parent, on a stack: children
//! stand before their parents, so that theirs are the last ones there. There are two stacks, for generations
//! by turns, so that a contribution is put together where it stays while those of the children are read.
//! What is kept for the next change stands outside them.

use std::sync::Arc;

use super::assembly::{Assembly, Part};
use super::changes::{Contribution, Plan};
use super::elimination::eliminate;
use super::finish::{Finish, Piece};
use super::front::{Front, Shape};
use super::memory::Spare;
use super::packed::PackedFactor;
use super::pages::Pages;
use super::stored::Stored;
use super::supernodes::Supernodes;
use super::tiles::{Block, Column};
use crate::BlockMatrix;

/// Memory for factorisations.
#[derive(Default)]
pub(super) struct Fronts {
    /// Columns that are eliminated.
    columns: Vec<Column>,
    /// Inverses of the factors of their diagonal blocks.
    inverses: Vec<Block>,
    /// Contributions that wait for their parent.
    stacks: [Stack; 2],
    assembly: Assembly,
}

/// Contributions, the last one on top; memory beyond those is kept.
#[derive(Default)]
struct Stack {
    columns: Vec<Column>,
    used: usize,
}

impl Stack {
    fn push(&mut self, size: usize) -> &mut [Column] {
        self.used += size;
        if self.columns.len() < self.used {
            self.columns.resize(self.used, Column::ZERO);
        }
        &mut self.columns[self.used - size..self.used]
    }

    /// Takes the last `size` columns off.
    fn pop(&mut self, size: usize) -> &[Column] {
        let end = self.used;
        self.used -= size;
        &self.columns[self.used..end]
    }
}

impl Fronts {
    /// Factors a matrix in spare memory; the column of a pivot that is not positive if there is one. All
    /// is done in double precision but for what each supernode is turned into when it is finished.
    pub(super) fn factor<P: Stored>(
        &mut self,
        supernodes: &Supernodes,
        matrix: &BlockMatrix,
        plan: &mut Plan<P>,
        spare_panels: &mut Pages,
        spare_contributions: &mut Spare<Column>,
    ) -> Result<PackedFactor<P>, usize> {
        let (mut finish, mut panel_memory) = (Finish::default(), Vec::new());
        for stack in &mut self.stacks {
            stack.used = 0;
        }
        let mut factor = PackedFactor::new(supernodes, std::mem::take(spare_panels));
        for s in 0..supernodes.count() {
            let shape = shape(supernodes, s);
            let first = 3 * supernodes.nodes(s).start;
            if plan.is_computed[s] {
                let size = shape.contribution().column_count();
                let kept = plan.is_kept[s].then(|| spare_contributions.take(size, Column::ZERO));
                plan.contributions[s] = self
                    .eliminate(supernodes, matrix, s, plan, kept)
                    .map_err(|column| first + column)?;
            }
            let pieces = supernodes.pieces(s);
            if let Some(known) = plan.known[s] {
                factor.panels_of_mut(pieces).copy_from_slice(known);
                continue;
            }
            let mut begin = 0;
            for index in pieces {
                let piece = Piece::new(shape, begin, factor.supernodes[index].columns().len());
                begin += piece.shape.width;
                let panels = factor.panels_of_mut(index..index + 1);
                P::fill(panels, &mut panel_memory, |panels| {
                    finish.finish(shape, piece, &self.columns, &self.inverses, panels);
                });
            }
        }
        Ok(factor)
    }

    /// Puts the front of a supernode together and eliminates its columns. What they leave goes to the
    /// memory in which it is `kept`, which is returned, or on a stack.
    fn eliminate<P>(
        &mut self,
        supernodes: &Supernodes,
        matrix: &BlockMatrix,
        s: usize,
        plan: &Plan<P>,
        mut kept: Option<Vec<Column>>,
    ) -> Result<Option<Contribution>, usize> {
        let shape = shape(supernodes, s);
        let [even, odd] = &mut self.stacks;
        let [stack, others] =
            if supernodes.generation(s).is_multiple_of(2) { [even, odd] } else { [odd, even] };
        let contribution = match &mut kept {
            Some(kept) => kept,
            None => stack.push(shape.contribution().column_count()),
        };
        // Memory beyond a front is kept.
        let count = shape.column_count();
        self.columns.resize(count.max(self.columns.len()), Column::ZERO);
        let columns = &mut self.columns[..count];
        self.assembly.begin(supernodes, matrix, s, shape, columns);
        let size = |child: usize| self::shape(supernodes, child).contribution().column_count();
        let children = supernodes.children(s).iter().map(|&child| child as usize);
        let on_stack = children.clone().filter(|&child| plan.contributions[child].is_none());
        let waiting = others.pop(on_stack.map(size).sum());
        let mut add = |part: Part, target: &mut [Column]| {
            let mut waiting = waiting;
            for child in children.clone() {
                let left = if let Some(kept) = &plan.contributions[child] {
                    kept
                } else {
                    let (left, rest) = waiting.split_at(size(child));
                    waiting = rest;
                    left
                };
                self.assembly.add(supernodes.rows(child), left, shape, part, target);
            }
        };
        add(Part::Columns, columns);
        eliminate(Front { shape, columns, contribution }, &mut self.inverses)?;
        add(Part::Contribution, contribution);
        Ok(kept.map(Arc::new))
    }
}

fn shape(supernodes: &Supernodes, s: usize) -> Shape {
    Shape { width: 3 * supernodes.nodes(s).len(), below: 3 * supernodes.rows(s).len() }
}
