//! The upper tree: connection elements (CE) over the bodies, whose boxes decide which bodies can touch.

use palpate_geometry::Aabb;
use palpate_model::Structure;

use crate::error::SceneError;

#[derive(Clone, Copy, Debug, PartialEq)]
struct UpperNode {
    bounds: Aabb,
    /// Index of the first node after this subtree; nodes stand in preorder.
    skip: u32,
    /// The body of a leaf, `None` for a join.
    body: Option<u32>,
}

/// Binary tree whose leaves are the bodies.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct UpperTree {
    nodes: Vec<UpperNode>,
    leaf_of_body: Vec<u32>,
}

impl UpperTree {
    /// The tree that the model's text describes.
    pub(crate) fn from_structure(
        structure: &Structure,
        body_count: usize,
    ) -> Result<Self, SceneError> {
        let mut shape = Vec::new();
        let mut seen = vec![false; body_count];
        let mut pending = vec![structure];
        while let Some(part) = pending.pop() {
            match part {
                Structure::Body(body) => {
                    let Some(seen) = seen.get_mut(*body) else {
                        return Err(SceneError::StructureBody { body: *body, count: body_count });
                    };
                    if std::mem::replace(seen, true) {
                        return Err(SceneError::StructureRepeats { body: *body });
                    }
                    shape.push(Some(*body as u32));
                }
                Structure::Join(left, right) => {
                    shape.push(None);
                    pending.push(right);
                    pending.push(left);
                }
            }
        }
        if let Some(body) = seen.iter().position(|&seen| !seen) {
            return Err(SceneError::StructureMisses { body });
        }
        Ok(Self::from_shape(shape))
    }

    /// A tree made from where the bodies are: halves by count along the longest axis.
    pub(crate) fn from_bounds(bounds: &[Aabb]) -> Self {
        let mut bodies: Vec<u32> = (0..bounds.len() as u32).collect();
        let mut shape = Vec::new();
        let mut pending = vec![(0, bodies.len())];
        while let Some((start, end)) = pending.pop() {
            let range = &mut bodies[start..end];
            if range.len() <= 1 {
                shape.extend(range.first().map(|&body| Some(body)));
                continue;
            }
            let all =
                range.iter().fold(Aabb::EMPTY, |all, &body| all.union(&bounds[body as usize]));
            let axis = all.longest_axis();
            let center = |body: u32| bounds[body as usize].center()[axis];
            range.sort_unstable_by(|&left, &right| {
                center(left).total_cmp(&center(right)).then(left.cmp(&right))
            });
            let middle = start + range.len() / 2;
            shape.push(None);
            pending.push((middle, end));
            pending.push((start, middle));
        }
        Self::from_shape(shape)
    }

    /// A new join above everything, with the new body, the last index, on its right.
    pub(crate) fn add(&mut self) {
        let mut shape = self.shape();
        if !shape.is_empty() {
            shape.insert(0, None);
        }
        shape.push(Some(self.leaf_of_body.len() as u32));
        *self = Self::from_shape(shape);
    }

    /// Takes a body out; its sibling takes the place of their join, and later bodies move down by one.
    pub(crate) fn remove(&mut self, body: usize) {
        let leaf = self.leaf_of_body[body];
        let end = self.nodes[leaf as usize].skip;
        let is_parent = |&index: &u32| {
            let node = &self.nodes[index as usize];
            let left = index + 1;
            node.body.is_none() && (left == leaf || self.nodes[left as usize].skip == leaf)
        };
        // The nearest node before the leaf that has it as a child.
        let parent =
            (0..leaf).rev().filter(|i| self.nodes[*i as usize].skip >= end).find(is_parent);
        let shape = (0..self.nodes.len() as u32)
            .filter(|&index| index != leaf && Some(index) != parent)
            .map(|index| self.nodes[index as usize].body)
            .map(|kept| kept.map(|kept| kept - u32::from(kept as usize > body)))
            .collect();
        *self = Self::from_shape(shape);
    }

    /// Recomputes the boxes from the bodies' boxes.
    pub(crate) fn refit(&mut self, bounds_of: impl Fn(usize) -> Aabb) {
        for index in (0..self.nodes.len()).rev() {
            let bounds = if let Some(body) = self.nodes[index].body {
                bounds_of(body as usize)
            } else {
                let right = self.nodes[index + 1].skip as usize;
                self.nodes[index + 1].bounds.union(&self.nodes[right].bounds)
            };
            self.nodes[index].bounds = bounds;
        }
    }

    /// Collects the pairs (a < b) of bodies whose boxes meet, sorted; returns the nodes visited.
    pub(crate) fn pairs(&self, found: &mut Vec<(u32, u32)>) -> u64 {
        let mut visited = 0;
        for &leaf in &self.leaf_of_body {
            let UpperNode { bounds, body: Some(body), skip } = self.nodes[leaf as usize] else {
                continue;
            };
            let mut index = skip;
            while let Some(node) = self.nodes.get(index as usize) {
                visited += 1;
                if !node.bounds.intersects(&bounds) {
                    index = node.skip;
                    continue;
                }
                if let Some(other) = node.body {
                    found.push((body.min(other), body.max(other)));
                }
                index += 1;
            }
        }
        found.sort_unstable();
        visited
    }

