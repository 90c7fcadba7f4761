"""Simulation from Python: stepping, state, bits, physics that can be computed by hand."""

from dataclasses import replace

import numpy as np
import pytest

import palpate
from palpate.results.measures import node_means
from palpate.results.stress import VonMises, von_mises


@pytest.fixture
def falling(make_box):
    """A soft box above a rigid plate."""
    soft = palpate.Body(make_box((3, 3, 3), size=0.1, origin=(0, 0, 0.004)), name="soft")
    plate = palpate.Body(
        palpate.Mesh(
            [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], triangles=[[0, 1, 2], [0, 2, 3]]
        ),
        name="plate",
        rigid=(),
    )
    return palpate.Model([soft, plate])


def test_free_fall(make_box):
    simulation = palpate.Simulation([make_box((2, 2, 2), size=0.1)], time_step=0.01)
    start = simulation.positions[0]
    simulation.step(10)
    # Implicit Euler: v_n = -g n dt, x_n = x_0 - g dt^2 n (n + 1) / 2.
    drop = -9.81 * 0.01**2 * 10 * 11 / 2
    assert np.allclose(simulation.positions[0] - start, [0, 0, drop], atol=1e-12)
    assert np.allclose(simulation.velocities[0], [0, 0, -9.81 * 0.1], atol=1e-10)
    assert simulation.time == pytest.approx(0.1)


def test_a_box_comes_to_rest_and_the_plate_carries_its_weight(falling):
    simulation = palpate.Simulation(falling)
    report = simulation.step(240)
    assert report.contacts > 0
    weight = 1000 * 0.1**3 * 9.81
    soft, plate = simulation.contact_forces
    assert soft.sum(axis=0) == pytest.approx([0, 0, weight], rel=0.01, abs=0.01 * weight)
    assert np.abs(soft.sum(axis=0) + plate.sum(axis=0)).max() < 1e-12 * weight * 100
    assert np.abs(simulation.velocities[0]).max() < 1e-3
    assert simulation.positions[0][:, 2].min() > 0
    contacts = simulation.contacts
    assert len(contacts) == report.contacts
    assert contacts.forces.sum(axis=0)[2] == pytest.approx(weight, rel=0.01)
    stages = {"change", "update", "penetration", "proximity", "mechanics", "total"}
    assert set(report.times) == stages


@pytest.mark.parametrize("law", ["corotated", "stvk", "neo-hookean", "mooney-rivlin", "hgo"])
def test_a_box_of_any_law_comes_to_rest_and_restarts_with_the_same_bits(make_box, tmp_path, law):
    fibre = (0.0, 0.0, 1.0) if law == "hgo" else None
    material = palpate.Material(law=law, fibre=fibre, damping=0.03)
    box = make_box((3, 3, 3), size=0.1, origin=(0, 0, 0.004))
    plate = palpate.Mesh(
        [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], triangles=[[0, 1, 2], [0, 2, 3]]
    )
    bodies = [
        palpate.Body(box, name="soft", material=material),
        palpate.Body(plate, name="plate", rigid=()),
    ]
    simulation = palpate.Simulation(bodies)
    simulation.step(20)
    simulation.save(tmp_path / "middle")
    report = simulation.step(220)
    weight = 1000 * 0.1**3 * 9.81
    assert simulation.contact_forces[0].sum(axis=0)[2] == pytest.approx(weight, rel=0.01)
    assert np.abs(simulation.velocities[0]).max() < 2e-3
    again = palpate.Simulation.load(tmp_path / "middle")
    assert again.step(220).residual == report.residual
    assert np.array_equal(again.positions[0], simulation.positions[0])


def test_arrays_handed_out_never_change(falling):
    simulation = palpate.Simulation(falling)
    positions = simulation.positions[0]
    copy = positions.copy()
    simulation.step(3)
    assert np.array_equal(positions, copy)
    assert not positions.flags.writeable


