"""Reads medical images: voxels, and where they lie."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from palpate._arrays import Float64Array
from palpate.errors import MeshError

#: Extensions of medical images; those of NRRD are read by pynrrd, the others by nibabel.
NRRD_SUFFIXES = (".nrrd", ".nhdr")
IMAGE_SUFFIXES = (".nii", ".nii.gz", ".mgz", ".mgh", ".hdr", ".img", ".mnc", *NRRD_SUFFIXES)

#: Metres in the units that images name; millimetres where they name none.
_UNITS = {"meter": 1.0, "m": 1.0, "mm": 1e-3, "micron": 1e-6, "um": 1e-6}

#: What makes the axes of NRRD's spaces those of all others: right, anterior, superior.
_SPACES = {"right": 1, "left": -1, "anterior": 1, "posterior": -1, "superior": 1, "inferior": -1}
_LETTERS = {name[0].upper(): name for name in _SPACES}


def is_image(path: str | os.PathLike[str]) -> bool:
    """Whether the extension names a medical image."""
    return Path(path).name.lower().endswith(IMAGE_SUFFIXES)


def read_image(path: Path) -> tuple[npt.NDArray[Any], Float64Array]:
    """Voxels (i, j, k) of an image file, and (4, 4) from their indices to places [m]."""
    nrrd = path.name.lower().endswith(NRRD_SUFFIXES)
    package = "pynrrd" if nrrd else "nibabel"
    read = _read_nrrd if nrrd else _read_nibabel
    if not path.exists():
        raise FileNotFoundError(2, "No such file", str(path))
    try:
        return read(path)
    except ImportError:
        raise MeshError(
            f"{path}: images need the package {package}: pip install 'palpate[mesh]'", str(path)
        ) from None
    except Exception as error:
        raise MeshError(f"{path}: not an image that can be read: {error}", str(path)) from error


def _read_nibabel(path: Path) -> tuple[npt.NDArray[Any], Float64Array]:
    import nibabel

    image: Any = nibabel.load(path)
    unit = "mm"
    if hasattr(image.header, "get_xyzt_units"):
        unit = image.header.get_xyzt_units()[0]
    placement = np.asarray(image.affine, dtype=np.float64).copy()
    placement[:3] *= _UNITS.get(unit, 1e-3)
    return np.asanyarray(image.dataobj), placement


def _read_nrrd(path: Path) -> tuple[npt.NDArray[Any], Float64Array]:
    import nrrd

    values, header = nrrd.read(str(path))
    if "space directions" not in header:
        raise ValueError("it has no space directions")
    directions = np.asarray(header["space directions"], dtype=np.float64)
    # Axes that are none of space (the segments) have no direction.
    directions = directions[np.isfinite(directions).all(axis=1)]
    placement = np.eye(4)
    placement[:3, :3] = directions.T
    placement[:3, 3] = header.get("space origin", np.zeros(3))
    space = str(header.get("space", "right-anterior-superior"))
    names = [_LETTERS[letter] for letter in space] if len(space) == 3 else space.split("-")[:3]
    placement[:3] *= np.array([_SPACES[name] for name in names])[:, None]
    placement[:3] *= _UNITS.get(next(iter(header.get("space units", ["mm"]))), 1e-3)
    return np.asarray(values), placement
