"""What results are made of: measures, VTK's files, contact depths, moments for pictures."""

import xml.etree.ElementTree as ET

import meshio
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import palpate
from palpate.results import vtu
from palpate.results.album import Album
from palpate.results.atomic import replacing
from palpate.results.frames import contact_depths
from palpate.results.measures import mean_ratios, signed_volumes
from palpate.results.record import spread
from palpate.results.vtu import Grid, write_series


def test_volumes_and_shapes_of_known_tetrahedra():
    regular = np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) * 0.01
    flat = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]])
    nodes = np.concatenate([regular, flat])
    tetrahedra = np.array([[0, 1, 2, 3], [1, 0, 2, 3], [4, 5, 6, 7]])
    volumes = signed_volumes(nodes, tetrahedra)
    edge = 0.01 * np.sqrt(8)
    assert np.abs(volumes[:2]) == pytest.approx([edge**3 / (6 * np.sqrt(2))] * 2)
    assert volumes[0] == -volumes[1]
    assert volumes[2] == 0
    assert sorted(mean_ratios(nodes, tetrahedra)) == pytest.approx([-1, 0, 1])


def test_signed_volumes_are_those_of_the_mesh(make_box):
    mesh = make_box((3, 2, 1), size=0.4)
    assert signed_volumes(mesh.nodes, mesh.tetrahedra).sum() == pytest.approx(mesh.volume)


arrays = st.tuples(
    st.sampled_from(["f4", "f8", "i4", "i8", "u1"]), st.integers(0, 50), st.sampled_from([1, 3])
)


@settings(deadline=None)
@given(arrays, st.integers(0, 2**32 - 1))
def test_point_data_reads_back_bit_for_bit(tmp_path_factory, shape, seed):
    kind, extra, columns = shape
    random = np.random.default_rng(seed)
    count = 4 + extra
    values = random.integers(0, 100, size=(count, columns) if columns > 1 else count).astype(kind)
    if kind[0] == "f":
        values = values * np.asarray(1.1, kind)
    points = random.normal(size=(count, 3))
    cells = [np.array([[0, 1, 2, 3]]), np.array([[0, 1, 2], [1, 2, 3]])]
    path = tmp_path_factory.mktemp("vtu") / "a.vtu"
    grid = Grid(count, cells, {"body": np.array([5, 6, 7], np.int32)})
    grid.write(path, points, {"a < b": values})
    back = meshio.read(path)
    assert back.points.tobytes() == points.tobytes()
    assert back.point_data["a < b"].dtype == values.dtype
    assert np.array_equal(back.point_data["a < b"].reshape(values.shape), values)
    assert np.array_equal(back.cells_dict["tetra"], cells[0])
    assert np.array_equal(back.cells_dict["triangle"], cells[1])
    assert back.cell_data["body"][0].tolist() == [5]
    assert back.cell_data["body"][1].tolist() == [6, 7]


def test_data_larger_than_a_block_of_vtk(tmp_path, monkeypatch):
    monkeypatch.setattr(vtu, "_BLOCK", 1 << 10)
    for count in (128, 400, 4096):  # 24 bytes a point: whole blocks and partial ones
        points = np.random.default_rng(count).normal(size=(count, 3))
        path = tmp_path / "a.vtu"
        Grid(count, [np.array([[0, 1, 2]])], {}).write(path, points, {})
        assert np.array_equal(meshio.read(path).points, points)


def test_a_grid_refuses_data_of_another_length(tmp_path):
    grid = Grid(4, [np.array([[0, 1, 2, 3]])], {})
    with pytest.raises(ValueError, match="speed: expected 4 rows, got 3"):
        grid.write(tmp_path / "a.vtu", np.zeros((4, 3)), {"speed": np.zeros(3)})
    assert list(tmp_path.iterdir()) == []


def test_the_index_keeps_times_and_names(tmp_path):
    frames = [(0.1 + 0.2, "frames/a.vtu"), (1e-9, 'b "&".vtu')]
    write_series(tmp_path / "s.pvd", frames)
    root = ET.parse(tmp_path / "s.pvd").getroot()
    assert root.get("type") == "Collection"
    found = [(float(each.get("timestep")), each.get("file")) for each in root.iter("DataSet")]
    assert found == frames


def test_depth_of_contacts_at_their_nodes(make_box):
    """Two boxes that start inside each other by 4 mm: depths agree with a loop over contacts."""
    lower = palpate.Body(make_box((3, 3, 3), size=0.1), name="lower")
    upper = palpate.Body(make_box((2, 2, 2), size=0.08, origin=(0.01, 0.012, 0.096)), name="upper")
    simulation = palpate.Simulation([lower, upper], time_step=1e-3)
    simulation.step()
    contacts = simulation.contacts
    assert (contacts.gaps < 0).any()
    expected = [np.zeros(64), np.zeros(27)]
    for i in range(len(contacts)):
        on_a = 1 if contacts.kinds[i] == 0 else 2
        for k in range(4):
            body = contacts.bodies[i, 0 if k < on_a else 1]
            node = contacts.nodes[i, k]
            if contacts.weights[i, k] != 0:
                expected[body][node] = max(expected[body][node], -contacts.gaps[i])
    depths = contact_depths(simulation, np.array([0, 64, 91]))
    assert np.array_equal(depths, np.concatenate(expected))
    assert 0 < depths.max() < 0.005


def test_depths_are_zero_without_contact(cube):
    simulation = palpate.Simulation([cube])
    simulation.step()
    assert not contact_depths(simulation, np.array([0, 8])).any()


class Still:
    """A simulation that only has a time."""

    positions = ()
    contact_forces = ()
    model = palpate.Model([palpate.Mesh(np.eye(4, 3), [[0, 1, 2, 3]], repair=True)])
    initial_model = model

    def __init__(self, time):
        self.time = time


@pytest.mark.parametrize("count", [1, 2, 3, 40, 1000])
def test_an_album_keeps_few_moments_and_finds_the_middle(count):
    album = Album(Still(0.0))
    for step in range(count):
        album.add(Still(float(step)))
    first, middle, last = (moment.time for moment in album._three())
    assert first == 0
    assert last == count - 1
    assert abs(middle - last / 2) <= max(0.5, count / 30)
    assert len(album._moments) <= 33


def test_spread_of_known_values():
    assert spread([4.0, 1.0, 3.0, 2.0, 5.0]) == {"median": 3, "min": 1, "max": 5, "p90": 4.6}


def test_a_file_is_complete_or_absent(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("old")

    def write_half():
        with replacing(path) as temporary:
            temporary.write_text("ha")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_half()
    assert path.read_text() == "old"
    assert [each.name for each in tmp_path.iterdir()] == ["a.txt"]