    /// Calls `visit` with each body for which `key` of its box, and of all above it, is finite and at
    /// most that of `limit`, which `visit` may lower; of two parts, the one with the smaller key first.
    pub(crate) fn visit<S>(
        &self,
        state: &mut S,
        key: &impl Fn(&S, &Aabb) -> f64,
        limit: &impl Fn(&S) -> f64,
        visit: &mut impl FnMut(&mut S, u32),
    ) {
        if !self.nodes.is_empty() {
            self.visit_from(0, state, key, limit, visit);
        }
    }

    fn visit_from<S>(
        &self,
        index: u32,
        state: &mut S,
        key: &impl Fn(&S, &Aabb) -> f64,
        limit: &impl Fn(&S) -> f64,
        visit: &mut impl FnMut(&mut S, u32),
    ) {
        let node = &self.nodes[index as usize];
        if let Some(body) = node.body {
            return visit(state, body);
        }
        let (left, right) = (index + 1, self.nodes[index as usize + 1].skip);
        let of = |state: &S, child: u32| key(state, &self.nodes[child as usize].bounds);
        let mut parts = [(of(state, left), left), (of(state, right), right)];
        if parts[1].0 < parts[0].0 {
            parts.swap(0, 1);
        }
        for (key_of_part, part) in parts {
            if key_of_part < f64::INFINITY && key_of_part <= limit(state) {
                self.visit_from(part, state, key, limit, visit);
            }
        }
    }

    /// Box around all bodies.
    pub(crate) fn bounds(&self) -> Aabb {
        self.nodes.first().map_or(Aabb::EMPTY, |root| root.bounds)
    }

    fn shape(&self) -> Vec<Option<u32>> {
        self.nodes.iter().map(|node| node.body).collect()
    }

    /// `shape`: preorder of a full binary tree, bodies as leaves.
    fn from_shape(shape: Vec<Option<u32>>) -> Self {
        let body_count = shape.iter().flatten().count();
        let mut nodes: Vec<UpperNode> = shape
            .into_iter()
            .map(|body| UpperNode { bounds: Aabb::EMPTY, skip: 0, body })
            .collect();
        let mut leaf_of_body = vec![0; body_count];
        for index in (0..nodes.len()).rev() {
            if let Some(body) = nodes[index].body {
                nodes[index].skip = index as u32 + 1;
                leaf_of_body[body as usize] = index as u32;
            } else {
                let right = nodes[index + 1].skip as usize;
                nodes[index].skip = nodes[right].skip;
            }
        }
        Self { nodes, leaf_of_body }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bounds(body: usize) -> Aabb {
        let low = [1.0, 4.0, 2.0, 8.0, 2.5, 0.0][body];
        Aabb { min: [low, 0.0, 0.0], max: [low + 1.0, 1.0, 1.0] }
    }

    fn pairs_of(tree: &mut UpperTree, bounds: impl Fn(usize) -> Aabb) -> Vec<(u32, u32)> {
        tree.refit(bounds);
        let mut pairs = Vec::new();
        tree.pairs(&mut pairs);
        pairs
    }

    fn brute(count: usize, bounds: impl Fn(usize) -> Aabb) -> Vec<(u32, u32)> {
        let all = (0..count).flat_map(|a| (a + 1..count).map(move |b| (a, b)));
        let meet = all.filter(|&(a, b)| bounds(a).intersects(&bounds(b)));
        meet.map(|(a, b)| (a as u32, b as u32)).collect()
    }

    #[test]
    fn every_shape_finds_the_same_pairs() {
        let all: Vec<Aabb> = (0..6).map(bounds).collect();
        let chain = (0..5).rev().fold(Structure::Body(5), |rest, body| {
            Structure::Join(Box::new(Structure::Body(body)), Box::new(rest))
        });
        let expected = brute(6, bounds);
        assert_eq!(expected, [(0, 2), (0, 5), (2, 4)]);
        let mut tree = UpperTree::from_structure(&chain, 6).expect("a chain of six");
        assert_eq!(pairs_of(&mut tree, bounds), expected);
        assert_eq!(pairs_of(&mut UpperTree::from_bounds(&all), bounds), expected);
        let mut grown = UpperTree::default();
        for _ in 0..6 {
            grown.add();
        }
        assert_eq!(pairs_of(&mut grown, bounds), expected);
    }

    #[test]
    fn removing_any_body_keeps_the_others() {
        let all: Vec<Aabb> = (0..6).map(bounds).collect();
        for removed in 0..6 {
            let mut tree = UpperTree::from_bounds(&all);
            tree.remove(removed);
            assert_eq!(tree.nodes.len(), 9);
            let left = |body: usize| bounds(body + usize::from(body >= removed));
            assert_eq!(pairs_of(&mut tree, left), brute(5, left));
            for _ in 0..5 {
                tree.remove(0);
            }
            assert_eq!(tree, UpperTree::default());
        }
    }

    #[test]
    fn structures_that_are_not_the_bodies_are_refused() {
        let join = |a, b| Structure::Join(Box::new(a), Box::new(b));
        let of = |structure, count| UpperTree::from_structure(&structure, count);
        let (zero, one) = (Structure::Body(0), Structure::Body(1));
        assert_eq!(
            of(join(zero.clone(), one.clone()), 1),
            Err(SceneError::StructureBody { body: 1, count: 1 })
        );
        assert_eq!(
            of(join(zero.clone(), zero.clone()), 1),
            Err(SceneError::StructureRepeats { body: 0 })
        );
        assert_eq!(of(one, 2), Err(SceneError::StructureMisses { body: 0 }));
    }
}
