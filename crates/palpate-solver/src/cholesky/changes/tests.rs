//! Factors after changes against factors made from nothing.

use std::collections::BTreeSet;
use std::sync::Arc;

use palpate_testing::{Fastest, Random, box_of_cells};
use proptest::prelude::*;

use crate::cholesky::packed::PackedFactor;
use crate::cholesky::stored::Stored;
use crate::cholesky::{Cholesky, FactorError, HalfSolution, Packed, Precision};
use crate::{BlockMatrix, BlockPattern, NodeOrder};

/// A mesh whose nodes keep their names while their numbers change.
#[derive(Clone, Default)]
struct Mesh {
    /// Names by number, and in the order of elimination.
    nodes: Vec<u32>,
    order: Vec<u32>,
    elements: Vec<Element>,
    next_name: u32,
    /// What new nodes are copies of.
    copies: Vec<(u32, u32)>,
    /// Held by almost nothing: single precision cannot solve it.
    is_loose: bool,
    /// A node that is pushed away.
    unstable: Option<u32>,
}

#[derive(Clone)]
struct Element {
    nodes: [u32; 4],
    seed: u64,
}

impl Mesh {
    fn number(&self, name: u32) -> Option<u32> {
        self.nodes.iter().position(|&other| other == name).map(|number| number as u32)
    }

    fn matrix(&self) -> BlockMatrix {
        let numbers = |element: &Element| element.nodes.map(|name| self.number(name).unwrap());
        let cliques: Vec<[u32; 4]> = self.elements.iter().map(numbers).collect();
        let pattern = Arc::new(BlockPattern::from_cliques(self.nodes.len(), &cliques));
        let mut matrix = BlockMatrix::zeros(pattern);
        let unit = |x: f64| [[x, 0.0, 0.0], [0.0, x, 0.0], [0.0, 0.0, x]];
        for (nodes, element) in cliques.iter().zip(&self.elements) {
            let mut random = Random(element.seed);
            for (index, &a) in nodes.iter().enumerate() {
                for &b in &nodes[..index] {
                    let mut block = [0; 3].map(|_| random.vector(0.5));
                    let stiffness = if self.is_loose { 1.0 } else { 2.0 };
                    if self.is_loose {
                        block = unit(-1.0);
                    }
                    if a == b {
                        continue;
                    }
                    let turned = std::array::from_fn(|i| std::array::from_fn(|k| block[k][i]));
                    matrix.add(a.max(b), a.min(b), if a > b { &block } else { &turned });
                    matrix.add(a, a, &unit(stiffness));
                    matrix.add(b, b, &unit(stiffness));
                }
            }
        }
        for (node, &name) in self.nodes.iter().enumerate() {
            let mass = if self.unstable == Some(name) {
                -1e6
            } else if self.is_loose {
                1e-6
            } else {
                0.1 + f64::from(name % 7)
            };
            matrix.add(node as u32, node as u32, &unit(mass));
        }
        matrix
    }

    fn order(&self, matrix: &BlockMatrix) -> NodeOrder {
        let order: Vec<u32> = self.order.iter().map(|&name| self.number(name).unwrap()).collect();
        NodeOrder::given(matrix.pattern(), &order)
    }

    fn add_node(&mut self, place: usize) -> u32 {
        let name = self.next_name;
        self.next_name += 1;
        self.nodes.push(name);
        self.order.insert(place, name);
        name
    }

