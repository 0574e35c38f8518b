"""Current profiles received during a run: validated, then applied at a step boundary."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rope_twin.effects.current import (
    Current,
    RisingCurrent,
    from_rows,
    profile_of,
    with_profile,
)
from rope_twin.errors import phrase
from rope_twin.scene.validation.environment import (
    DEEPEST_ROW_M,
    MIN_ROW_SPACING_M,
    SHEAR_LIMIT_PER_S,
    steepest_shear,
)
from rope_twin.scene.warnings.water import strong_current
from rope_twin.twin.health import InputCounter

MAX_CURRENT_M_PER_S = 10.0
MAX_ROWS = 1000  # more would slow every step, and no current meter has them
CURRENT_JUMP_M_PER_S = 0.5  # a larger change of the profile anywhere is accepted with a warning


class CurrentInput:
    """Input of profiles: rows of z [m], east, north [m/s] from the surface down, (rows, 3), or with
    a vertical component too, (rows, 4).
    """

    def __init__(self, effects: tuple[Any, ...]) -> None:
        self.counter = InputCounter("current")
        self.effects = effects
        self.changes = 0  # number of changes of the profile since the start

    def offer(self, profile: NDArray[np.float64], now_ns: int) -> str:
        """Submit a profile; return "" or the reason for its rejection."""
        fault = self._fault(profile)
        if fault:
            return fault
        before = profile_of(self.effects)
        assert before is not None, "checked above"
        new = from_rows(_like(profile, len(before.U)))
        jump, z = _largest_change(before, new)
        self.effects = tuple(with_profile(effect, new) for effect in self.effects)
        self.changes += 1
        self.counter.accept(now_ns)
        if jump > CURRENT_JUMP_M_PER_S:
            what = f"at {now_ns * 1e-9:.1f} s the profile changed by {jump:.2f} m/s at z = {z:g} m"
            right = (
                f"more than {CURRENT_JUMP_M_PER_S:g} m/s at once is accepted, but check the sensor"
            )
            self.counter.warn(phrase("current", what, right), now_ns)
        points = [(float(z), tuple(velocity)) for z, *velocity in profile.tolist()]
        self.counter.say(strong_current("current", points))
        return ""

    def revert(self, effects: tuple[Any, ...], now_ns: int) -> bool:
        """Restore the effects of an earlier time; return whether the profile differs.

        For a return to an earlier state of the ropes: the profile may have caused the failed step.
        """
        now, before = profile_of(self.effects), profile_of(effects)
        if now is before:
            return False
        self.effects, self.changes = effects, self.changes + 1
        what = f"a step failed at {now_ns * 1e-9:.2f} s, soon after a new profile"
        self.counter.warn(
            phrase("current", what, "the one before it is in force again; check the sensor"), now_ns
        )
        return True

    def _fault(self, profile: NDArray[np.float64]) -> str:
        """Return why a profile is rejected, after counting it; "" if it is accepted."""
        impossible, present = "", profile_of(self.effects)
        if present is None:
            impossible = phrase(
                "current", "the scene lists no current", "add the effect 'current' to the scene"
            )
        elif profile.ndim != 2 or profile.shape[1] not in (3, 4) or len(profile) == 0:
            what = f"its shape is {profile.shape}"
            impossible = phrase("current", what, "give rows of z, east, north (, up)")
        elif len(profile) > MAX_ROWS:
            impossible = phrase(
                "current", f"it has {len(profile)} rows", f"give {MAX_ROWS} at most"
            )
        elif not np.isfinite(profile).all():
            return self.counter.refuse(
                "non_finite",
                phrase("current", "a value is not finite", "every value must be a finite number"),
            )
        elif np.any(np.diff(profile[:, 0]) >= 0.0) or profile[0, 0] > 0.0:
            impossible = phrase(
                "current", "its heights are out of order", "order rows from z = 0 or below down"
            )
        elif np.abs(profile[:, 1:]).max() > MAX_CURRENT_M_PER_S:
            impossible = phrase(
                "current",
                f"{np.abs(profile[:, 1:]).max():g} m/s is no sea current",
                f"give at most {MAX_CURRENT_M_PER_S:g} m/s",
            )
        elif len(present.U) == 2 and profile[:, 3:].any():
            what = "it has a vertical component, which this scene's current has not"
            right = "give the scene's profile one, [east, north, up], be it 0"
            impossible = phrase("current", what, right)
        else:
            impossible = _uneven(profile)
        return self.counter.refuse("impossible", impossible) if impossible else ""


def _uneven(profile: NDArray[np.float64]) -> str:
    """Return the error in the depths or the shear of an ordered profile; "" if there is none."""
    if profile[-1, 0] < DEEPEST_ROW_M:
        right = f"the deepest row may lie at {DEEPEST_ROW_M:g} m"
        return phrase("current", f"a row lies at z = {profile[-1, 0]:g} m", right)
    spacing = -np.diff(profile[:, 0])
    if len(spacing) and spacing.min() < MIN_ROW_SPACING_M:
        row = int(spacing.argmin())
        what = f"rows {row} and {row + 1} are {spacing[row]:g} m apart"
        return phrase("current", what, f"give rows at least {MIN_ROW_SPACING_M:g} m apart")
    shear, row = steepest_shear(profile)
    if shear > SHEAR_LIMIT_PER_S:
        what = f"it changes by {shear:.3g} m/s a metre below row {row}"
        return phrase("current", what, f"give at most {SHEAR_LIMIT_PER_S:g} m/s a metre")
    return ""


def _like(profile: NDArray[np.float64], components: int) -> NDArray[np.float64]:
    """Return a profile with as many components of velocity as the scene's own current has.

    Other kernels would have to be compiled for another number of them, in the middle of the run.
    """
    missing = np.zeros((len(profile), max(1 + components - profile.shape[1], 0)))
    return np.hstack([profile, missing])[:, : 1 + components]


def _largest_change(
    before: Current | RisingCurrent, after: Current | RisingCurrent
) -> tuple[float, float]:
    """Return the largest change of velocity [m/s] between two profiles, and its height [m]."""
    z = np.union1d(before.z, after.z)  # both are linear in between
    changes = [
        np.interp(z, after.z, new) - np.interp(z, before.z, old)
        for new, old in zip(after.U, before.U, strict=True)
    ]
    size = np.linalg.norm(changes, axis=0)
    worst = int(size.argmax())
    return float(size[worst]), float(z[worst])
