"""Changed settings: the model that has them, and a simulation of it in the state of another."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from palpate.model import Body, Model, RigidKey
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
    gravity = model.gravity if command["gravity"] is None else command["gravity"]
    return Model(bodies, gravity=gravity)


def transferred(
    before: Simulation, model: Model, make: Callable[[Model], Simulation]
) -> Simulation:
    """A simulation of ``model``, whose first bodies are those of ``before``, in its state.

    The clock starts at 0 again, so the paths of rigid bodies are moved back in time.
    """
    bodies = [
        replace(body, rigid=_earlier(body.rigid, before.time)) if body.rigid else body
        for body in model.bodies
    ]
    after = make(Model(bodies, gravity=model.gravity))
    states = zip(model.bodies, before.positions, before.velocities, strict=False)
    for index, (body, positions, velocities) in enumerate(states):
        if body.rigid is None:
            after.set_positions(index, positions)
            after.set_velocities(index, velocities)
    return after


def _earlier(keys: Any, seconds: float) -> tuple[RigidKey, ...]:
    return tuple(replace(key, time=key.time - seconds) for key in keys)