def test_same_bits_at_any_thread_count(falling):
    results = []
    for threads in (1, 2, 5):
        simulation = palpate.Simulation(falling, threads=threads)
        simulation.step(40)
        results.append(simulation.positions[0].tobytes())
    assert len(set(results)) == 1


def test_snapshot_restore_and_reset(falling):
    simulation = palpate.Simulation(falling)
    start = simulation.positions[0].tobytes()
    simulation.step(20)
    snapshot = simulation.snapshot()
    simulation.step(15)
    after = simulation.positions[0].tobytes()
    simulation.restore(snapshot)
    assert simulation.time == snapshot.time
    simulation.step(15)
    assert simulation.positions[0].tobytes() == after
    simulation.reset()
    assert simulation.positions[0].tobytes() == start
    assert simulation.time == 0.0


def test_checkpoints_continue_bit_for_bit(falling, tmp_path):
    path = tmp_path / "run.palpate"
    simulation = palpate.Simulation(falling)
    simulation.step(20)
    simulation.save(path)
    simulation.step(15)
    loaded = palpate.Simulation.load(path, threads=2)
    loaded.step(15)
    assert loaded.positions[0].tobytes() == simulation.positions[0].tobytes()
    assert [body.name for body in loaded.model.bodies] == ["soft", "plate"]
    assert [each.name for each in tmp_path.iterdir()] == ["run.palpate"]


def test_it_goes_on_with_the_same_bits_from_any_step(tmp_path):
    path = tmp_path / "run.palpate"
    simulation = palpate.Simulation("small")  # its bodies turn, fall on each other and come to rest
    for _ in range(16):
        snapshot = simulation.snapshot()
        simulation.save(path)
        simulation.step(9)
        expected = [positions.tobytes() for positions in simulation.positions]
        loaded = palpate.Simulation.load(path)
        loaded.step(9)
        assert [positions.tobytes() for positions in loaded.positions] == expected
        simulation.restore(snapshot)
        simulation.step(9)
        assert [positions.tobytes() for positions in simulation.positions] == expected


def test_damaged_checkpoints_are_refused(falling, tmp_path):
    path = tmp_path / "run.palpate"
    palpate.Simulation(falling).save(path)
    whole = path.read_bytes()
    for broken in (
        b"",
        b"hello",
        whole[:-1],
        whole[:20],
        whole + b"x",
        whole[:100] + bytes([whole[100] ^ 1]) + whole[101:],
    ):
        path.write_bytes(broken)
        with pytest.raises(palpate.CheckpointError, match=r"run\.palpate"):
            palpate.Simulation.load(path)
    with pytest.raises(FileNotFoundError):
        palpate.Simulation.load(tmp_path / "nothing.palpate")


def test_forces_and_velocities_can_be_set(make_box):
    simulation = palpate.Simulation(
        palpate.Model([make_box((2, 2, 2), size=0.1)], gravity=(0, 0, 0)), time_step=0.01
    )
    count = len(simulation.positions[0])
    simulation.set_velocities(0, np.tile([1.0, 0, 0], (count, 1)))
    simulation.step()
    assert np.allclose(simulation.velocities[0], [1, 0, 0])
    simulation.set_forces("body_1", np.tile([0, 0, 1.0 / count], (count, 1)))
    simulation.step()
    momentum = simulation.velocities[0].mean(axis=0)
    assert momentum[2] > 0
    moved = simulation.positions[0] + [0, 1, 0]
    simulation.set_positions(0, moved)
    assert np.array_equal(simulation.positions[0], moved)


@pytest.mark.parametrize(
    ("values", "error"),
    [
        (np.zeros((3, 3)), ValueError),
        (np.full((27, 3), np.nan), ValueError),
        (np.zeros((27, 3), complex), TypeError),
        ("x", (TypeError, ValueError)),
    ],
)
def test_bad_values_change_nothing(make_box, values, error):
    simulation = palpate.Simulation([make_box((2, 2, 2))])
    before = simulation.positions[0]
    for setter in (simulation.set_positions, simulation.set_velocities, simulation.set_forces):
        with pytest.raises(error):
            setter(0, values)
    assert np.array_equal(simulation.positions[0], before)


