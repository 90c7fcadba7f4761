//! The sparse solve against a dense factorisation of the same matrix.

#![allow(clippy::needless_range_loop)] // matrices read best by row and column
use std::collections::BTreeSet;
use std::sync::Arc;

use palpate_solver::{
    BlockMatrix, BlockPattern, Cholesky, FactorError, HalfSolution, NodeOrder, Precision,
    half_products, half_products_between,
};
use palpate_testing::{Fastest, Random, box_of_cells};
use proptest::prelude::*;

/// A random symmetric matrix on `cliques`, made positive definite by diagonal dominance.
fn dominant(node_count: usize, cliques: &[[u32; 4]], random: &mut Random) -> BlockMatrix {
    let pattern = Arc::new(BlockPattern::from_cliques(node_count, cliques));
    let mut matrix = BlockMatrix::zeros(Arc::clone(&pattern));
    for col in 0..node_count as u32 {
        for &row in pattern.column(col as usize) {
            let mut block = [[0.0; 3]; 3];
            for i in 0..3 {
                for j in 0..=i {
                    block[i][j] = random.between(-0.5, 0.5);
                    block[j][i] = if row == col { block[i][j] } else { random.between(-0.5, 0.5) };
                }
            }
            matrix.add(row, col, &block);
        }
    }
    let dense = to_dense(&matrix);
    let size = 3 * node_count;
    for node in 0..node_count {
        let mut block = [[0.0; 3]; 3];
        for k in 0..3 {
            let row = 3 * node + k;
            block[k][k] = 0.1 + (0..size).map(|j| 2.0 * dense[row * size + j].abs()).sum::<f64>();
        }
        matrix.add(node as u32, node as u32, &block);
    }
    matrix
}

fn to_dense(matrix: &BlockMatrix) -> Vec<f64> {
    let count = matrix.pattern().node_count();
    let size = 3 * count;
    let mut dense = vec![0.0; size * size];
    for col in 0..count {
        for &row in matrix.pattern().column(col) {
            let index = matrix.pattern().find(row, col as u32).unwrap();
            let block = matrix.blocks()[index];
            for i in 0..3 {
                for j in 0..3 {
                    let (row, col) = (3 * row as usize + i, 3 * col + j);
                    dense[row * size + col] = block[i][j];
                    dense[col * size + row] = block[i][j];
                }
            }
        }
    }
    dense
}

/// Gaussian elimination, which a positive definite matrix needs no pivoting for.
fn solve_densely(mut matrix: Vec<f64>, mut rhs: Vec<f64>) -> Vec<f64> {
    let size = rhs.len();
    for k in 0..size {
        for row in k + 1..size {
            let factor = matrix[row * size + k] / matrix[k * size + k];
            for col in k..size {
                matrix[row * size + col] -= factor * matrix[k * size + col];
            }
            rhs[row] -= factor * rhs[k];
        }
    }
    for k in (0..size).rev() {
        let known: f64 = (k + 1..size).map(|col| matrix[k * size + col] * rhs[col]).sum();
        rhs[k] = (rhs[k] - known) / matrix[k * size + k];
    }
    rhs
}

fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// Six tetrahedra per cell of a cube of `n` nodes along each axis.
fn grid(n: usize) -> (usize, Vec<[u32; 4]>) {
    let (nodes, tetrahedra) = box_of_cells([n - 1; 3], Fastest::First, |place| place);
    (nodes.len(), tetrahedra)
}

/// Three right-hand sides of one.
fn three_sides([x, y, z]: [f64; 3]) -> [f64; 9] {
    [x, y, z, z, x, y, y, z, -x]
}

