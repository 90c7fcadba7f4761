"""What the pages do to the tissue: grips that pull at it, and a probe that pushes."""

from __future__ import annotations

from typing import Any

import numpy as np

from palpate._arrays import Float64Array
from palpate.hands import Pull
from palpate.mesh import Mesh
from palpate.model import Body, Contact, Model
from palpate.simulation import Simulation
from palpate.viewer.editing import remade
from palpate.viewer.probe import NAME, aim, probe_mesh
from palpate.viewer.protocol import Command
from palpate.viewer.surface import Surfaces

#: Fastest motion of the probe, in lengths of the scene per second.
_PROBE_SPEED = 0.8
#: Length of a spring at its full force, in lengths of the scene.
_REACH = 0.1
#: Where the probe waits, in lengths of the scene above it.
_AWAY = 1.5


class Hands:
    """Grips by page and number, and at most one probe, which all pages share."""

    def __init__(self, simulation: Simulation) -> None:
        self._grips: dict[tuple[int, int], _Grip] = {}
        self._tip = self._target = np.zeros(3)
        self._direction = np.array([0.0, 0.0, -1.0])
        #: How the probe's mesh stands in the model: rotation and tip.
        self._placed = (np.eye(3), np.zeros(3))
        self._radius = 0.0
        self._owner: int | None = None
        soft = [
            points
            for body, points in zip(simulation.model.bodies, simulation.positions, strict=True)
            if body.rigid is None
        ]
        cloud = np.concatenate(soft or list(simulation.positions))
        self._scale = float(np.linalg.norm(np.ptp(cloud, axis=0))) or 1.0
        self.attach(simulation)

    def attach(self, simulation: Simulation) -> None:
        """Work on another simulation; grips of the last one must have been let go."""
        self._simulation = simulation
        self._tool: Any = None
        if self.has_tool:
            self._tool = simulation.tool(NAME)

    @property
    def has_tool(self) -> bool:
        """Whether the model has the probe already."""
        return any(body.name == NAME for body in self._simulation.model.bodies)

    def take_probe(self, command: Command) -> None:
        """Hold the probe where the command puts it; `with_probe` makes it a body."""
        self._tip = self._target = np.array(command["tip"])
        self._direction = np.array(command["direction"])
        self._radius = command["radius"]

    def with_probe(self, model: Model) -> Model:
        """The model with the probe, if it is held, as its last body and where it is now."""
        bodies = [body for body in model.bodies if body.name != NAME]
        if self._radius == 0:
            return model
        rotation = aim(self._direction)
        self._placed = (rotation, self._tip)
        probe = probe_mesh(self._radius, length=0.6 * self._scale)
        body = Body(
            Mesh(probe.nodes @ rotation.T + self._tip, triangles=probe.triangles),
            name=NAME,
            rigid=(),
            contact=Contact(self_contact=False),
            color=(0.62, 0.66, 0.72),
        )
        return remade(model, [*bodies, body])

    def obey(self, command: Command, client: int, surfaces: Surfaces) -> None:
        """Carry out grab, drag, release, tool or tool_away."""
        kind = command["type"]
        if kind == "grab":
            self._grab(command, client, surfaces)
        elif kind == "tool":
            self._owner = client
            self._target = np.array(command["tip"])
            self._direction = np.array(command["direction"])
        elif kind == "tool_away":
            self._put_away()
        else:
            grip = self._grips.get((client, command["grip"]))
            if grip is None:
                return
            if kind == "drag":
                grip.drag(np.array(command["target"]))
            else:
                self._grips.pop((client, command["grip"])).release()

    def move(self, seconds: float) -> None:
        """Move grips and probe towards where they are wanted, no faster than contact can follow."""
        positions = self._simulation.positions if self._grips else ()
        for grip in self._grips.values():
            grip.move(positions)
        if self._tool is None:
            return
        way = self._target - self._tip
        length = float(np.linalg.norm(way))
        most = _PROBE_SPEED * self._scale * seconds
        self._tip = self._target if length <= most else self._tip + way * (most / length)
        rotation, tip = self._placed
        turn = aim(self._direction) @ rotation.T
        self._tool.set_pose(turn, self._tip - turn @ tip)

    def leave(self, client: int) -> None:
        """Release what a page held."""
        for key in [key for key in self._grips if key[0] == client]:
            self._grips.pop(key).release()
        if self._owner == client:
            self._put_away()

    def let_go(self) -> None:
        """Release everything."""
        for grip in self._grips.values():
            grip.release()
        self._grips.clear()

    def forget_released(self) -> None:
        """Drop grips whose node a cut has taken away."""
        self._grips = {key: grip for key, grip in self._grips.items() if grip.holds}

    def shown(self) -> dict[str, Any]:
        """Pulls and probe for the header of a frame."""
        tool = None
        if self._tool is not None and self._owner is not None:
            tool = {"tip": self._tip.tolist(), "force": np.asarray(self._tool.force).tolist()}
        return {
            "pulls": [grip.shown(self._simulation) for grip in self._grips.values()],
            "tool": tool,
        }

    def _grab(self, command: Command, client: int, surfaces: Surfaces) -> None:
        self.obey({"type": "release", "grip": command["grip"]}, client, surfaces)
        index = command["body"]
        if index >= len(surfaces.nodes) or command["node"] >= len(surfaces.nodes[index]):
            raise ValueError(f"there is no node {command['node']} on body {index}")
        body = self._simulation.model.bodies[index]
        if body.rigid is not None:
            raise ValueError(f"{body.name} is rigid and cannot be pulled")
        node = int(surfaces.nodes[index][command["node"]])
        reach = _REACH * self._scale
        stiffness = command["strength"] * _natural_force(body) / reach
        target = np.array(command["target"])
        pull = self._simulation.pull(index, node, target, stiffness)
        self._grips[client, command["grip"]] = _Grip(pull, index, node, target, reach)

    def _put_away(self) -> None:
        self._owner = None
        up = -self._direction / (np.linalg.norm(self._direction) or 1.0)
        self._target = self._target + _AWAY * self._scale * up


class _Grip:
    """A spring from a node to a point, that grows no longer than its reach: a hand, not a crane."""

    def __init__(
        self, pull: Pull, body: int, node: int, target: Float64Array, reach: float
    ) -> None:
        self._pull = pull
        self._body, self._node = body, node
        self._target = target
        self._reach = reach

    def drag(self, target: Float64Array) -> None:
        self._target = target

    def move(self, positions: tuple[Float64Array, ...]) -> None:
        at = positions[self._body][self._node]
        along = self._target - at
        length = float(np.linalg.norm(along))
        self._pull.target = at + along * min(1.0, self._reach / max(length, 1e-12))

    @property
    def holds(self) -> bool:
        return self._pull.is_active

    def release(self) -> None:
        self._pull.release()

    def shown(self, simulation: Simulation) -> dict[str, Any]:
        """From where to where it pulls, and how strongly."""
        return {
            "from": simulation.positions[self._body][self._node].tolist(),
            "to": self._target.tolist(),
            "force": np.asarray(self._pull.force).tolist(),
        }


def _natural_force(body: Body) -> float:
    """A force [N] that lifts the body, and strains its stuff around one node by about one."""
    mesh = body.mesh
    ends = mesh.nodes[mesh.surface_edges]
    edge = float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).mean())
    weight = 9.81 * body.material.density * mesh.volume
    return 4 * weight + 2 * body.material.young * edge**2