    fn apply(&mut self, change: &Change) {
        let pick = |index: u32, count: usize| index as usize % count.max(1);
        match *change {
            Change::Nothing => {}
            Change::Split(node, sides) => {
                if self.nodes.is_empty() {
                    return;
                }
                let place = pick(node, self.order.len());
                let old = self.order[place];
                let new = self.add_node(place + 1);
                self.copies.push((new, old));
                let around = self.elements.iter_mut().filter(|e| e.nodes.contains(&old));
                for (index, element) in around.enumerate() {
                    if sides >> (index % 32) & 1 == 1 {
                        element.nodes = element.nodes.map(|n| if n == old { new } else { n });
                    }
                }
            }
            Change::RemoveElement(element) => {
                if !self.elements.is_empty() {
                    let element = pick(element, self.elements.len());
                    self.elements.remove(element);
                }
            }
            Change::Stiffness(element, seed) => {
                let element = pick(element, self.elements.len());
                if let Some(element) = self.elements.get_mut(element) {
                    element.seed = seed;
                }
            }
            Change::RemoveNode(node) => {
                if !self.nodes.is_empty() {
                    let name = self.nodes.remove(pick(node, self.nodes.len()));
                    self.order.retain(|&other| other != name);
                    self.elements.retain(|element| !element.nodes.contains(&name));
                }
            }
            Change::AddElement(nodes, seed) => {
                if !self.nodes.is_empty() {
                    let nodes = nodes.map(|node| self.nodes[pick(node, self.nodes.len())]);
                    self.elements.push(Element { nodes, seed });
                }
            }
            Change::AddPiece(seed) => {
                let nodes = [0; 4].map(|_| self.add_node(pick(seed as u32, self.order.len())));
                self.elements.push(Element { nodes, seed });
            }
            Change::Renumber => self.nodes.reverse(),
            Change::Order(a, b) => {
                if !self.nodes.is_empty() {
                    let count = self.order.len();
                    self.order.swap(pick(a, count), pick(b, count));
                }
            }
            Change::Everything(seed) => {
                self.elements.iter_mut().for_each(|e| e.seed = e.seed.wrapping_add(seed));
            }
            Change::Loose => self.is_loose = !self.is_loose,
            Change::Unstable(node) => {
                self.unstable = self.nodes.get(pick(node, self.nodes.len())).copied();
            }
        }
    }
}

#[derive(Clone, Debug)]
enum Change {
    Nothing,
    Split(u32, u32),
    RemoveElement(u32),
    Stiffness(u32, u64),
    RemoveNode(u32),
    AddElement([u32; 4], u64),
    AddPiece(u64),
    Renumber,
    Order(u32, u32),
    Everything(u64),
    Loose,
    Unstable(u32),
}

fn changes() -> impl Strategy<Value = Vec<Change>> {
    let change = prop_oneof![
        1 => Just(Change::Nothing),
        6 => (any::<u32>(), any::<u32>()).prop_map(|(node, sides)| Change::Split(node, sides)),
        2 => any::<u32>().prop_map(Change::RemoveElement),
        3 => (any::<u32>(), any::<u64>()).prop_map(|(e, seed)| Change::Stiffness(e, seed)),
        2 => any::<u32>().prop_map(Change::RemoveNode),
        1 => (any::<[u32; 4]>(), any::<u64>()).prop_map(|(n, seed)| Change::AddElement(n, seed)),
        1 => any::<u64>().prop_map(Change::AddPiece),
        1 => Just(Change::Renumber),
        1 => (any::<u32>(), any::<u32>()).prop_map(|(a, b)| Change::Order(a, b)),
        1 => any::<u64>().prop_map(Change::Everything),
        1 => Just(Change::Loose),
        1 => any::<u32>().prop_map(Change::Unstable),
    ];
    prop::collection::vec(change, 1..4)
}

/// Six tetrahedra per cell of a cube of `n` nodes along each axis.
fn grid(n: usize) -> Mesh {
    let (nodes, tetrahedra) = box_of_cells([n - 1; 3], Fastest::First, |place| place);
    let nodes: Vec<u32> = (0..nodes.len() as u32).collect();
    let mut mesh = Mesh {
        order: nodes.clone(),
        next_name: nodes.len() as u32,
        nodes,
        elements: (0..).zip(tetrahedra).map(|(seed, nodes)| Element { nodes, seed }).collect(),
        ..Mesh::default()
    };
    mesh.order = NodeOrder::new(mesh.matrix().pattern()).nodes;
    mesh
}

