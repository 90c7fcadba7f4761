"""Springs and tools from Python."""

import threading

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


def test_driven_nodes_follow_their_path(simulation: palpate.Simulation) -> None:
    soft, _ = soft_and_rigid(simulation)
    nodes = [7, 3, 5]
    start = simulation.positions[soft][nodes].copy()
    asked = []

    def path(time: float) -> np.ndarray:
        asked.append(time)
        return start + np.array([0.02 * time, 0, 0.01])

    drive = simulation.drive(soft, nodes, path)
    report = simulation.step(4)
    assert report.step == 4
    assert sum(report.stages.values()) > 0
    assert asked[-4:] == pytest.approx([1 / 60, 2 / 60, 3 / 60, 4 / 60])
    np.testing.assert_array_equal(simulation.positions[soft][nodes], path(simulation.time))
    np.testing.assert_array_equal(drive.nodes, [3, 5, 7])
    assert drive.body == soft
    assert drive.force.shape == (3, 3)
    assert np.abs(drive.force).max() > 0
    np.testing.assert_array_equal(simulation.model.bodies[soft].fixed_nodes, [3, 5, 7])
    snapshot = simulation.snapshot()
    drive.release()
    assert repr(drive) == "Drive(released)"
    assert len(simulation.model.bodies[soft].fixed_nodes) == 0
    simulation.step(2)
    simulation.restore(snapshot)
    simulation.step()
    np.testing.assert_array_equal(simulation.positions[soft][nodes], path(simulation.time))


def test_nodes_are_driven_step_by_step(simulation: palpate.Simulation) -> None:
    soft, _ = soft_and_rigid(simulation)
    goal = simulation.positions[soft][[4]] + np.array([0, 0, 0.002])
    drive = simulation.drive(soft, [4], goal)
    simulation.step()
    np.testing.assert_array_equal(simulation.positions[soft][[4]], goal)
    drive.move_to(goal[0] + np.array([0, 0, 0.002]))
    simulation.step(2)
    np.testing.assert_array_equal(simulation.positions[soft][4], goal[0] + [0, 0, 0.002])


@pytest.mark.parametrize(
    ("nodes", "path", "error", "message"),
    [
        ([10**6], [[0, 0, 0]], palpate.SimulationError, "node 1000000 does not exist"),
        ([-1], [[0, 0, 0]], ValueError, "nodes: row 0 holds -1"),
        ([], np.zeros((0, 3)), palpate.SimulationError, "expected at least one node"),
        ([1, 1], np.zeros((2, 3)), ValueError, "each node may be named once"),
        ([1, 2], np.zeros((3, 3)), ValueError, r"path: expected shape \(2, 3\), got \(3, 3\)"),
        ([1], [[0, np.nan, 0]], palpate.SimulationError, "the target of node 1 of body 0"),
        ([1.5], [[0, 0, 0]], TypeError, "nodes: expected integers"),
        ([1], lambda _: "up", (TypeError, ValueError), "path"),
    ],
)
def test_bad_drives(
    simulation: palpate.Simulation,
    nodes: list,
    path: object,
    error: type[Exception],
    message: str,
) -> None:
    with pytest.raises(error, match=message):
        simulation.drive(0, nodes, path)
    assert len(simulation.model.bodies[0].fixed_nodes) == 0
    simulation.step()


def press(make_box) -> palpate.Simulation:
    """A block that stands on its fixed lower side, and a smaller one above it for a tool."""
    block = make_box((6, 6, 4), size=0.1)
    height = block.nodes[:, 2]
    tool = make_box((1, 1, 1), size=0.04, origin=(0.03, 0.03, 0.12))
    tool = palpate.Mesh(tool.nodes, triangles=tool.triangles)
    bodies = [
        palpate.Body(
            block,
            name="block",
            material=palpate.Material(young=5e3, damping=0.05),
            fixed_nodes=np.flatnonzero(height == height.min()),
            contact=palpate.Contact(friction=0.3),
        ),
        palpate.Body(tool, name="tool", rigid=(), contact=palpate.Contact(friction=0.3)),
    ]
    return palpate.Simulation(palpate.Model(bodies, gravity=(0, 0, 0)))


