//! What hangs together.

/// Sets of numbers below a count, each number in one of them, joined pair by pair.
#[derive(Clone, Debug)]
pub struct DisjointSets(Vec<u32>);

impl DisjointSets {
    /// Each of `count` numbers in a set of its own.
    pub fn new(count: usize) -> Self {
        Self((0..count as u32).collect())
    }

    /// The smallest number of the set that `member` is in.
    ///
    /// # Panics
    /// If there is no such number.
    pub fn root(&mut self, mut member: u32) -> u32 {
        while self.0[member as usize] != member {
            let above = self.0[self.0[member as usize] as usize];
            self.0[member as usize] = above;
            member = above;
        }
        member
    }

    /// Makes one set of those that two numbers are in.
    ///
    /// # Panics
    /// If there is no such number.
    #[inline]
    pub fn join(&mut self, left: u32, right: u32) {
        if self.0[left as usize] == self.0[right as usize] {
            return;
        }
        let (left, right) = (self.root(left), self.root(right));
        self.0[left.max(right) as usize] = left.min(right);
    }
}
