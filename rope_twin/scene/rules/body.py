"""Rules for scenes with a rigid-body payload, and their rejection where unsupported."""

from __future__ import annotations

from collections.abc import Iterator

from rope_twin.effects.fairing import FairingParams
from rope_twin.effects.net import NetParams
from rope_twin.effects.payload import PayloadParams
from rope_twin.effects.rigid_body import RigidBodyParams
from rope_twin.effects.splash_zone import SplashZoneParams
from rope_twin.errors import SceneError, phrase
from rope_twin.scene.rules.fault import Fault
from rope_twin.scene.schema import Scene

# Effects that treat a payload as a point at the rope's end.
OF_A_POINT = {
    PayloadParams: "payload", NetParams: "net", FairingParams: "fairing",
}  # fmt: skip


def body_of(scene: Scene) -> RigidBodyParams | None:
    """Return the rigid-body parameters of a scene's payload; None if it is a point."""
    return scene.listed(RigidBodyParams)


def refuse_body(scene: Scene, what: str) -> None:
    """Reject scenes with a rigid body where unsupported; what: the reason.

    Raises:
        SceneError: the scene's payload is a rigid body.
    """
    if body_of(scene) is not None:
        right = "use `payload`, a point, instead"
        raise SceneError(phrase(f"{scene.path}: effects.rigid_body", what, right))


def body_holds(scene: Scene) -> Iterator[Fault]:
    """Check that it has a payload, and that no effect treats it as a point."""
    own = body_of(scene)
    if own is None:
        return
    for params in scene.effects:
        if name := OF_A_POINT.get(type(params), ""):
            what = f"`rigid_body` and `{name}`, which treats the payload as a point"
            yield "effects", what, f"remove `{name}`, or use `payload` for the body"
        if isinstance(params, SplashZoneParams) and params.height_m != own.size_m[2]:
            what = f"{params.height_m:g} m is not the height of the body, {own.size_m[2]:g} m"
            yield "effects.splash_zone.height_m", what, "give the third value of size_m"
    if not scene.payloads or not any(line.to for line in scene.ropes):
        what = "`rigid_body` is listed but no payload is"
        yield "effects", what, "add it under `payloads` and to the rope's `to`, or remove it"
        return
    if scene.payloads[0].mass_kg == 0.0:
        right = "give the body a mass"
        yield "payloads[0].mass_kg", "a rigid body without mass cannot move", right
