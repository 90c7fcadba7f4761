//! The numeric factorisation: each supernode is eliminated from a small dense matrix (Duff and Reid 1983).
//!
//! The front of a supernode holds its columns of the matrix and what its children have left for it and
//! for the nodes above. Eliminating its columns leaves a contribution to its parent, on a stack: children
//! stand before their parents, so that theirs are the last ones there. There are two stacks, for generations
//! by turns, so that a contribution is put together where it stays while those of the children are read.
//! What is kept for the next change stands outside them.

use std::sync::Arc;

use super::changes::{Contribution, Plan};
use super::elimination::Elimination;
use super::memory::Spare;
use super::packed::{PackedFactor, Panel};
use super::product::Product;
use super::real::Real;
use super::supernodes::Supernodes;
use crate::BlockMatrix;

/// Memory for factorisations.
#[derive(Default)]
pub(super) struct Fronts {
    /// Columns that are eliminated: those of the diagonal block, with all rows.
    columns: Vec<f64>,
    /// Contributions that wait for their parent, lower triangles in whole columns.
    stacks: [Stack; 2],
    /// Place of each node among those of the front.
    places: Vec<u32>,
    /// Stretches of rows of a child that are next to each other in the front as well: where they begin
    /// among its own and in the front, and how many.
    stretches: Vec<[usize; 3]>,
    elimination: Elimination,
}

/// Contributions, the last one on top; memory beyond those is kept.
#[derive(Default)]
struct Stack {
    values: Vec<f64>,
    used: usize,
}

impl Stack {
    fn push(&mut self, size: usize) -> &mut [f64] {
        self.used += size;
        if self.values.len() < self.used {
            self.values.resize(self.used, 0.0);
        }
        self.top(size)
    }

    /// Takes the last `size` values off.
    fn pop(&mut self, size: usize) -> &[f64] {
        let end = self.used;
        self.used -= size;
        &self.values[self.used..end]
    }

    fn top(&mut self, size: usize) -> &mut [f64] {
        &mut self.values[self.used - size..self.used]
    }
}

impl Fronts {
    /// Factors a matrix in spare memory; the column of a pivot that is not positive if there is one. All is done in double precision but for what each supernode is turned into when
    /// it is finished.
    pub(super) fn factor<T: Real>(
        &mut self,
        supernodes: &Supernodes,
        matrix: &BlockMatrix,
        plan: &mut Plan<T>,
        spare: &mut Spare<Panel<T>>,
        spare_contributions: &mut Spare<f64>,
    ) -> Result<PackedFactor<T>, usize> {
        let (mut finished, mut product) = (Vec::new(), Product::default());
        for stack in &mut self.stacks {
            stack.used = 0;
        }
        self.places.resize(matrix.pattern().node_count(), 0);
        let mut factor = PackedFactor::new(3 * matrix.pattern().node_count());
        for s in 0..supernodes.count() {
            let (nodes, below) = (supernodes.nodes(s), 3 * supernodes.rows(s).len());
            let (first, width) = (3 * nodes.start, 3 * nodes.len());
            let rows = supernodes.rows(s).iter().flat_map(|&row| [0, 1, 2].map(|k| 3 * row + k));
            if plan.is_computed[s] {
                let mut kept =
                    plan.is_kept[s].then(|| spare_contributions.take(below * below, 0.0));
                self.assemble(supernodes, matrix, s, &plan.contributions, kept.as_deref_mut());
                let stack = &mut self.stacks[supernodes.generation(s) % 2];
                let own = kept.as_deref_mut();
                let contribution = own.unwrap_or_else(|| stack.top(below * below));
                self.elimination
                    .eliminate(&mut self.columns, width, contribution)
                    .map_err(|column| first + column)?;
                plan.contributions[s] = kept.map(Arc::new);
            }
            if let Some(panels) = plan.known[s] {
                factor.push_panels(first as u32, width, rows, Arc::clone(panels));
                continue;
            }
            finished.clear();
            finished.extend(self.columns.iter().map(|&value| T::from_f64(value)));
            self.elimination.finish(&mut finished, width, &mut product);
            factor.push(first as u32, width, rows, &finished, spare);
        }
        Ok(factor)
    }