@pytest.mark.parametrize(
    ("options", "error", "text"),
    [
        ({"time_step": 0.0}, ValueError, "time_step"),
        ({"time_step": float("nan")}, ValueError, "time_step"),
        ({"time_step": "fast"}, TypeError, "time_step"),
        ({"threads": 0}, ValueError, "threads"),
        ({"method": "none"}, ValueError, "method"),
        ({"substeps": 4}, ValueError, "give a smaller time_step"),
        ({"substeps": "many"}, ValueError, "substeps"),
    ],
)
def test_bad_options_are_refused_by_name(cube, options, error, text):
    with pytest.raises(error, match=text):
        palpate.Simulation([cube], **options)


def test_a_membrane_that_is_not_rigid_cannot_be_simulated():
    sheet = palpate.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], triangles=[[0, 1, 2]])
    with pytest.raises(palpate.SimulationError, match="sheet"):
        palpate.Simulation([palpate.Body(sheet, name="sheet")])


def test_steps_are_counted(cube):
    simulation = palpate.Simulation([cube])
    assert simulation.step(3).step == 3
    with pytest.raises(ValueError, match="count"):
        simulation.step(0)


def test_two_soft_boxes_collide_and_keep_their_momentum(make_box):
    left = palpate.Body(make_box((2, 2, 2), size=0.1), initial_velocity=(0.5, 0, 0), name="left")
    right = palpate.Body(
        make_box((2, 2, 2), size=0.1, origin=(0.12, 0.02, 0.01)),
        initial_velocity=(-0.5, 0, 0),
        name="right",
    )
    simulation = palpate.Simulation(palpate.Model([left, right], gravity=(0, 0, 0)))
    touched = sum(simulation.step().contacts > 0 for _ in range(60))
    assert touched > 0
    assert len(simulation.intersections()) == 0
    gap = simulation.positions[1][:, 0].mean() - simulation.positions[0][:, 0].mean()
    assert gap > 0.1


def test_stress_is_that_of_the_load_it_carries(make_box):
    box = make_box((3, 3, 3), size=0.1)
    body = palpate.Body(
        box,
        name="bar",
        material=palpate.Material(law="corotated", young=1e4, poisson=0.0, damping=0.1),
        fixed_nodes=np.flatnonzero(box.nodes[:, 2] == box.nodes[:, 2].min()),
    )
    simulation = palpate.Simulation(palpate.Model([body], gravity=(0, 0, 0)), time_step=10.0)
    top = np.flatnonzero(box.nodes[:, 2] == box.nodes[:, 2].max())
    simulation.drive(0, top, box.nodes[top] + np.array([0, 0, 1e-4]))
    simulation.step(4)
    stress = simulation.stress("bar")
    expected = [0, 0, 1e4 * 1e-4 / 0.1, 0, 0, 0]
    assert np.allclose(stress, np.tile(expected, (len(box.tetrahedra), 1)), atol=2e-2)
    assert np.allclose(von_mises(stress), 10.0, atol=2e-2)
    assert np.allclose(node_means(von_mises(stress), box.tetrahedra, len(box.nodes)), 10, atol=2e-2)


@pytest.mark.parametrize("regions", [{}, {1: palpate.Material(young=3e4, poisson=0.3)}])
def test_linear_bodies_have_hookes_stress_without_the_turn(make_box, regions):
    box = make_box((2, 2, 2), size=0.1)
    half = (np.arange(len(box.tetrahedra)) % 2).astype(np.int32)
    mesh = palpate.Mesh(box.nodes, tetrahedra=box.tetrahedra, regions=half)
    body = palpate.Body(mesh, material=palpate.Material(young=1e4, poisson=0.3), regions=regions)
    simulation = palpate.Simulation(palpate.Model([body], gravity=(0, 0, 0)))
    angle = 0.8
    turn = np.array(
        [[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]]
    )
    stretched = mesh.nodes * (1 + 1e-3 * np.array([1, -0.3, -0.3]))
    simulation.set_positions(0, stretched @ turn.T)
    # Uniaxial stress: Young's modulus times the stretch.
    young = np.where(half == 1, 3e4 if regions else 1e4, 1e4)
    assert np.allclose(VonMises(simulation).of(0), 1e-3 * young, rtol=3e-3)


