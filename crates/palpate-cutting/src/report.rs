//! What a cut did.

/// What a cut did to a mesh, beside the new mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CutReport {
    /// Nodes more than before: points of crossed edges, and copies along the cut.
    pub new_nodes: usize,
    /// Tetrahedra more than before.
    pub new_tetrahedra: usize,
    /// Old tetrahedra that were split.
    pub split_tetrahedra: usize,
    /// Nodes close to the blade through which the cut passes instead.
    pub snapped_nodes: usize,
    /// Pieces without a common node, before.
    pub pieces_before: usize,
    /// Pieces without a common node, after.
    pub pieces: usize,
    /// Smallest radius ratio (`3 r_in / r_out`, 1 is regular) of the parts of split tetrahedra, at
    /// rest; none when none was split.
    pub smallest_quality: Option<f64>,
    /// Volume at rest after, relative to before, minus 1: rounding only, as no old node is moved.
    pub volume_change: f64,
    /// Area [m²] of one lip of the cut, at present positions.
    pub cut_area: f64,
    /// Largest distance [m] of the cut from the blade's surface (continued beyond its border) at
    /// old nodes through which it passes, at present positions.
    pub deviation: f64,
}

impl CutReport {
    /// This cut and `next` of the mesh that it made, as one.
    #[must_use]
    pub fn then(&self, next: &Self) -> Self {
        let qualities = [self.smallest_quality, next.smallest_quality].into_iter().flatten();
        Self {
            new_nodes: self.new_nodes + next.new_nodes,
            new_tetrahedra: self.new_tetrahedra + next.new_tetrahedra,
            split_tetrahedra: self.split_tetrahedra + next.split_tetrahedra,
            snapped_nodes: self.snapped_nodes + next.snapped_nodes,
            pieces_before: self.pieces_before,
            pieces: next.pieces,
            smallest_quality: qualities.reduce(f64::min),
            volume_change: (1.0 + self.volume_change) * (1.0 + next.volume_change) - 1.0,
            cut_area: self.cut_area + next.cut_area,
            deviation: self.deviation.max(next.deviation),
        }
    }
}
