"""Springs and tools from Python."""

import numpy as np
import pytest

import palpate

LIFT = np.array([0, 0, 0.1])


@pytest.fixture
def simulation() -> palpate.Simulation:
    return palpate.Simulation("small")


def soft_and_rigid(simulation: palpate.Simulation) -> tuple[int, int]:
    kinds = [body.rigid is not None for body in simulation.model.bodies]
    return kinds.index(False), kinds.index(True)


def test_a_pull_moves_its_node_and_is_let_go(simulation: palpate.Simulation) -> None:
    soft, _ = soft_and_rigid(simulation)
    start = simulation.positions[soft][3].copy()
    pull = simulation.pull(soft, 3, start + LIFT, stiffness=500.0)
    assert (pull.body, pull.node, pull.stiffness) == (soft, 3, 500.0)
    simulation.step(30)
    stretch = pull.target - simulation.positions[soft][3]
    np.testing.assert_allclose(pull.force, 500.0 * stretch, rtol=1e-2, atol=1e-4)
    assert simulation.positions[soft][3][2] > start[2] + 0.05
    snapshot = simulation.snapshot()
    pull.target = start
    np.testing.assert_array_equal(pull.target, start)
    pull.release()
    assert not pull.is_active
    assert repr(pull) == "Pull(released)"
    with pytest.raises(ValueError, match="released before"):
        _ = pull.force
    with pytest.raises(palpate.SimulationError, match="released before"):
        pull.release()
    simulation.restore(snapshot)
    np.testing.assert_array_equal(pull.target, start + LIFT)
    simulation.reset()
    assert not pull.is_active


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ((0, 10**6, [0, 0, 0], 1.0), palpate.SimulationError, "node 1000000 does not exist"),
        ((0, -1, [0, 0, 0], 1.0), ValueError, "node: expected an integer of at least 0"),
        ((0, 1.5, [0, 0, 0], 1.0), TypeError, "node: expected an integer"),
        ((9, 0, [0, 0, 0], 1.0), IndexError, "index 9 is out of range"),
        (("liver", 0, [0, 0, 0], 1.0), ValueError, "no body is named 'liver'"),
        ((0, 0, [0, 0], 1.0), ValueError, r"target: expected shape \(3,\)"),
        ((0, 0, [0, 0, np.nan], 1.0), ValueError, "target: expected finite numbers"),
        ((0, 0, [0, 0, 0], 0.0), palpate.SimulationError, "the stiffness is 0 N/m"),
        ((0, 0, [0, 0, 0], np.inf), ValueError, "stiffness: expected a finite number"),
    ],
)
def test_bad_pulls(
    simulation: palpate.Simulation, arguments: tuple, error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        simulation.pull(*arguments)


def test_a_tool_goes_where_it_is_put(simulation: palpate.Simulation) -> None:
    soft, rigid = soft_and_rigid(simulation)
    tool = simulation.tool(rigid)
    assert tool.name == simulation.model.bodies[rigid].name
    placed = simulation.positions[rigid].copy()
    origin = tool.translation
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    for rotation in (turn, [np.sqrt(0.5), 0, 0, np.sqrt(0.5)]):
        tool.set_pose(rotation, [0.1, 0.2, -1.0])
        simulation.step()
        expected = (placed - origin) @ turn.T + [0.1, 0.2, -1.0]
        np.testing.assert_allclose(simulation.positions[rigid], expected, atol=1e-15)
        np.testing.assert_allclose(tool.rotation, turn, atol=1e-15)
        np.testing.assert_allclose(tool.translation, [0.1, 0.2, -1.0], atol=1e-15)
    np.testing.assert_array_equal(tool.force, [0, 0, 0])
    np.testing.assert_array_equal(tool.torque, [0, 0, 0])
    with pytest.raises(palpate.SimulationError, match="is not rigid"):
        simulation.tool(soft)


def test_rotations_of_every_kind(simulation: palpate.Simulation) -> None:
    _, rigid = soft_and_rigid(simulation)
    tool = simulation.tool(rigid)
    placed = simulation.positions[rigid].copy()
    origin = tool.translation
    random = np.random.default_rng(4)
    turns = [np.diag(signs) for signs in ([1, -1, -1], [-1, 1, -1], [-1, -1, 1], [1, 1, 1])]
    for _ in range(20):
        q, _ = np.linalg.qr(random.normal(size=(3, 3)))
        turns.append(q * np.sign(np.linalg.det(q)))
    for turn in turns:
        tool.set_pose(turn, [0, 0, -2])
        simulation.step()
        expected = (placed - origin) @ turn.T + [0, 0, -2]
        np.testing.assert_allclose(simulation.positions[rigid], expected, atol=1e-13)


@pytest.mark.parametrize(
    ("rotation", "message"),
    [
        (np.eye(2), r"expected shape \(3, 3\) or \(4,\), got \(2, 2\)"),
        (2 * np.eye(3), "expected a rotation matrix"),
        (np.diag([1, 1, -1]), "expected a rotation matrix"),
        ([0, 0, 0, 0], "expected a quaternion of length 1"),
        (np.full((3, 3), np.nan), "expected finite numbers"),
    ],
)
def test_bad_rotations(simulation: palpate.Simulation, rotation: np.ndarray, message: str) -> None:
    _, rigid = soft_and_rigid(simulation)
    with pytest.raises(ValueError, match=message):
        simulation.tool(rigid).set_pose(rotation, [0, 0, 0])
