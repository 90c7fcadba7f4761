"""Cuts through the Python API: scenes, simulations, files of strokes, errors."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

import palpate
from palpate.cli.app import app


def block(cells=(4, 3, 2), size=0.02, at=(0.0, 0.0, 0.003)):
    """A box of tetrahedra, six in each cube."""
    nx, ny, nz = cells
    grid = np.indices((nx + 1, ny + 1, nz + 1)).reshape(3, -1).T
    number = np.arange(len(grid)).reshape(nx + 1, ny + 1, nz + 1)
    tetrahedra = []
    for i, j, k in np.ndindex(*cells):
        corner = [number[i + (c & 1), j + (c >> 1 & 1), k + (c >> 2)] for c in range(8)]
        for a, b in [(1, 3), (3, 2), (2, 6), (6, 4), (4, 5), (5, 1)]:
            tetrahedra.append([corner[0], corner[a], corner[b], corner[7]])
    return palpate.Mesh(grid * size + at, tetrahedra, repair=True)


def stroke(x=0.03, depth=0.035):
    """A scalpel through x = ``x`` down to y = ``depth``."""
    edges = [[[x, y, -0.1], [x + 0.002, y, 0.2]] for y in (-0.05, depth / 2, depth)]
    return palpate.Blade.stroke(edges)


@pytest.fixture
def simulation():
    material = palpate.Material(young=20_000, law="neo-hookean", damping=0.02)
    body = palpate.Body(block(), "liver", material=material, fixed_nodes=[0, 1, 2])
    plate = palpate.Mesh(
        [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], triangles=[[0, 1, 2], [0, 2, 3]]
    )
    return palpate.Simulation([body, palpate.Body(plate, "plate", rigid=())])


def test_a_cut_maps_the_users_arrays(simulation):
    simulation.step(10)
    old = simulation.model.bodies[0].mesh
    before = simulation.positions[0]
    report = simulation.cut(stroke())
    (cut,) = report.bodies
    mesh = simulation.model.bodies[0].mesh
    assert cut.body == 0
    assert cut.change.mesh.nodes.shape == mesh.nodes.shape
    assert len(mesh.nodes) == len(old.nodes) + cut.new_nodes == len(simulation.positions[0])
    np.testing.assert_allclose(cut.change.at_nodes(before), simulation.positions[0], atol=1e-15)
    np.testing.assert_allclose(cut.change.at_nodes(old.nodes), mesh.nodes, atol=1e-15)
    own = np.arange(len(old.tetrahedra))
    assert cut.change.at_tetrahedra(own).tolist() == cut.change.tetrahedra.tolist()
    assert abs(cut.volume_change) < 1e-12
    assert abs(mesh.volume / old.volume - 1) < 1e-12
    assert set(report.times) == {"cutting", "detection", "mechanics", "total"}
    assert simulation.model.bodies[0].fixed_nodes[:3].tolist() == [0, 1, 2]
    simulation.step(30)
    assert np.isfinite(simulation.positions[0]).all()
    assert simulation.contact_forces[0].shape == mesh.nodes.shape


def test_a_blade_that_misses_changes_nothing(simulation):
    model = simulation.model
    report = simulation.cut(palpate.Blade.plane([5, 0, 0], [1, 0, 0], size=0.1))
    assert len(report) == 0
    assert simulation.model is model


def test_a_live_cut_opens_when_it_should_and_maps_the_users_arrays(simulation, tmp_path):
    simulation.step(10)
    old = simulation.positions[0]
    mesh = simulation.model.bodies[0].mesh
    assert not simulation.has_live_cuts
    assert simulation.cut_live(stroke(), delay=3) is None
    assert simulation.has_live_cuts
    snapshot = simulation.snapshot()
    for _ in range(3):
        report = simulation.step()
        assert report.cuts == ()
        assert simulation.positions[0].shape == old.shape
    simulation.save(tmp_path / "cut.palpate")
    report = simulation.step()
    (cut,) = report.cuts
    (body,) = cut.bodies
    assert set(cut.times) == {"cutting", "detection", "mechanics", "total"}
    assert 0 < report.stages["change"] <= report.times["total"]
    assert len(simulation.positions[0]) == len(old) + body.new_nodes
    np.testing.assert_allclose(
        body.change.at_nodes(mesh.nodes), simulation.model.bodies[0].mesh.nodes, atol=1e-15
    )
    expected = simulation.step(10)
    positions = simulation.positions[0]
    loaded = palpate.Simulation.load(tmp_path / "cut.palpate", threads=2)
    assert len(loaded.step(11).cuts) == 1
    simulation.restore(snapshot)
    assert simulation.model.bodies[0].mesh == mesh
    again = simulation.step(14)
    assert len(again.cuts) == 1
    for each in (loaded, simulation):
        np.testing.assert_array_equal(each.positions[0], positions)
    assert again.contacts == expected.contacts


def test_a_live_cut_may_miss_everything(simulation):
    simulation.cut_live(stroke(x=5.0), delay=1)
    assert [len(cut) for cut in simulation.step(3).cuts] == [0]


def test_cut_separate_and_go_back(simulation, tmp_path):
    simulation.step(5)
    start = simulation.snapshot()
    whole = len(simulation.positions[0])
    simulation.cut(palpate.Blade.plane([0.031, 0, 0], [1, 0.1, 0]))
    parts = simulation.separate()
    assert [body.name for body in simulation.model.bodies] == ["liver", "plate", "liver/2"]
    assert [old for old, _ in parts] == [0, 1, 0]
    assert simulation.model.bodies[2].material == simulation.model.bodies[0].material
    simulation.step(3)
    simulation.save(tmp_path / "cut.palpate")
    files = simulation.write_model(tmp_path / "after.bml")
    simulation.step(10)
    loaded = palpate.Simulation.load(tmp_path / "cut.palpate")
    loaded.step(10)
    for here, there in zip(simulation.positions, loaded.positions, strict=True):
        assert here.tobytes() == there.tobytes()
    again = palpate.read_model(tmp_path / "after.bml")
    assert {body.name for body in again.bodies} == {"liver", "plate", "liver/2"}
    assert len(files) == 4
    simulation.restore(start)
    assert len(simulation.positions) == 2
    assert len(simulation.positions[0]) == whole
    loaded.reset()
    assert loaded.time == 0
    assert len(loaded.model.bodies) == 2


def test_removal_by_index_and_by_mask(simulation):
    count = len(simulation.model.bodies[0].mesh.tetrahedra)
    first = simulation.remove("liver", [3, 5])
    assert len(first.change.tetrahedra) == count - 2
    assert first.released == 0
    mask = np.zeros(count - 2, dtype=bool)
    mask[:4] = True
    simulation.remove(0, mask)
    assert len(simulation.model.bodies[0].mesh.tetrahedra) == count - 6
    simulation.step(2)


def test_a_scene_keeps_its_tree_through_cuts():
    mesh = block((5, 4, 3))
    scene = palpate.Scene([mesh, block(at=(0.011, 0.013, 0.002))], method="paper")
    every = palpate.Scene([mesh, block(at=(0.011, 0.013, 0.002))], method="all-pairs")
    leaves = scene.tree_stats(0)["leaves"]
    for number in range(6):
        blade = palpate.Blade.plane([0.013 * number, 0.02, 0], [1, 0.3 * number, 0.1])
        cuts = scene.cut(blade)
        assert [each.body for each in every.cut(blade)] == [each.body for each in cuts]
        shifted = [scene.positions(0), scene.positions(1) + np.array([0, 0, 0.001])]
        for each in (scene, every):
            each.update(shifted)
        assert scene.intersections().pairs.tolist() == every.intersections().pairs.tolist()
        close, expected = scene.proximity(0.002), every.proximity(0.002)
        assert close.elements.tolist() == expected.elements.tolist()
    assert scene.tree_stats(0)["leaves"] == leaves
    change = scene.remove(0, [1, 2])
    assert len(change.tetrahedra) == len(scene.meshes[0].tetrahedra)


def test_a_scene_goes_on_with_a_cut_as_a_simulation_does(simulation):
    scene = palpate.Scene([simulation.model.bodies[0]])
    for step in range(55):
        edges = [[[0.033, y, -0.1], [0.036, y, 0.2]] for y in 0.0013 * np.array([step, step + 1])]
        blade = palpate.Blade.stroke(edges)
        simulation.cut(blade)
        scene.cut(blade)
    mesh = scene.meshes[0]
    assert mesh.tetrahedra.tolist() == simulation.model.bodies[0].mesh.tetrahedra.tolist()
    assert mesh.nodes.tolist() == simulation.model.bodies[0].mesh.nodes.tolist()
    assert len(simulation.separate()) == 3  # the plate and two pieces


def test_blades():
    square = palpate.Blade.plane([0, 0, 0], [0, 0, 2.0], size=0.5)
    assert square.points.shape == (4, 3)
    assert len(square.triangles) == 2
    ring = palpate.Blade.loop([[0, 0, 0], [1, 0, 0], [1, 1, 0.1], [0, 1, 0]])
    assert len(ring.triangles) >= 2
    own = palpate.Blade([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    assert repr(own) == "Blade(3 points, 1 triangles)"


def slow_stroke(simulation, steps=40):
    """A scalpel through the whole body, in steps much shorter than an edge; a step after each."""
    ys = np.linspace(-0.01, 0.07, steps + 1)
    edges = np.array([[[0.031, y, -0.1], [0.034, y, 0.2]] for y in ys])
    for first in range(steps):
        simulation.cut(palpate.Blade.stroke(edges[first : first + 2]))
        simulation.step()


def test_short_steps_cut_a_body_through(simulation, tmp_path):
    assert np.diff(np.linspace(-0.01, 0.07, 41)).max() < 0.02 / 9
    simulation.step(5)
    start = simulation.snapshot()
    slow_stroke(simulation)
    assert [old for old, _ in simulation.separate()] == [0, 1, 0]
    # The same in two halves, the second from a checkpoint.
    simulation.restore(start)
    edges = [[[0.031, y, -0.1], [0.034, y, 0.2]] for y in np.linspace(-0.01, 0.07, 41)]
    for first in range(40):
        if first == 17:
            simulation.save(tmp_path / "half.palpate")
            simulation = palpate.Simulation.load(tmp_path / "half.palpate")
        simulation.cut(palpate.Blade.stroke(edges[first : first + 2]))
        simulation.step()
    after = simulation.positions[0].tobytes()
    simulation.restore(start)
    slow_stroke(simulation)
    assert simulation.positions[0].tobytes() == after


def test_the_smallest_piece_is_the_users_choice(simulation):
    start = simulation.snapshot()
    corner = palpate.Blade.plane([0.006, 0.006, 0.009], [1, 1, 1])
    for asked, count in [(0, 2), (30, 1)]:
        simulation.restore(start)
        report = simulation.cut(corner, min_piece=asked)
        assert [each.pieces for each in report.bodies] in ([count], [] if count == 1 else [count])
    with pytest.raises(palpate.SimulationError, match="min_piece"):
        simulation.cut(corner, min_piece=-1)


@pytest.mark.parametrize(
    ("make", "error", "words"),
    [
        (lambda: palpate.Blade.stroke([[[0, 0, 0], [0, 0, 1]]]), ValueError, "at least 2"),
        (lambda: palpate.Blade.stroke(np.zeros((3, 3))), ValueError, r"\(n, 2, 3\)"),
        (lambda: palpate.Blade.plane([0, 0, 0], [0, 0, 0]), ValueError, "normal"),
        (lambda: palpate.Blade.plane([0, 0, np.nan], [0, 0, 1]), ValueError, "finite"),
        (lambda: palpate.Blade([[0, 0, 0]], [[0, 1, 2]]), ValueError, "triangle 0"),
        (lambda: palpate.Blade.loop([[0, 0, 0], [1, 0, 0]]), ValueError, "at least 3"),
    ],
)
def test_bad_blades_say_why(make, error, words):
    with pytest.raises(error, match=words):
        make()


def test_bad_cuts_change_nothing(simulation):
    before = simulation.positions[0].tobytes()
    with pytest.raises(TypeError, match=r"expected a palpate\.Blade"):
        simulation.cut("knife")
    with pytest.raises(palpate.SimulationError, match="snap"):
        simulation.cut(stroke(), snap=3.0)
    with pytest.raises(IndexError, match="100000"):
        simulation.remove(0, [100_000])
    with pytest.raises(palpate.SimulationError, match="twice"):
        simulation.remove(0, [1, 1])
    with pytest.raises(palpate.SimulationError, match="rigid"):
        simulation.remove("plate", [])
    with pytest.raises(palpate.SimulationError, match="leave nothing"):
        simulation.remove(0, range(len(simulation.model.bodies[0].mesh.tetrahedra)))
    assert simulation.positions[0].tobytes() == before


def test_the_command_cuts_as_its_file_says(tmp_path):
    strokes = tmp_path / "strokes.txt"
    strokes.write_text(
        "blade 1\nplane at step 2\n  0 0 0.1  1 0.1 0\nplane at 0.08 s\n  0 0 0.1  0.1 1 0\n",
        encoding="utf-8",
    )
    assert [each.step for each in palpate.read_blades(strokes)] == [2, None]
    arguments = ["simulate", "small", "--duration", "0.15", "--cut", str(strokes)]
    run = CliRunner().invoke(app, [*arguments, "--output", str(tmp_path / "out"), "--json"])
    assert run.exit_code == 0, run.output
    report = json.loads((tmp_path / "out" / "report.json").read_text(encoding="utf-8"))
    assert len(report["cuts"]) == 2
    assert report["cuts"][0]["step"] == 2
    assert (tmp_path / "out" / "pictures" / "strip.png").exists()
    frames = sorted((tmp_path / "out" / "frames").glob("*.vtu"))
    assert len(frames) == 10
    assert frames[0].stat().st_size != frames[-1].stat().st_size


def test_a_broken_file_of_strokes_names_the_line(tmp_path):
    strokes = tmp_path / "strokes.txt"
    strokes.write_text("blade 1\nplane at step 2\n  0 0\n", encoding="utf-8")
    with pytest.raises(ValueError, match=r"line 3|:3"):
        palpate.read_blades(strokes)
    with pytest.raises(FileNotFoundError):
        palpate.read_blades(tmp_path / "none.txt")