def test_bodies_without_stress_are_named(falling):
    simulation = palpate.Simulation(falling)
    with pytest.raises(ValueError, match="'plate' is rigid or of law linear"):
        simulation.stress("plate")


def pressed(make_box, **options):
    """A block whose top is moved through nearly all of its height at once."""
    box = make_box((6, 6, 6), size=0.1)
    height = box.nodes[:, 2]
    body = palpate.Body(
        box,
        name="block",
        material=palpate.Material(law="neo-hookean", young=5e3, damping=0.02),
        fixed_nodes=np.flatnonzero(height == height.min()),
    )
    simulation = palpate.Simulation(palpate.Model([body], gravity=(0, 0, 0)), **options)
    top = np.flatnonzero(height == height.max())
    return simulation, simulation.drive(0, top, box.nodes[top] - [0, 0, 0.085])


def test_a_step_that_fails_is_tried_again_in_smaller_ones(make_box, tmp_path):
    simulation, drive = pressed(make_box, substeps="auto")
    simulation.save(tmp_path / "state.palpate")
    report = simulation.step()
    assert report.substeps > 1
    assert (report.step, report.time) == (1, 1 / 60)
    assert np.array_equal(simulation.positions[0][drive.nodes], drive.targets)
    assert simulation.step(20).substeps >= 1
    assert simulation.step().substeps == 1
    loaded = palpate.Simulation.load(tmp_path / "state.palpate", threads=2)
    assert loaded.step().substeps == report.substeps


def test_a_step_that_fails_names_where_and_why_and_changes_nothing(make_box):
    for substeps, tried in ((1, "failed:"), ("auto", "also in 64 smaller ones:")):
        simulation, drive = pressed(make_box, substeps=substeps)
        simulation.step()
        before = [simulation.positions[0].tobytes(), simulation.velocities[0].tobytes()]
        drive.move_to(np.full((len(drive.nodes), 3), 1e300))
        with pytest.raises(palpate.SimulationError, match=r"'block', node .* its drive") as caught:
            simulation.step()
        assert tried in str(caught.value)
        assert "move it step by step" in str(caught.value)
        error = caught.value
        assert error.body == 0
        assert error.node in drive.nodes
        assert error.node in simulation.model.bodies[0].mesh.tetrahedra[error.tetrahedron]
        assert [simulation.positions[0].tobytes(), simulation.velocities[0].tobytes()] == before
        assert simulation.time == 1 / 60


@pytest.mark.parametrize(
    ("name", "friction"),
    [("case1", 0.1), ("case1", 0.3), ("case1", 0.4), ("case2", 0.3), ("case2", 0.5)],
)
def test_organs_in_a_pile_come_to_rest(name, friction):
    # Each setting ends in another pile, with other contacts on the verge of coming and going.
    model = palpate.read_model(name)
    for body in model.bodies:
        assert body.rigid is not None or body.material.law == "neo-hookean"
    bodies = [
        replace(body, contact=replace(body.contact, friction=friction)) for body in model.bodies
    ]
    simulation = palpate.Simulation(palpate.Model(bodies, gravity=model.gravity))
    report = simulation.step(200)
    assert report.contacts > 100
    for _ in range(30):
        simulation.step()
        speeds = [np.linalg.norm(velocities, axis=1).max() for velocities in simulation.velocities]
        # A step solves for positions to 3e-4 of an edge, 9e-5 m/s.
        assert max(speeds) < 1e-5