fn same_bits<P: Stored>(a: &PackedFactor<P>, b: &PackedFactor<P>) -> bool {
    let bytes = |factor: &PackedFactor<P>| -> Vec<u8> {
        bytemuck::cast_slice(factor.panels_of(0..factor.supernodes.len())).to_vec()
    };
    a.nodes_below == b.nodes_below && a.supernodes == b.supernodes && bytes(a) == bytes(b)
}

fn assert_same(changed: &Cholesky, fresh: &Cholesky) {
    assert_eq!(changed.order.nodes, fresh.order.nodes);
    match (&changed.packed, &fresh.packed) {
        (Packed::BlockFloat(a), Packed::BlockFloat(b)) => assert!(same_bits(a, b)),
        (Packed::Single(a), Packed::Single(b)) => assert!(same_bits(a, b)),
        (Packed::Double(a), Packed::Double(b)) => assert!(same_bits(a, b)),
        _ => panic!("kept in another precision"),
    }
    let count = fresh.node_count();
    let mut random = Random(count as u64);
    let rhs: Vec<_> = (0..count).map(|_| random.vector(0.5)).collect();
    let nodes: Vec<u32> = (0..count as u32).step_by(3).collect();
    let solved = |factor: &Cholesky| {
        let (mut x, mut workspace) = (rhs.clone(), factor.workspace());
        factor.solve_in_place(&mut x, &mut workspace);
        let mut halves = vec![HalfSolution::default(); nodes.len()];
        factor.half_solve(&nodes, &mut halves, &mut workspace);
        (x.as_flattened().iter().map(|x| x.to_bits()).collect::<Vec<_>>(), halves)
    };
    assert!(solved(changed) == solved(fresh));
}

/// A factor that has gone through changes, with its mesh.
struct History {
    mesh: Mesh,
    factor: Cholesky,
}

impl History {
    fn new(mesh: Mesh, precision: Precision) -> Self {
        let matrix = mesh.matrix();
        let factor = Cholesky::in_order(&matrix, precision, mesh.order(&matrix)).unwrap();
        Self { mesh, factor }
    }

    /// One change, compared with a factor made from nothing; where there is no factor, nothing changes.
    fn change(&mut self, changes: &[Change]) {
        let mut mesh = self.mesh.clone();
        for change in changes {
            mesh.apply(change);
        }
        let matrix = mesh.matrix();
        // Some copies name the same origin as the node that they are copies of.
        let copied = |name: u32| mesh.copies.iter().find(|&&(new, _)| new == name && new % 2 == 0);
        let origin = |&name: &u32| {
            let of_copy = || copied(name).and_then(|&(_, old)| self.mesh.number(old));
            self.mesh.number(name).or_else(of_copy)
        };
        let origins: Vec<Option<u32>> = mesh.nodes.iter().map(origin).collect();
        let changed =
            self.factor.changed(&matrix, self.factor.precision, mesh.order(&matrix), &origins);
        match (changed, Cholesky::in_order(&matrix, self.factor.precision, mesh.order(&matrix))) {
            (Ok(changed), Ok(fresh)) => {
                assert_same(&changed, &fresh);
                (self.mesh, self.factor) = (mesh, changed);
            }
            (changed, fresh) => assert_eq!(changed.err(), fresh.err()),
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(100))]

