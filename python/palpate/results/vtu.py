"""VTK's XML files for ParaView: an unstructured grid (.vtu) and a time series of them (.pvd)."""

from __future__ import annotations

import base64
import sys
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np
import numpy.typing as npt

from palpate.results.atomic import write_bytes

#: VTK's numbers of the cells we write, by how many nodes they have.
_CELL_TYPES = {3: 5, 4: 10}
_TYPE_NAMES = {"f4": "Float32", "f8": "Float64", "i4": "Int32", "i8": "Int64", "u1": "UInt8"}
#: Bytes before compression in one block of VTK's zlib format.
_BLOCK = 1 << 20

_Array = npt.NDArray[np.generic]


class Grid:
    """Cells whose nodes move: what stays the same in every frame is encoded once.

    Parameters
    ----------
    point_count : int
        Nodes of all frames.
    cells : sequence of arrays of shape (m, 3) or (m, 4)
        Triangles and tetrahedra.
    cell_data : mapping of str to array, shape (total cells,)
        Values that do not change; others come with each frame.
    """

    def __init__(
        self,
        point_count: int,
        cells: Sequence[npt.NDArray[np.integer]],
        cell_data: Mapping[str, _Array],
    ) -> None:
        self._point_count = point_count
        sizes = [np.full(len(block), block.shape[1]) for block in cells]
        corners = np.concatenate(sizes) if sizes else np.empty(0, np.int64)
        self._cell_count = len(corners)
        connectivity = np.concatenate([block.reshape(-1) for block in cells]).astype(np.int32)
        types = np.select([corners == 3, corners == 4], [_CELL_TYPES[3], _CELL_TYPES[4]])
        parts = [
            "<Cells>",
            data_array("connectivity", connectivity),
            data_array("offsets", np.cumsum(corners).astype(np.int32)),
            data_array("types", types.astype(np.uint8)),
            "</Cells>",
            "<CellData>",
            *(data_array(name, values) for name, values in cell_data.items()),
        ]
        self._constant = "\n".join(parts)

    def write(
        self,
        path: Path,
        points: npt.NDArray[np.float64],
        point_data: Mapping[str, _Array],
        cell_data: Mapping[str, _Array] | None = None,
    ) -> None:
        """Write one frame, complete or absent; ``points`` [m], shape (n, 3)."""
        cell_data = cell_data or {}
        expected = [
            (self._point_count, {"points": points, **point_data}),
            (self._cell_count, cell_data),
        ]
        for count, arrays in expected:
            for name, values in arrays.items():
                if len(values) != count:
                    raise ValueError(f"{name}: expected {count} rows, got {len(values)}")
        text = "\n".join(
            [
                _heading("UnstructuredGrid"),
                "<UnstructuredGrid>",
                f'<Piece NumberOfPoints="{self._point_count}" NumberOfCells="{self._cell_count}">',
                "<Points>",
                data_array("Points", points),
                "</Points>",
                self._constant,
                *(data_array(name, values) for name, values in cell_data.items()),
                "</CellData>",
                "<PointData>",
                *(data_array(name, values) for name, values in point_data.items()),
                "</PointData>",
                "</Piece>",
                "</UnstructuredGrid>",
                "</VTKFile>",
                "",
            ]
        )
        write_bytes(path, text.encode("ascii"))


def data_array(name: str, values: _Array) -> str:
    """A DataArray element: zlib blocks in base64, in the machine's byte order."""
    array = np.ascontiguousarray(values)
    kind = _TYPE_NAMES[array.dtype.str[1:]]
    columns = "" if array.ndim == 1 else f' NumberOfComponents="{array.shape[1]}"'
    return (
        f'<DataArray type="{kind}" Name={quoteattr(name)}{columns} '
        f'format="binary">\n{_encoded(array.tobytes())}\n</DataArray>'
    )


def write_series(path: Path, frames: Sequence[tuple[float, str]]) -> None:
    """Write a .pvd: times [s] and the files of a series, relative to it."""
    rows = [
        f'<DataSet timestep="{time!r}" part="0" file={quoteattr(name)}/>' for time, name in frames
    ]
    text = "\n".join(
        [_heading("Collection"), "<Collection>", *rows, "</Collection>", "</VTKFile>", ""]
    )
    write_bytes(path, text.encode("utf-8"))


def _heading(kind: str) -> str:
    order = "LittleEndian" if sys.byteorder == "little" else "BigEndian"
    return (
        '<?xml version="1.0"?>\n'
        f'<VTKFile type="{kind}" version="1.0" byte_order="{order}" header_type="UInt64" '
        'compressor="vtkZLibDataCompressor">'
    )


def _encoded(raw: bytes) -> str:
    """VTK's form: block count, block size, size of a partial last one, compressed sizes; blocks."""
    blocks = [zlib.compress(raw[at : at + _BLOCK], 1) for at in range(0, len(raw), _BLOCK)]
    sizes = [len(blocks), _BLOCK, len(raw) % _BLOCK, *map(len, blocks)]
    header = np.asarray(sizes, dtype=np.uint64).tobytes()
    return (base64.b64encode(header) + base64.b64encode(b"".join(blocks))).decode("ascii")
