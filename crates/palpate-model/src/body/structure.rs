//! How a model's bodies are joined: the upper part of the paper's binary tree.

use serde::{Deserialize, Serialize};

/// More joins above a body than this are refused in what is read: trees are walked by recursion.
const DEEPEST: usize = 10_000;

/// The upper binary tree: connection elements (CE) down to the bodies (NE).
///
/// It is stored as a list, children before their joins, so that no file makes its reader recurse.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(into = "Vec<Element>", try_from = "Vec<Element>")]
pub enum Structure {
    /// A body, by its index in [`Model::bodies`](super::Model::bodies).
    Body(usize),
    /// A connection element with its two subtrees; more than two children become a chain.
    Join(Box<Structure>, Box<Structure>),
}

impl Structure {
    /// Joins subtrees two by two from the left, a, b, c to ((a b) c); `None` of nothing.
    pub fn chain(children: impl IntoIterator<Item = Self>) -> Option<Self> {
        children.into_iter().reduce(|left, right| Self::Join(Box::new(left), Box::new(right)))
    }
}

/// An element of a structure in a list.
#[derive(Clone, Copy, Deserialize, Serialize)]
enum Element {
    Body(usize),
    /// Of the two subtrees that end before it.
    Join,
}

impl From<Structure> for Vec<Element> {
    fn from(structure: Structure) -> Self {
        let (mut list, mut waiting) = (Vec::new(), vec![structure]);
        // Joins before their right and then their left children, turned round at the end.
        while let Some(next) = waiting.pop() {
            match next {
                Structure::Body(body) => list.push(Element::Body(body)),
                Structure::Join(left, right) => {
                    list.push(Element::Join);
                    waiting.extend([*left, *right]);
                }
            }
        }
        list.reverse();
        list
    }
}

impl TryFrom<Vec<Element>> for Structure {
    type Error = &'static str;

    fn try_from(list: Vec<Element>) -> Result<Self, Self::Error> {
        // Subtrees that wait for their join, and how deep they are.
        let mut open: Vec<(Self, usize)> = Vec::new();
        for element in list {
            let next = match element {
                Element::Body(body) => (Self::Body(body), 0),
                Element::Join => {
                    let (Some((right, below)), Some((left, below_left))) = (open.pop(), open.pop())
                    else {
                        return Err("a join has fewer than two subtrees");
                    };
                    let depth = 1 + below.max(below_left);
                    if depth > DEEPEST {
                        return Err("bodies are joined too deep");
                    }
                    (Self::Join(Box::new(left), Box::new(right)), depth)
                }
            };
            open.push(next);
        }
        match (open.pop(), open.is_empty()) {
            (Some((whole, _)), true) => Ok(whole),
            _ => Err("the bodies are not all joined"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn join(left: Structure, right: Structure) -> Structure {
        Structure::Join(Box::new(left), Box::new(right))
    }

    #[test]
    fn a_structure_comes_back_from_its_list() {
        let body = Structure::Body;
        let left = join(body(3), join(body(0), body(7)));
        for structure in [body(2), left.clone(), join(left.clone(), body(1)), join(body(1), left)] {
            let list: Vec<Element> = structure.clone().into();
            assert_eq!(Structure::try_from(list), Ok(structure));
        }
    }

    #[test]
    fn lists_that_are_no_tree_are_refused() {
        use Element::{Body, Join};
        for list in [vec![], vec![Join], vec![Body(0), Join], vec![Body(0), Body(1)]] {
            assert!(Structure::try_from(list).is_err());
        }
    }

    #[test]
    fn lists_that_would_end_the_stack_are_refused() {
        let mut list = vec![Element::Body(0)];
        list.extend([Element::Body(1), Element::Join].repeat(1_000_000));
        assert!(Structure::try_from(list).is_err());
        let deep = Structure::chain((0..DEEPEST).map(Structure::Body)).unwrap();
        let list: Vec<Element> = deep.clone().into();
        assert_eq!(Structure::try_from(list), Ok(deep));
    }
}
