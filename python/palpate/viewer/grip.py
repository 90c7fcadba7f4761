"""A hand that holds tissue: a spring to a point, shared by the nodes of a patch of the surface."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from palpate._arrays import Float64Array
from palpate.model import Body
from palpate.simulation import Simulation

#: Nodes that a hand holds at most, the nearest first: each is a row of the contact problem.
_MOST = 24


def patch(
    body: Body, positions: Float64Array, node: int, radius: float
) -> tuple[npt.NDArray[np.int64], Float64Array]:
    """The nodes that a hand on ``node`` holds, ``node`` first, and the share of the pull of each.

    Those of the surface within ``radius`` [m] that a way over the surface leads to, so that a fold
    beside it stays free; less the farther they are. Shares (k,) sum to 1.
    """
    distances = np.linalg.norm(positions - positions[node], axis=1)
    near = distances < radius
    edges = body.mesh.surface_edges[near[body.mesh.surface_edges].all(axis=1)]
    held = np.zeros(len(near), dtype=bool)
    held[node] = True
    count = 0
    while count < (count := int(held.sum())):
        held[edges[held[edges].any(axis=1)]] = True
    held[np.asarray(body.fixed_nodes, dtype=np.int64)] = False
    held[node] = True
    nodes = np.flatnonzero(held)
    nodes = nodes[np.argsort(distances[nodes], kind="stable")][:_MOST]
    shares = 1 - (distances[nodes] / max(radius, 1e-300)) ** 2 if len(nodes) > 1 else np.ones(1)
    return nodes, shares / shares.sum()


class Grip:
    """Pulls a patch towards a target; its nodes keep their places beside each other.

    Parameters
    ----------
    nodes, shares : (k,)
        See `patch`.
    stiffness : float
        Of all its springs together [N/m].
    reach : float
        Length of the spring at its full force [m]: it is a hand, not a crane.
    """

    def __init__(
        self,
        simulation: Simulation,
        body: int,
        nodes: npt.NDArray[np.int64],
        shares: Float64Array,
        target: Float64Array,
        stiffness: float,
        reach: float,
    ) -> None:
        self._body, self._nodes, self._shares = body, nodes, shares
        self._target = target
        self._reach = reach
        at = simulation.positions[body][nodes]
        self._offsets = at - at[0]
        self._pulls = [
            simulation.pull(body, int(node), place, stiffness * float(share))
            for node, place, share in zip(nodes, at, shares, strict=True)
        ]

    def drag(self, target: Float64Array) -> None:
        """Lead the hand to a point [m]."""
        self._target = target

    def move(self, positions: Sequence[Float64Array]) -> None:
        """Put the springs' ends where the hand is, no farther from the tissue than its reach."""
        self._drop_lost()
        if not self._pulls:
            return
        place = self._place(positions)
        along = self._target - place
        length = float(np.linalg.norm(along))
        hand = place + along * min(1.0, self._reach / max(length, 1e-12))
        for pull, offset in zip(self._pulls, self._offsets, strict=True):
            pull.target = hand + offset

    @property
    def holds(self) -> bool:
        """Whether a cut has left it anything."""
        self._drop_lost()
        return bool(self._pulls)

    def release(self) -> None:
        """Let go."""
        self._drop_lost()
        for pull in self._pulls:
            pull.release()
        self._pulls = []

    def shown(self, simulation: Simulation) -> dict[str, Any]:
        """From where to where it pulls, what it holds, and how strongly."""
        positions = simulation.positions
        return {
            "from": self._place(positions).tolist(),
            "to": self._target.tolist(),
            "held": positions[self._body][self._nodes].tolist(),
            "force": np.sum([pull.force for pull in self._pulls], axis=0).tolist(),
        }

    def _place(self, positions: Sequence[Float64Array]) -> Float64Array:
        """Where the tissue under the hand is: its first node, if the patch only moved."""
        place: Float64Array = self._shares @ (positions[self._body][self._nodes] - self._offsets)
        return place

    def _drop_lost(self) -> None:
        """Nodes that a cut has taken away are held no more."""
        held = np.array([pull.is_active for pull in self._pulls], dtype=bool)
        if held.all():
            return
        self._pulls = [pull for pull, kept in zip(self._pulls, held, strict=True) if kept]
        self._nodes, self._offsets = self._nodes[held], self._offsets[held]
        if self._pulls:
            self._shares = self._shares[held] / self._shares[held].sum()
