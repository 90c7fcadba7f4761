"""References, memory, the interpreter's lock, arrays that change, forks, threads."""

import gc
import os
import subprocess
import sys
import threading
import time
import tracemalloc
import weakref
from collections.abc import Callable

import numpy as np
import pytest
from conftest import CUBE_NODES, CUBE_TETRAHEDRA, box

import palpate


def resident() -> int:
    """Bytes of memory in use."""
    with open("/proc/self/statm", encoding="ascii") as table:  # noqa: PTH123
        return int(table.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def one_cycle() -> None:
    """Makes and uses one of everything."""
    mesh = palpate.Mesh(CUBE_NODES, CUBE_TETRAHEDRA, node_sets={"low": [0, 2]})
    scene = palpate.Scene([mesh, mesh.with_nodes(mesh.nodes + 0.5)])
    scene.update([mesh.nodes, mesh.nodes + 0.4])
    found = [scene.intersections(), scene.proximity(0.1), scene.penetration()]
    found.append(scene.closest(mesh.nodes))
    soft = palpate.Body(mesh, name="soft", fixed_nodes=[0])
    simulation = palpate.Simulation([soft, palpate.Body(mesh, name="tool", rigid=())])
    pull = simulation.pull("soft", 7, [0, 0, 2], 1.0)
    drive = simulation.drive("soft", [5], lambda _: simulation.positions[0][5])
    simulation.step(2)
    snapshot = simulation.snapshot()
    drive.release()
    simulation.cut(palpate.Blade.plane([0.5, 0, 0], [1, 0.1, 0]))
    simulation.tool("tool").set_pose([1, 0, 0, 0], [0, 0, 3])
    simulation.restore(snapshot)
    pull.release()
    for wrong in (lambda: scene.update([mesh.nodes]), lambda: simulation.step(0)):
        with pytest.raises(ValueError, match="expected"):
            wrong()


def test_a_thousand_cycles_leave_nothing_behind() -> None:
    for _ in range(100):
        one_cycle()
    gc.collect()
    objects, memory = len(gc.get_objects()), resident()
    tracemalloc.start()
    before = tracemalloc.take_snapshot()
    for _ in range(50):
        one_cycle()
    gc.collect()
    after = tracemalloc.take_snapshot()
    tracemalloc.stop()
    kept = [
        entry
        for entry in after.compare_to(before, "lineno")
        if entry.count_diff >= 25 and "tracemalloc" not in str(entry.traceback)
    ]
    assert kept == []
    for _ in range(850):
        one_cycle()
    gc.collect()
    assert len(gc.get_objects()) < objects + 200
    assert resident() < 1.05 * memory + 5e6


@pytest.mark.parametrize("dtype", [np.float64, np.int64, np.int32])
def test_references_to_arrays_are_given_back(dtype: type) -> None:
    nodes = CUBE_NODES.astype(dtype)
    tetrahedra = CUBE_TETRAHEDRA.astype(dtype if dtype != np.float64 else np.int64)
    counts = [sys.getrefcount(each) for each in (nodes, tetrahedra)]
    mesh = palpate.Mesh(nodes, tetrahedra)
    scene = palpate.Scene([mesh])
    scene.update([nodes])
    scene.closest(nodes)
    simulation = palpate.Simulation([mesh])
    simulation.set_velocities(0, nodes)
    assert [sys.getrefcount(each) for each in (nodes, tetrahedra)] == counts


def test_objects_go_when_their_last_name_goes() -> None:
    simulation = palpate.Simulation("small")
    drive = simulation.drive(0, [1], simulation.positions[0][[1]])
    gone = weakref.ref(simulation)
    del simulation, drive
    gc.collect()
    assert gone() is None


def test_arrays_may_change_and_go_after_they_were_given() -> None:
    nodes, tetrahedra = CUBE_NODES.copy(), CUBE_TETRAHEDRA.copy()
    fixed = np.array([0, 1])
    mesh = palpate.Mesh(nodes, tetrahedra)
    body = palpate.Body(mesh, fixed_nodes=fixed)
    scene, simulation = palpate.Scene([mesh]), palpate.Simulation([body])
    places, velocities, target = mesh.nodes + 1.0, np.zeros((8, 3)), np.array([0.0, 0, 5])
    scene.update([places])
    simulation.set_velocities(0, velocities)
    pull = simulation.pull(0, 7, target, 1.0)
    for array in (nodes, places, velocities, target):
        array[:] = np.nan
    for array in (tetrahedra, fixed):
        array[:] = 10**9
    del nodes, tetrahedra, places, velocities, fixed
    gc.collect()
    assert np.array_equal(mesh.nodes, CUBE_NODES)
    assert np.array_equal(scene.positions(0), CUBE_NODES + 1.0)
    assert np.array_equal(simulation.velocities[0], np.zeros((8, 3)))
    assert np.array_equal(pull.target, [0, 0, 5])
    simulation.step(5)
    assert np.isfinite(simulation.positions[0]).all()
    assert np.array_equal(simulation.positions[0][:2], CUBE_NODES[:2])


def test_arrays_that_were_given_out_stay_when_their_owner_goes() -> None:
    scene = palpate.Scene([box((3, 3, 3)), box((3, 3, 3), origin=(0.5, 0.4, 0.3))])
    simulation = palpate.Simulation("small")
    simulation.step(30)
    found, near = scene.intersections(), scene.proximity(0.05)
    arrays = [
        found.pairs, near.weights, near.normals, scene.positions(0), scene.meshes[0].surface_edges,
        *simulation.positions, *simulation.contact_forces, simulation.contacts.forces,
    ]  # fmt: skip
    copies = [array.copy() for array in arrays]
    scene.update([mesh.nodes * 2 for mesh in scene.meshes])
    scene.intersections()
    simulation.step(5)
    del scene, simulation, found, near
    gc.collect()
    palpate.Simulation("small").step(5)  # something else where they were
    for array, copy in zip(arrays, copies, strict=True):
        assert np.array_equal(array, copy)
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0


LONG_CALLS = {
    "step": lambda _, simulation, __: simulation.step(80),
    "intersections": lambda scene, *_: scene.intersections(),
    "proximity": lambda scene, *_: scene.proximity(0.2),
    "penetration": lambda scene, *_: scene.penetration(),
    "contains": lambda scene, _, points: scene.contains(points),
    "closest": lambda scene, _, points: scene.closest(points),
    "cast": lambda scene, _, points: scene.cast(points, points + 0.1),
    "start": lambda _, simulation, __: palpate.Simulation([simulation.model.bodies[0]]),
}


@pytest.mark.parametrize("name", LONG_CALLS)
def test_other_threads_run_on_while_the_core_works(name: str) -> None:
    """A thread that asks for the lock again and again never waits for the whole call."""
    cells = (9, 9, 9)
    points = np.random.default_rng(0).random((80_000, 3))
    scene = palpate.Scene([box(cells), box(cells, origin=(0.31, 0.27, 0.23))], method="all-pairs")
    simulation = palpate.Simulation([box((12, 12, 12), size=0.1)])
    # On a loaded machine a thread may wait for other reasons; kept out, it waits every time.
    for _ in range(5):
        longest, spent, ticks = waits(lambda: LONG_CALLS[name](scene, simulation, points))
        if ticks >= 5 and longest < 0.6 * spent:
            return
    pytest.fail(f"{name}: of {spent:.3f} s another thread waited {longest:.3f} s, {ticks} ticks")


def waits(call: Callable[[], object]) -> tuple[float, float, int]:
    """The longest time between two ticks of this thread while another one calls.

    Also the time that the call takes, and the ticks in it.
    """
    done = threading.Event()
    spent: list[float] = []
    ticks = 0

    def work() -> None:
        start = time.perf_counter()
        call()
        spent.append(time.perf_counter() - start)
        done.set()

    worker = threading.Thread(target=work)
    last = time.perf_counter()
    worker.start()
    longest = 0.0
    while not done.is_set():
        time.sleep(0.0005)
        now = time.perf_counter()
        longest, last = max(longest, now - last), now
        ticks += 1
    worker.join()
    return longest, spent[0], ticks


def test_two_scenes_in_two_threads() -> None:
    meshes = [box((4, 4, 4)), box((4, 4, 4), origin=(0.5, 0.4, 0.3))]
    wrong: list[str] = []

    def work(shift: float) -> None:
        own = palpate.Scene(meshes, threads=2)
        simulation = palpate.Simulation("small", threads=2)
        moved = [mesh.nodes + shift * index for index, mesh in enumerate(meshes)]
        own.update(moved)
        expected = own.intersections().pairs
        simulation.step(10)
        state = simulation.positions[0].tobytes()
        for _ in range(10):
            own.update(moved)
            simulation.reset()
            simulation.step(10)
            if not np.array_equal(own.intersections().pairs, expected):
                wrong.append("pairs")
            if simulation.positions[0].tobytes() != state:
                wrong.append("positions")

    workers = [threading.Thread(target=work, args=(0.01 * index,)) for index in range(3)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    assert wrong == []


def test_one_simulation_in_two_threads() -> None:
    simulation = palpate.Simulation("small", threads=2)
    failures: list[BaseException] = []

    def work(step: bool) -> None:
        try:
            for _ in range(30):
                if step:
                    simulation.step(2)
                else:
                    assert np.isfinite(np.concatenate(simulation.positions)).all()
                    simulation.intersections()
                    simulation.snapshot()
        except BaseException as error:
            failures.append(error)

    workers = [threading.Thread(target=work, args=(step,)) for step in (True, False, False)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    assert failures == []
    assert simulation.time == pytest.approx(1.0)


#: A process that has worked with threads forks; the child goes on with what it has and makes new.
FORKING = """
import os, sys, palpate
threads = int(sys.argv[1])
scene = palpate.Scene("small", threads=threads)
simulation = palpate.Simulation("small", threads=threads)
simulation.step(3)
scene.intersections()
edges = [[[0.001, y, -0.1], [0.003, y, 0.3]] for y in (-0.1, 0.005)]
blade = palpate.Blade.stroke(edges)
if sys.argv[2] == "old":
    simulation.cut_live(blade, delay=2)
    simulation.step()
else:
    simulation.step()
child = os.fork()
if child == 0:
    if sys.argv[2] == "old":
        simulation.step(3)
        scene.intersections()
    else:
        other = palpate.Simulation("small", threads=threads)
        other.step(7)
        simulation = other
    sys.stdout.write(simulation.positions[0].tobytes().hex() + "\\n")
    sys.stdout.flush()
    os._exit(0)
os.waitpid(child, 0)
simulation.step(3)
print(simulation.positions[0].tobytes().hex())
"""


@pytest.mark.parametrize("what", ["old", "new"])
@pytest.mark.parametrize("threads", [1, 2])
def test_a_forked_process_works(threads: int, what: str) -> None:
    script = [sys.executable, "-W", "ignore", "-c", FORKING]
    done = subprocess.run(
        [*script, str(threads), what], capture_output=True, text=True, timeout=60, check=True
    )
    child, parent = done.stdout.split()
    assert child == parent
