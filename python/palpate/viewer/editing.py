"""Changed settings: the model that has them, and a simulation of it in the state of another."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from palpate.model import Attachment, Body, Model, RigidKey
from palpate.scene import Scene
from palpate.simulation import Simulation
from palpate.viewer.protocol import Command


def settings_of(body: Body) -> dict[str, Any]:
    """What the page shows of a body's material and contact."""
    material, contact = body.material, body.contact
    return {
        "rigid": body.rigid is not None,
        "law": material.law,
        "regions": len(body.regions),
        "material": {
            "young": material.young,
            "poisson": material.poisson,
            "density": material.density,
            "damping": material.damping,
        },
        "contact": {
            "friction": contact.friction,
            "distance": contact.distance,
            "stiffness": contact.stiffness,
            "self_contact": contact.self_contact,
        },
    }


def edited(model: Model, command: Command) -> Model:
    """The model with the settings of a ``settings`` command."""
    bodies = list(model.bodies)
    index = command["body"]
    if index is not None:
        if index >= len(bodies):
            raise ValueError(f"there is no body {index}")
        body = bodies[index]
        bodies[index] = replace(
            body,
            material=replace(body.material, **command["material"]),
            contact=replace(body.contact, **command["contact"]),
        )
    return remade(model, bodies, command["gravity"])


def remade(
    model: Model, bodies: Sequence[Body], gravity: tuple[float, float, float] | None = None
) -> Model:
    """The model with other bodies, the first of them in the same places, tied as before."""
    ties = [
        replace(tie, within=_reach(model, tie), nodes=None)
        for tie in model.attachments
        if tie.nodes is not None and len(tie.nodes)
    ]
    gravity = model.gravity if gravity is None else gravity
    return Model(bodies, gravity=gravity, attachments=ties)


def _reach(model: Model, tie: Attachment) -> float:
    """The distance [m] within which exactly the tied nodes lie: that of the farthest."""
    first, second = (model.bodies[model.body_index(each)] for each in (tie.first, tie.second))
    tied = first.mesh.nodes[np.asarray(tie.nodes)]
    distances = Scene([second.mesh]).closest(tied).distances
    return float(distances.max()) * (1 + 1e-9) + 1e-12


def transferred(
    before: Simulation, model: Model, make: Callable[[Model], Simulation]
) -> Simulation:
    """A simulation of ``model`` in the state of ``before``, body by body of the same name.

    The clock starts at 0 again, so the paths of rigid bodies are moved back in time.
    """
    bodies = [
        replace(body, rigid=_earlier(body.rigid, before.time)) if body.rigid else body
        for body in model.bodies
    ]
    after = make(remade(model, bodies))
    names = [body.name for body in before.model.bodies]
    states = dict(zip(names, zip(before.positions, before.velocities, strict=True), strict=True))
    for body in model.bodies:
        if body.rigid is None:
            positions, velocities = states[body.name]
            after.set_positions(body.name, positions)
            after.set_velocities(body.name, velocities)
    return after


def _earlier(keys: Any, seconds: float) -> tuple[RigidKey, ...]:
    return tuple(replace(key, time=key.time - seconds) for key in keys)
