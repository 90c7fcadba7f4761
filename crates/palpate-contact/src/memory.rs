//! What detection keeps in memory.

/// Bytes that the method of a scene keeps beside the meshes, the positions and the bounding trees.
///
/// The wide layout is all but `buffers`, which grow with what is found and are reused.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DetectionMemory {
    /// Node positions of the layout, and which nodes they are.
    pub nodes: usize,
    /// Which nodes the triangles, edges and points have, by block.
    pub elements: usize,
    /// Boxes of the triangles and of all levels above.
    pub triangle_boxes: usize,
    /// Boxes of the edges and of the nodes.
    pub feature_boxes: usize,
    /// Which triangles share nodes: needed for intersections.
    pub triangle_masks: usize,
    /// Which edges share nodes, and nodes are corners of triangles: needed for proximity.
    pub feature_masks: usize,
    /// Lists of block pairs, candidates and results.
    pub buffers: usize,
    /// Surface triangles of all bodies.
    pub triangle_count: usize,
}

impl DetectionMemory {
    /// Bytes of the layout, without the buffers.
    pub fn layout(&self) -> usize {
        let Self { nodes, elements, triangle_boxes, feature_boxes, .. } = self;
        nodes + elements + triangle_boxes + feature_boxes + self.triangle_masks + self.feature_masks
    }

    /// Bytes of the layout per surface triangle.
    pub fn layout_per_triangle(&self) -> f64 {
        self.layout() as f64 / self.triangle_count.max(1) as f64
    }
}
