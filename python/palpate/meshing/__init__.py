"""Tetrahedra from a closed surface or from a segmented medical image."""

from palpate.meshing.image import label_surface, mesh_image
from palpate.meshing.surface import mesh_surface

__all__ = ["label_surface", "mesh_image", "mesh_surface"]