    #[test]
    fn any_history_gives_the_bits_of_a_new_factor(
        node_count in 1_u32..40,
        elements in prop::collection::vec((any::<[u32; 4]>(), any::<u64>()), 0..60),
        history in prop::collection::vec(changes(), 1..8),
        precision in 0_usize..3,
    ) {
        let nodes: Vec<u32> = (0..node_count).collect();
        let element = |&(nodes, seed): &([u32; 4], u64)| {
            Element { nodes: nodes.map(|node| node % node_count), seed }
        };
        let mesh = Mesh {
            order: nodes.clone(),
            nodes,
            elements: elements.iter().map(element).collect(),
            next_name: node_count,
            ..Mesh::default()
        };
        let precision = [Precision::Double, Precision::Single, Precision::BlockFloat][precision];
        let mut factor = History::new(mesh, precision);
        for changes in &history {
            factor.change(changes);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    #[test]
    fn local_changes_of_a_body_give_the_bits_of_a_new_factor(
        history in prop::collection::vec(changes(), 1..6),
        precision in 0_usize..3,
    ) {
        let precision = [Precision::Double, Precision::Single, Precision::BlockFloat][precision];
        let mut factor = History::new(grid(6), precision);
        for changes in &history {
            factor.change(changes);
        }
    }
}

#[test]
fn only_what_a_change_touches_is_computed() {
    let mut history = History::new(grid(9), Precision::Single);
    let all = history.factor.stats().supernodes;
    assert_eq!(history.factor.stats().computed, all);
    assert_eq!(history.factor.stats().kept_bytes, 0);
    history.change(&[Change::Nothing]);
    assert_eq!(history.factor.stats().computed, all);
    assert!(history.factor.stats().kept_bytes > 0);
    history.change(&[Change::Nothing, Change::Renumber]);
    assert_eq!(history.factor.stats().computed, 0);

    // The path from the element to the root, and small subtrees next to it.
    history.change(&[Change::Stiffness(17, 123)]);
    let path: BTreeSet<usize> = history.mesh.elements[17]
        .nodes
        .iter()
        .flat_map(|&name| {
            let supernodes = &history.factor.supernodes;
            let place = history.factor.places[history.mesh.number(name).unwrap() as usize];
            let first = supernodes.of_node(place as usize);
            std::iter::successors(Some(first), |&s| supernodes.parent(s))
        })
        .collect();
    let computed = history.factor.stats().computed;
    assert!(path.len() <= computed && computed < path.len() + all / 10, "{computed} of {all}");

    history.change(&[Change::Everything(5)]);
    assert_eq!(history.factor.stats().computed, all);
}

#[test]
fn a_factor_goes_on_after_a_change_that_fails_and_after_another_matrix() {
    let mut history = History::new(grid(5), Precision::BlockFloat);
    history.change(&[Change::Split(3, 1)]);
    let matrix = history.mesh.matrix();
    let fresh =
        Cholesky::in_order(&matrix, Precision::BlockFloat, history.mesh.order(&matrix)).unwrap();
    history.change(&[Change::Split(60, 5), Change::Unstable(60)]);
    assert_same(&history.factor, &fresh);
    history.change(&[Change::Split(40, 2)]);
    assert!(history.factor.stats().computed < history.factor.stats().supernodes);

    // Refactored: the next change starts from there.
    let mut stiffer = history.mesh.clone();
    stiffer.apply(&Change::Everything(3));
    history.factor.refactor(&stiffer.matrix()).unwrap();
    history.mesh = stiffer;
    history.change(&[Change::Split(20, 3)]);
    assert!(history.factor.stats().computed < history.factor.stats().supernodes);

    // A refactoring that fails keeps nothing.
    let mut unstable = history.mesh.clone();
    unstable.apply(&Change::Unstable(4));
    let failed = history.factor.refactor(&unstable.matrix());
    assert!(matches!(failed, Err(FactorError::NotPositiveDefinite { .. })));
    history.change(&[Change::Split(21, 3)]);
    assert_eq!(history.factor.stats().computed, history.factor.stats().supernodes);
}

#[test]
fn memory_in_which_another_thread_works_is_left_to_it() {
    let mut history = History::new(grid(4), Precision::Single);
    history.change(&[Change::Split(3, 1)]);
    let memory = history.factor.memory.clone();
    // As in a process that was forked while a thread of its parent was at work: it never lets go.
    let _held = memory.lock();
    history.change(&[Change::Split(20, 3)]);
    let matrix = history.mesh.matrix();
    let order = history.mesh.order(&matrix);
    assert_same(&history.factor, &Cholesky::in_order(&matrix, Precision::Single, order).unwrap());
    history.factor.refactor(&matrix).unwrap();
}
