"""Makes the example organs: implicit shapes, node placement, tetrahedra, improvement, checks."""