def test_a_loop_gives_the_force_of_the_steps_at_rest(make_box):
    simulation = press(make_box)
    tool = simulation.tool("tool")
    loop = tool.loop()
    assert repr(loop) == "ToolLoop('tool')"
    force, torque = loop.tick(np.eye(3), [0, 0, 0])
    np.testing.assert_array_equal([force, torque], np.zeros((2, 3)))
    assert (loop.contacts, loop.step) == (0, 0)
    turn = np.deg2rad(3.0)
    for step in range(150):
        depth = min(step * 1e-3, 0.024)
        quaternion = [np.cos(turn / 2), 0, 0, np.sin(turn / 2)]
        force, torque = loop.tick(quaternion, [0, 0, -depth])
        simulation.step()
        np.testing.assert_allclose(tool.translation, [0, 0, -depth], atol=1e-15)
    matrix = [[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]]
    force, torque = loop.tick(matrix, [0, 0, -depth])
    assert loop.step == 150
    assert loop.contacts > 0
    assert force[2] > 0.1
    np.testing.assert_allclose(force, tool.force, atol=0.01 * tool.force[2])
    np.testing.assert_allclose(torque, tool.torque, atol=0.01 * tool.force[2] * 0.1)


def test_a_loop_ticks_while_another_thread_steps(make_box):
    simulation = press(make_box)
    loop = simulation.tool("tool").loop(margin=0.02)
    forces = []
    done = threading.Event()

    def ticks():
        while not done.is_set():
            forces.append(loop.tick(np.eye(3), [0, 0, -0.024])[0][2])

    thread = threading.Thread(target=ticks)
    thread.start()
    try:
        for _ in range(5000):  # a loaded machine may give the other thread little time
            simulation.step()
            if len(forces) > 60:
                break
    finally:
        done.set()
        thread.join()
    assert len(forces) > 60
    assert np.isfinite(forces).all()
    assert forces[-1] > 0.1
    assert loop.step > 0


@pytest.mark.parametrize(
    ("rotation", "translation", "message"),
    [
        (2 * np.eye(3), [0, 0, 0], "expected a rotation matrix"),
        (np.eye(2), [0, 0, 0], "expected shape"),
        (np.eye(3), [0, 0, np.inf], "translation: expected finite numbers"),
        (np.eye(3), [0, 0], "translation: expected shape"),
    ],
)
def test_bad_ticks(make_box, rotation, translation, message):
    loop = press(make_box).tool("tool").loop()
    with pytest.raises(ValueError, match=message):
        loop.tick(rotation, translation)


def test_what_has_no_loop(make_box):
    simulation = press(make_box)
    with pytest.raises(palpate.SimulationError, match="the margin is -1 m"):
        simulation.tool("tool").loop(margin=-1)
    with pytest.raises(TypeError, match="margin"):
        simulation.tool("tool").loop(margin="far")


@pytest.mark.parametrize("young", [1.9e4, 2e4, 2.001e4, 2.1e4])
@pytest.mark.parametrize(
    ("speed", "last", "fastest"),
    [
        # To a tenth of its height in one step: nothing has a reason to be faster than the tool.
        (3.0, 0.004, 3.0),
        (3.0, 0.0041, 3.0),
        # Where no body can be it is pressed out: what it falls in the time left may be added.
        (0.3, -0.02, 0.3 + 9.81 * 2.5),
    ],
)
def test_a_tool_that_crushes_a_body_against_the_ground_does_not_throw_it(
    make_box, young, speed, last, fastest
):
    """The lower side of the tool ends at ``last`` above the ground."""
    tissue = palpate.Material(law="neo-hookean", young=young, poisson=0.45, damping=0.02)
    bodies = [
        palpate.Body(make_box((6, 6, 3), (0.08, 0.08, 0.04)), name="soft", material=tissue),
        palpate.Body(make_box((1, 1, 1), (0.3, 0.3, 0.05), (-0.1, -0.1, -0.0505)), rigid=()),
        palpate.Body(make_box((2, 2, 2), 0.03, (0.025, 0.025, 0.0445)), name="tool", rigid=()),
    ]
    simulation = palpate.Simulation(palpate.Model(bodies))
    tool = simulation.tool("tool")
    for step in range(150):
        tool.set_pose(np.eye(3), [0, 0, -min(speed * step / 60, 0.0445 - last)])
        simulation.step()
        assert np.linalg.norm(simulation.velocities[0], axis=1).max() < fastest