/// Largest errors of solutions, relative to the largest entry.
const LIMITS: [(Precision, f64); 3] =
    [(Precision::Double, 1e-12), (Precision::Single, 1e-5), (Precision::BlockFloat, 1e-3)];

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn solutions_equal_the_dense_ones(
        node_count in 1_usize..40,
        cliques in prop::collection::vec(prop::array::uniform4(0_u32..40), 0..60),
        seed in any::<u64>(),
    ) {
        let cliques: Vec<[u32; 4]> =
            cliques.into_iter().map(|c| c.map(|node| node % node_count as u32)).collect();
        let mut random = Random(seed);
        let matrix = dominant(node_count, &cliques, &mut random);
        let factor = Cholesky::new(&matrix).unwrap();
        let mut workspace = factor.workspace();

        let rhs: Vec<_> = (0..node_count).map(|_| random.vector(0.5)).collect();
        let mut sparse = rhs.clone();
        factor.solve_in_place(&mut sparse, &mut workspace);
        let expected = solve_densely(to_dense(&matrix), rhs.as_flattened().to_vec());
        prop_assert!(largest_difference(sparse.as_flattened(), &expected) < 1e-12);

        // Bad orders make other trees.
        let stride = [1, 7, 11, 13].into_iter().rfind(|step| node_count % step != 0).unwrap_or(1);
        let order: Vec<u32> =
            (0..node_count).map(|place| (place * stride % node_count) as u32).collect();
        let order = NodeOrder::given(matrix.pattern(), &order);
        for (precision, limit) in LIMITS {
            let other = Cholesky::in_order(&matrix, precision, order.clone()).unwrap();
            let mut found = rhs.clone();
            other.solve_in_place(&mut found, &mut other.workspace());
            let size = expected.iter().fold(1e-300, |most: f64, x| most.max(x.abs()));
            prop_assert!(largest_difference(found.as_flattened(), &expected) < limit * size.max(1.0));
        }

        let mut first = rhs.clone();
        let mut second: Vec<[f64; 3]> = rhs.iter().map(|&[x, y, z]| [z, x, -y]).collect();
        let mut expected = second.clone();
        factor.solve_in_place(&mut expected, &mut workspace);
        factor.solve_two_in_place(&mut first, &mut second, &mut workspace);
        prop_assert!(largest_difference(first.as_flattened(), sparse.as_flattened()) < 1e-12);
        prop_assert!(largest_difference(second.as_flattened(), expected.as_flattened()) < 1e-12);

        let mut sides: Vec<[f64; 9]> = rhs.iter().map(|&r| three_sides(r)).collect();
        factor.solve_three_in_place(&mut sides, &mut workspace);
        for side in 0..3 {
            let of_node = |s: &[f64; 9]| [s[3 * side], s[3 * side + 1], s[3 * side + 2]];
            let mut alone: Vec<[f64; 3]> = rhs.iter().map(|&r| of_node(&three_sides(r))).collect();
            factor.solve_in_place(&mut alone, &mut workspace);
            let column: Vec<[f64; 3]> = sides.iter().map(of_node).collect();
            prop_assert!(largest_difference(alone.as_flattened(), column.as_flattened()) < 1e-12);
        }

        // Every second node; the other way round as well.
        let nodes: Vec<u32> = (0..node_count as u32).filter(|node| node % 2 == 0).collect();
        let mut halves = vec![HalfSolution::default(); nodes.len()];
        factor.half_solve(&nodes, &mut halves, &mut workspace);
        let mut lengths = Vec::new();
        let paths: Vec<Vec<u32>> = nodes
            .iter()
            .map(|&node| {
                factor.common_lengths(node as usize, &mut lengths);
                lengths.clone()
            })
            .collect();
        let all: Vec<&HalfSolution> = halves.iter().collect();
        let common = |m: usize, l: usize| paths[l][factor.branch(nodes[m] as usize)];
        let mut between = vec![[0.0; 9]; nodes.len() * nodes.len()];
        half_products_between(&all, &all, common, |m, l, product| {
            between[l * nodes.len() + m] = product;
        });
        for (&loaded, half) in nodes.iter().zip(&halves) {
            factor.common_lengths(loaded as usize, &mut lengths);
            let common = |node: u32| lengths[factor.branch(node as usize)];
            let pairs = nodes.iter().zip(&halves).map(|(&node, other)| ([other, half], common(node)));
            let mut found = Vec::new();
            half_products(pairs, |product| found.push(product));
            let pairs = nodes.iter().zip(&halves).map(|(&node, other)| ([half, other], common(node)));
            let mut turned = Vec::new();
            half_products(pairs, |product| turned.push(product));
            let (together, rest) = between.split_at(nodes.len());
            prop_assert_eq!(together, &*found);
            between = rest.to_vec();
            for axis in 0..3 {
                let mut unit = vec![[0.0; 3]; node_count];
                unit[loaded as usize][axis] = 1.0;
                factor.solve_in_place(&mut unit, &mut workspace);
                let size = largest_difference(unit.as_flattened(), &vec![0.0; 3 * node_count]);
                for (&moved, (found, turned)) in nodes.iter().zip(found.iter().zip(&turned)) {
                    for k in 0..3 {
                        let error = f64::from(found[3 * axis + k]) - unit[moved as usize][k];
                        prop_assert!(error.abs() < 2e-6 * size, "{error} of {size}");
                        prop_assert_eq!(found[3 * axis + k], turned[3 * k + axis]);
                    }
                }
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn patterns_hold_the_pairs_of_their_cliques(
        node_count in 1_usize..30,
        cliques in prop::collection::vec(prop::array::uniform4(0_u32..30), 0..60),
        left_out in prop::collection::vec(any::<bool>(), 30),
    ) {
        let cliques: Vec<[u32; 4]> =
            cliques.into_iter().map(|c| c.map(|node| node % node_count as u32)).collect();
        let pattern = BlockPattern::from_cliques(node_count, &cliques);
        let mut pairs: BTreeSet<(u32, u32)> = (0..node_count as u32).map(|i| (i, i)).collect();
        for clique in &cliques {
            for &a in clique {
                pairs.extend(clique.iter().map(|&b| (a.min(b), a.max(b))));
            }
        }
        let blocks = |pattern: &BlockPattern| -> Vec<(u32, u32)> {
            let columns = 0..pattern.node_count();
            columns.flat_map(|c| pattern.column(c).iter().map(move |&r| (c as u32, r))).collect()
        };
        prop_assert_eq!(blocks(&pattern), pairs.iter().copied().collect::<Vec<_>>());

        let kept: Vec<u32> = (0..node_count as u32).filter(|&i| !left_out[i as usize]).collect();
        let mut places = vec![u32::MAX; node_count];
        for (place, &node) in kept.iter().enumerate() {
            places[node as usize] = place as u32;
        }
        let (small, sources) = pattern.restricted(&places);
        prop_assert_eq!(small.node_count(), kept.len());
        let all = blocks(&pattern);
        let found: Vec<(u32, u32)> = sources.iter().map(|&block| all[block as usize]).collect();
        let expected = blocks(&small).into_iter().map(|(c, r)| (kept[c as usize], kept[r as usize]));
        prop_assert_eq!(found, expected.collect::<Vec<_>>());
        let whole = |&(c, r): &(u32, u32)| places[c as usize].max(places[r as usize]) != u32::MAX;
        prop_assert_eq!(small.block_count(), pairs.iter().filter(|pair| whole(pair)).count());
    }
}

#[test]
fn a_large_grid_is_solved_and_gives_the_same_bits_twice() {
    let (node_count, cliques) = grid(12);
    let mut random = Random(3);
    let matrix = dominant(node_count, &cliques, &mut random);
    let rhs: Vec<_> = (0..node_count).map(|_| random.vector(0.5)).collect();
    let solve = || {
        let factor = Cholesky::new(&matrix).unwrap();
        let mut x = rhs.clone();
        factor.solve_in_place(&mut x, &mut factor.workspace());
        (x, factor.stats())
    };
    let (x, stats) = solve();
    let mut product = vec![[0.0; 3]; node_count];
    matrix.multiply(&x, &mut product);
    assert!(largest_difference(product.as_flattened(), rhs.as_flattened()) < 1e-12);
    assert!(stats.entries < 1_500_000, "{stats:?}");
    let (again, _) = solve();
    assert!(
        x.as_flattened().iter().zip(again.as_flattened()).all(|(a, b)| a.to_bits() == b.to_bits())
    );
}

#[test]
fn refactoring_uses_the_new_values() {
    let (node_count, cliques) = grid(4);
    let mut matrix = dominant(node_count, &cliques, &mut Random(1));
    let mut factor = Cholesky::new(&matrix).unwrap();
    for block in matrix.blocks_mut() {
        for value in block.as_flattened_mut() {
            *value *= 2.0;
        }
    }
    factor.refactor(&matrix).unwrap();
    let mut x = vec![[1.0; 3]; node_count];
    factor.solve_in_place(&mut x, &mut factor.workspace());
    let mut product = vec![[0.0; 3]; node_count];
    matrix.multiply(&x, &mut product);
    assert!(product.as_flattened().iter().all(|p| (p - 1.0).abs() < 1e-12));
    let other = BlockMatrix::zeros(Arc::new(BlockPattern::from_cliques(2, &[[0, 1]])));
    assert_eq!(factor.refactor(&other), Err(FactorError::PatternChanged));
}

#[test]
fn a_node_without_stiffness_is_named() {
    let (node_count, cliques) = grid(3);
    let mut matrix = dominant(node_count, &cliques, &mut Random(1));
    let index = matrix.pattern().find(13, 13).unwrap();
    matrix.blocks_mut()[index][1][1] = -1.0;
    match Cholesky::new(&matrix) {
        Err(FactorError::NotPositiveDefinite { node, .. }) => assert_eq!(node, 13),
        Err(other) => panic!("{other}"),
        Ok(_) => panic!("the matrix is indefinite"),
    }
    matrix.blocks_mut()[index][1][1] = f64::NAN;
    assert!(Cholesky::new(&matrix).is_err());
}

#[test]
fn an_empty_matrix_is_fine() {
    let matrix = BlockMatrix::zeros(Arc::new(BlockPattern::from_cliques::<4>(0, &[])));
    let factor = Cholesky::new(&matrix).unwrap();
    factor.solve_in_place(&mut [], &mut factor.workspace());
}

#[test]
fn fewer_bits_are_close_and_give_way_to_more_where_they_are_not() {
    let (node_count, cliques) = grid(6);
    let mut random = Random(5);
    let mut matrix = dominant(node_count, &cliques, &mut random);
    let rhs: Vec<_> = (0..node_count).map(|_| random.vector(0.5)).collect();
    let solved = |factor: &Cholesky| {
        let mut x = rhs.clone();
        factor.solve_in_place(&mut x, &mut factor.workspace());
        x
    };
    let double = Cholesky::new(&matrix).unwrap();
    let single = Cholesky::with_precision(&matrix, Precision::Single).unwrap();
    assert!(2 * single.stats().bytes < double.stats().bytes + 100_000);
    let block_float = Cholesky::with_precision(&matrix, Precision::BlockFloat).unwrap();
    assert!(2 * block_float.stats().bytes < single.stats().bytes + 100_000);
    let expected = solved(&double);
    let size = largest_difference(expected.as_flattened(), &vec![0.0; 3 * node_count]);
    let error = |factor: &Cholesky| {
        largest_difference(solved(factor).as_flattened(), expected.as_flattened()) / size
    };
    let errors = [error(&single), error(&block_float)];
    assert!(errors[0] > 0.0 && errors[0] < 1e-5, "{errors:?}");
    assert!(errors[1] > 10.0 * errors[0] && errors[1] < 3e-4, "{errors:?}");

    // Springs between neighbours, held by almost nothing: single precision cannot solve it.
    for block in matrix.blocks_mut() {
        *block = [[0.0; 3]; 3];
    }
    for &[a, b, ..] in &cliques {
        for k in 0..3 {
            let mut unit = [[0.0; 3]; 3];
            unit[k][k] = 1.0;
            matrix.add(a, a, &unit);
            matrix.add(b, b, &unit);
            unit[k][k] = -1.0;
            matrix.add(a.max(b), a.min(b), &unit);
        }
    }
    for node in 0..node_count as u32 {
        matrix.add(node, node, &[[1e-6, 0.0, 0.0], [0.0, 1e-6, 0.0], [0.0, 0.0, 1e-6]]);
    }
    let single = Cholesky::with_precision(&matrix, Precision::Single).unwrap();
    let double = Cholesky::new(&matrix).unwrap();
    assert_eq!(single.stats().bytes, double.stats().bytes);
    assert_eq!(solved(&single), solved(&double));
    let block_float = Cholesky::with_precision(&matrix, Precision::BlockFloat).unwrap();
    assert_eq!(solved(&block_float), solved(&double));
}

#[test]
fn half_solutions_do_not_depend_on_what_is_solved_with_them() {
    let (node_count, cliques) = grid(8);
    let matrix = dominant(node_count, &cliques, &mut Random(7));
    for (precision, _) in LIMITS {
        let factor = Cholesky::with_precision(&matrix, precision).unwrap();
        let mut workspace = factor.workspace();
        let nodes: Vec<u32> = (0..node_count as u32).collect();
        let mut all = vec![HalfSolution::default(); node_count];
        factor.half_solve(&nodes, &mut all, &mut workspace);
        let mut rest = &nodes[..];
        for count in [1, 2, 3, 5, 6, 8, 11, 16, 20].into_iter().cycle() {
            let (some, others) = rest.split_at(count.min(rest.len()));
            let mut halves = vec![HalfSolution::default(); some.len()];
            factor.half_solve(some, &mut halves, &mut workspace);
            assert!(halves[..] == all[some[0] as usize..][..some.len()], "{some:?}");
            rest = others;
            if rest.is_empty() {
                break;
            }
        }
    }
}

#[test]
fn a_given_order_is_taken_and_keeps_its_bits() {
    let (count, cells) = grid(6);
    let pattern = Arc::new(BlockPattern::from_cliques(count, &cells));
    let found = NodeOrder::new(&pattern);
    let again = NodeOrder::given(&pattern, &found.nodes);
    assert_eq!(again.nodes, found.nodes, "a postorder is its own");
    assert_eq!(again.factor_entries, found.factor_entries);
    let plain: Vec<u32> = (0..count as u32).collect();
    let once = NodeOrder::given(&pattern, &plain);
    assert_eq!(NodeOrder::given(&pattern, &once.nodes).nodes, once.nodes);
    assert!(once.factor_entries > found.factor_entries);
}