    /// Puts the front of a supernode together: columns, and the contribution in its `own` place or on top
    /// of the stack.
    fn assemble(
        &mut self,
        supernodes: &Supernodes,
        matrix: &BlockMatrix,
        s: usize,
        kept: &[Option<Contribution>],
        own: Option<&mut [f64]>,
    ) {
        let (nodes, rows) = (supernodes.nodes(s), supernodes.rows(s));
        let (width, below) = (3 * nodes.len(), 3 * rows.len());
        let height = width + below;
        for (place, node) in nodes.clone().enumerate() {
            self.places[node] = place as u32;
        }
        for (place, &row) in rows.iter().enumerate() {
            self.places[row as usize] = (nodes.len() + place) as u32;
        }
        self.columns.clear();
        self.columns.resize(height * width, 0.0);
        for node in nodes.clone() {
            let first = 3 * (node - nodes.start);
            for (row, block) in supernodes.column(matrix, node) {
                let place = 3 * self.places[row as usize] as usize;
                for (k, entries) in block.into_iter().enumerate() {
                    self.columns[(first + k) * height + place..][..3].copy_from_slice(&entries);
                }
            }
        }
        let [even, odd] = &mut self.stacks;
        let [stack, others] =
            if supernodes.generation(s).is_multiple_of(2) { [even, odd] } else { [odd, even] };
        let contribution = own.unwrap_or_else(|| stack.push(below * below));
        for (place, column) in contribution.chunks_exact_mut(below.max(1)).enumerate() {
            column[place / 3 * 3..].fill(0.0);
        }
        let mut front = Front { width, below, columns: &mut self.columns, contribution };
        let size = |child: u32| (3 * supernodes.rows(child as usize).len()).pow(2);
        let children = supernodes.children(s);
        let on_stack = children.iter().filter(|&&child| kept[child as usize].is_none());
        let mut waiting = others.pop(on_stack.map(|&child| size(child)).sum());
        for &child in children {
            let contribution = if let Some(kept) = &kept[child as usize] {
                kept
            } else {
                let (contribution, rest) = waiting.split_at(size(child));
                waiting = rest;
                contribution
            };
            let rows = supernodes.rows(child as usize).iter();
            let places = rows.map(|&row| self.places[row as usize]);
            front.add(contribution, places, &mut self.stretches);
        }
    }
}

/// A front that is put together.
struct Front<'a> {
    width: usize,
    below: usize,
    columns: &'a mut [f64],
    contribution: &'a mut [f64],
}

impl Front<'_> {
    /// Adds a child's contribution, whose nodes are at `places`.
    fn add(
        &mut self,
        contribution: &[f64],
        places: impl Iterator<Item = u32>,
        stretches: &mut Vec<[usize; 3]>,
    ) {
        let (width, below, height) = (self.width, self.below, self.width + self.below);
        let mut size = 0;
        stretches.clear();
        for place in places {
            let place = 3 * place as usize;
            match stretches.last_mut() {
                // Columns and contribution are apart.
                Some([_, at, length]) if *at + *length == place && place != width => *length += 3,
                _ => stretches.push([size, place, 3]),
            }
            size += 3;
        }
        for (number, &[from, at, length]) in stretches.iter().enumerate() {
            for column in 0..length {
                let source = &contribution[(from + column) * size..][..size];
                let place = at + column;
                let (target, offset) = if place < width {
                    (&mut self.columns[place * height..][..height], 0)
                } else {
                    (&mut self.contribution[(place - width) * below..][..below], width)
                };
                for (index, &[begin, to, length]) in stretches[number..].iter().enumerate() {
                    // Of the diagonal stretch, the rows from the diagonal block on.
                    let skip = if index == 0 { column / 3 * 3 } else { 0 };
                    let target = &mut target[to - offset + skip..][..length - skip];
                    let source = &source[begin + skip..][..length - skip];
                    for (sum, value) in target.iter_mut().zip(source) {
                        *sum += value;
                    }
                }
            }
        }
    }
}
