//! The shape of bounding trees.

use palpate_contact::{BoundingTree, Split, TreeDefect};
use palpate_geometry::Aabb;
use palpate_model::{Mesh, MeshData};

use crate::scenes::{Random, block, horseshoe, jittered, sheet};

#[test]
fn one_element_per_leaf_gives_twice_the_elements_less_one() {
    let mut random = Random(1);
    for mesh in [horseshoe(10, 2, [0.0; 3]), jittered([3, 4, 5], [0.0; 3], 0.2, &mut random)] {
        for split in [Split::Middle, Split::Count] {
            let stats = BoundingTree::new(&mesh, 1, split).stats();
            assert_eq!(stats.element_count, mesh.tetrahedra().len());
            assert_eq!(stats.triangle_count, mesh.triangles().len());
            assert_eq!(stats.node_count, 2 * stats.element_count - 1);
            assert_eq!(stats.expected_node_count, stats.node_count as f64);
            assert_eq!(stats.leaf_fill, [0, stats.leaf_count]);
        }
    }
}

#[test]
fn leaves_hold_at_most_k() {
    let mesh = block([4, 4, 4], |p| p);
    for leaf_size in [1, 2, 3, 7, 1000] {
        for split in [Split::Middle, Split::Count] {
            let tree = BoundingTree::new(&mesh, leaf_size, split);
            assert_eq!(tree.validate(&mesh, mesh.nodes()), Ok(()));
            let stats = tree.stats();
            let elements: usize = stats.leaf_fill.iter().enumerate().map(|(n, c)| n * c).sum();
            assert_eq!(elements, stats.element_count);
            assert_eq!(stats.leaf_fill.iter().sum::<usize>(), stats.leaf_count);
            assert_eq!(stats.node_count, 2 * stats.leaf_count - 1);
            assert!(stats.depth_mean <= stats.depth_max as f64);
            if split == Split::Count {
                let halvings = (stats.element_count as f64 / leaf_size as f64).log2().ceil();
                assert!(stats.depth_max as f64 <= halvings.max(0.0) + 1.0);
            }
        }
    }
}

/// Boxes of a level by going down the children.
fn level_bounds(tree: &BoundingTree, node: usize, level: usize, found: &mut Vec<Aabb>) {
    match tree.children(node) {
        Some(children) if level > 0 => {
            for child in children {
                level_bounds(tree, child, level - 1, found);
            }
        }
        _ => found.extend(Some(tree.nodes()[node].bounds).filter(|bounds| !bounds.is_empty())),
    }
}

#[test]
fn every_level_holds_the_surface() {
    let mut random = Random(5);
    let meshes = [
        block([5, 4, 3], |p| p),
        jittered([4, 4, 6], [0.0; 3], 0.2, &mut random),
        sheet(4, 3, |p| p),
    ];
    for mesh in meshes {
        for split in [Split::Middle, Split::Count] {
            let tree = BoundingTree::new(&mesh, 2, split);
            assert_eq!(tree.level_bounds(0), [tree.bounds()]);
            let mut count = 0;
            for level in 0..=tree.stats().depth_max + 1 {
                let boxes = tree.level_bounds(level);
                let mut expected = Vec::new();
                level_bounds(&tree, 0, level, &mut expected);
                assert_eq!(boxes, expected);
                assert!(boxes.len() >= count);
                count = boxes.len();
                for triangle in mesh.triangles() {
                    let corners = triangle.map(|node| mesh.nodes()[node as usize]);
                    let inside = |bounds: &Aabb| corners.iter().all(|at| bounds.contains(at));
                    assert!(boxes.iter().any(inside));
                }
            }
        }
    }
}

