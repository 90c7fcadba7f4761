//! What is left out of the searches, whatever the method. A new filter is a file below and its line in
//! the list.

mod groups;
mod ignored;

use palpate_model::{Mesh, MeshChange};

/// Surface elements of two bodies, or of one, by index.
#[derive(Clone, Copy, Debug)]
pub(crate) enum ElementPair {
    /// A triangle of each.
    Triangles([u32; 2]),
    /// A node of the first and a triangle of the second.
    NodeAndTriangle([u32; 2]),
    /// An edge of each.
    Edges([u32; 2]),
}

/// A reason to leave something out. What it goes by is its own, by index of the body; methods of the
/// scene that set it stand beside it.
pub(crate) trait Filter {
    /// Pairs of bodies a <= b that no search looks at, sorted. A body with itself is its self-contact.
    fn bodies(&self) -> &[[u32; 2]] {
        &[]
    }

    /// Whether elements of two bodies may be left out at all.
    fn concerns(&self, _bodies: [u32; 2]) -> bool {
        false
    }

    /// Whether two elements are no pair, of those that touch or are close: a node inside is inside.
    fn has(&self, _bodies: [u32; 2], _pair: ElementPair) -> bool {
        false
    }

    /// Another body stands at this index, or none.
    fn forget(&mut self, _body: u32) {}

    /// A body has gone; those after it have moved down by one index.
    fn remove(&mut self, body: u32);

    /// The same body has another mesh.
    fn replace(&mut self, _body: u32) {}

    /// A body with the mesh `before` was cut.
    fn change(&mut self, _body: u32, _before: &Mesh, _change: &MeshChange) {}
}

/// All filters from lines of a name and a type.
macro_rules! filters {
    ($($name:ident: $filter:ty,)*) => {
        /// What is left out of a scene's searches.
        #[derive(Debug, Default)]
        pub(crate) struct LeftOut {
            $(pub(crate) $name: $filter,)*
        }

        impl LeftOut {
            /// Whether a pair of bodies, in any order, is left out.
            #[inline]
            pub(crate) fn has_bodies(&self, a: u32, b: u32) -> bool {
                false $(|| holds(self.$name.bodies(), a, b))*
            }

            /// Whether elements of two bodies may be left out.
            #[inline]
            pub(crate) fn concerns(&self, bodies: [u32; 2]) -> bool {
                false $(|| self.$name.concerns(bodies))*
            }

            /// Whether two elements are left out.
            #[inline]
            pub(crate) fn has(&self, bodies: [u32; 2], pair: ElementPair) -> bool {
                false $(|| self.$name.has(bodies, pair))*
            }

            /// Calls `each` with every pair of bodies that is left out, once.
            pub(crate) fn for_each_pair(&self, mut each: impl FnMut(u32, u32)) {
                let lists = [$(self.$name.bodies()),*];
                for (index, pairs) in lists.iter().enumerate() {
                    for &[a, b] in *pairs {
                        if !lists[..index].iter().any(|before| holds(before, a, b)) {
                            each(a, b);
                        }
                    }
                }
            }

            fn each(&mut self, mut call: impl FnMut(&mut dyn Filter)) {
                $(call(&mut self.$name);)*
            }
        }
    };
}

filters! {
    ignored: ignored::IgnoredPairs,
    groups: groups::Groups,
}

/// As what [`Filter`] has to be told of the bodies.
impl LeftOut {
    pub(crate) fn forget(&mut self, body: u32) {
        self.each(|filter| filter.forget(body));
    }

    pub(crate) fn remove(&mut self, body: u32) {
        self.each(|filter| filter.remove(body));
    }

    pub(crate) fn replace(&mut self, body: u32) {
        self.each(|filter| filter.replace(body));
    }

    pub(crate) fn change(&mut self, body: u32, before: &Mesh, change: &MeshChange) {
        self.each(|filter| filter.change(body, before, change));
    }
}

#[inline]
fn holds(pairs: &[[u32; 2]], a: u32, b: u32) -> bool {
    !pairs.is_empty() && pairs.binary_search(&[a.min(b), a.max(b)]).is_ok()
}
