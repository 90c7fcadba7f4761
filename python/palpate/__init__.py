"""Real-time contact detection and deformation for soft bodies made of tetrahedra."""

from palpate._core import __version__
from palpate.contacts import (
    ClosestPoints,
    DetectionStats,
    Intersections,
    Penetration,
    Proximity,
    RayHits,
)
from palpate.cutting import (
    Blade,
    BodyCut,
    CutReport,
    MeshChange,
    RemovalReport,
    Stroke,
    read_blades,
)
from palpate.errors import (
    CheckpointError,
    Diagnostic,
    MeshError,
    ModelError,
    PalpateError,
    SimulationError,
)
from palpate.files import read_mesh, write_mesh
from palpate.hands import Drive, Pull, Tool, ToolLoop
from palpate.mesh import Defect, Mesh
from palpate.meshing import label_surface, mesh_image, mesh_surface
from palpate.model import (
    Attachment,
    Body,
    Contact,
    Material,
    Model,
    RigidKey,
    TreeElement,
    read_model,
)
from palpate.scene import Scene
from palpate.simulation import Contacts, Simulation, Snapshot, StepReport

__all__ = [
    "Attachment",
    "Blade",
    "Body",
    "BodyCut",
    "CheckpointError",
    "ClosestPoints",
    "Contact",
    "Contacts",
    "CutReport",
    "Defect",
    "DetectionStats",
    "Diagnostic",
    "Drive",
    "Intersections",
    "Material",
    "Mesh",
    "MeshChange",
    "MeshError",
    "Model",
    "ModelError",
    "PalpateError",
    "Penetration",
    "Proximity",
    "Pull",
    "RayHits",
    "RemovalReport",
    "RigidKey",
    "Scene",
    "Simulation",
    "SimulationError",
    "Snapshot",
    "StepReport",
    "Stroke",
    "Tool",
    "ToolLoop",
    "TreeElement",
    "__version__",
    "label_surface",
    "mesh_image",
    "mesh_surface",
    "read_blades",
    "read_mesh",
    "read_model",
    "write_mesh",
]