#[test]
fn identical_centroids_are_split_by_count() {
    // Eight tetrahedra around the same centroid, each a little larger.
    let mut data = MeshData::default();
    for index in 0..8_u32 {
        let size = 2.0_f64.powi(index as i32);
        let corners = [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]];
        data.nodes.extend(corners.map(|corner| corner.map(|value| value * size)));
        data.tetrahedra.push([0, 2, 1, 3].map(|corner| 4 * index + corner));
    }
    let (mesh, _) = Mesh::repaired(data).expect("separate tetrahedra");
    for split in [Split::Middle, Split::Count] {
        let tree = BoundingTree::new(&mesh, 1, split);
        assert_eq!(tree.validate(&mesh, mesh.nodes()), Ok(()));
        assert_eq!(tree.stats().leaf_count, 8);
        assert_eq!(tree.stats().depth_max, 3);
    }
}

#[test]
fn geometric_clusters_make_a_deep_tree_and_no_overflow() {
    let mut data = MeshData::default();
    for index in 0..900_u32 {
        let at = 2.0_f64.powi(-(index as i32));
        let size = 0.1 * at;
        let corner = |x: f64, y: f64, z: f64| [at + size * x, size * y, size * z];
        data.nodes.extend([corner(0.0, 0.0, 0.0), corner(1.0, 0.0, 0.0)]);
        data.nodes.extend([corner(0.0, 1.0, 0.0), corner(0.0, 0.0, 1.0)]);
        data.tetrahedra.push([0, 1, 2, 3].map(|node| 4 * index + node));
    }
    let mesh = Mesh::new(data).expect("separate tetrahedra");
    let tree = BoundingTree::new(&mesh, 1, Split::Middle);
    assert_eq!(tree.validate(&mesh, mesh.nodes()), Ok(()));
    assert!(tree.stats().depth_max > 500);
    assert!(BoundingTree::new(&mesh, 1, Split::Count).stats().depth_max <= 10);
}

#[test]
fn leaves_without_surface_are_empty_and_the_middle_is_the_middle() {
    let mesh = block([5, 5, 5], |p| p);
    let tree = BoundingTree::new(&mesh, 1, Split::Middle);
    let empty = tree.leaves().iter().filter(|&&leaf| {
        let bounds = tree.nodes()[leaf as usize].bounds;
        assert_eq!(bounds.is_empty(), tree.triangles(leaf as usize).is_empty());
        bounds.is_empty()
    });
    assert!(empty.count() > 6 * 27 / 2);
    let bar = block([1, 1, 8], |p| [p[0], p[1], p[2] * p[2]]);
    let tree = BoundingTree::new(&bar, 30, Split::Middle);
    let [left, right] = tree.children(0).expect("48 tetrahedra do not fit");
    // The middle is z = 32: five whole cells (to 25) are below, and of the sixth (25 to 36) the four of
    // six tetrahedra whose centroids are at 27.75 and 30.5.
    assert_eq!((tree.elements(left).len(), tree.elements(right).len()), (34, 14));
    let tree = BoundingTree::new(&bar, 30, Split::Count);
    let [left, right] = tree.children(0).expect("48 tetrahedra do not fit");
    assert_eq!((tree.elements(left).len(), tree.elements(right).len()), (24, 24));
}

#[test]
fn triangles_of_a_surface_are_the_elements() {
    let mesh = sheet(6, 4, |p| p);
    let tree = BoundingTree::new(&mesh, 2, Split::Middle);
    assert_eq!(tree.validate(&mesh, mesh.nodes()), Ok(()));
    assert_eq!(tree.stats().element_count, 48);
    assert_eq!(tree.triangle_order(), tree.element_order());
}

#[test]
fn validate_sees_boxes_of_other_positions() {
    let mesh = block([2, 2, 2], |p| p);
    let mut tree = BoundingTree::new(&mesh, 2, Split::Middle);
    let mut moved = mesh.nodes().to_vec();
    moved[0][1] -= 0.25;
    assert_eq!(tree.validate(&mesh, &moved), Err(TreeDefect::Bounds { node: 0 }));
    tree.refit(&moved);
    assert_eq!(tree.validate(&mesh, &moved), Ok(()));
    assert_eq!(tree.bounds().min, [0.0, -0.25, 0.0]);
    let other = block([2, 2, 3], |p| p);
    assert!(tree.validate(&other, other.nodes()).is_err());
}
