"""Reported energy and power of every effect agree with the forces of its kernels."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from effect_cases import CURTAINS, NODES, acting, apply, data_of, loads, some_stage, some_work

from rope_twin.core import state as rows
from rope_twin.core.loads.accounts import Place, account, account_sum, accounts_of, wetted
from rope_twin.core.loads.hooks import hooks_of, ramped
from rope_twin.core.state import Floats
from rope_twin.effects import EFFECTS
from rope_twin.effects.rope_mass import Weight

NAMES = [effect.name for effect in EFFECTS]
DT = 1e-5
FORCE = slice(3, 6)  # of what `loads` returns


def three(work: Floats, row: int) -> Floats:
    return work[row : row + 3]


def seen(work: Floats, turning: Floats, dt: float) -> Place:
    """Return the nodes of `work` a moment later, as an account reads them."""
    v, a = three(work, rows.VELOCITY), three(work, rows.ACCELERATION)
    tangent = three(work, rows.TANGENT) + dt * turning
    return Place(
        arc=np.append(0.0, np.cumsum(work[rows.REST, :-1])),
        position=three(work, rows.POSITION) + dt * v + 0.5 * dt * dt * a,
        velocity=v + dt * a,
        acceleration=a,
        tangent=tangent / np.linalg.norm(tangent, axis=0),
        turning=turning,
        flow=three(work, rows.FLOW),
        flow_rate=three(work, rows.FLOW_RATE),
        surface=work[rows.SURFACE],
        mass=work[rows.MASS],
        volume=work[rows.VOLUME],
        frontal=work[rows.FRONTAL],
        skin=work[rows.SKIN],
        length=work[rows.LENGTH],
        bare=np.zeros(NODES),
        touching=work[rows.FRONTAL],
    )


def stored(effects: tuple[Any, ...], place: Place) -> float:
    end = Place(*(row[..., :1] for row in place))
    along = account_sum("kinetic", effects, place) + account_sum("potential", effects, place)
    return (
        along
        + account_sum("kinetic_end", effects, end)
        + account_sum("potential_end", effects, end)
    )


# A rigid body has motion of its own, so what it stores is no function of the nodes: its account is
# held against runs (test_rigid_body.py); so is that of contact, which ropes or
# payloads share (test_line_contact.py, test_payload_contact.py).
TOGETHER = {  # what takes from the accounts of others is held against all of them
    "wetting": ("wetting", "weight", "drag", "added_mass"),
    "depth_profiles": ("depth_profiles", "weight", "drag", "added_mass", "payload"),
    "depth_profiles beside wetting": (
        "wetting",
        "depth_profiles",
        "weight",
        "drag",
        "added mass along the rope",
        "payload",
    ),
    "added mass along the rope": ("added mass along the rope",),
    "wind": ("wetting", "wind", "weight", "added_mass"),
    "fluid_ramp": ("drag", "added_mass", "payload", "net", "fairing", "fluid_ramp"),
}
OF_THE_NODES = [*dict.fromkeys([*NAMES, *TOGETHER])]
OF_THE_NODES.remove("rigid_body")
OF_THE_NODES.remove("line_contact")
OF_THE_NODES.remove("payload_contact")


@pytest.mark.parametrize("name", OF_THE_NODES)
@pytest.mark.parametrize("seed", [1, 2])
def test_force_times_velocity_is_power_less_stored_energy_rate(name: str, seed: int) -> None:
    """F·v = power - d(kinetic + potential)/dt over all nodes, however they move and turn."""
    effects, work = data_of(*TOGETHER.get(name, (name,))), some_work(seed)
    effects = acting(name) if name in CURTAINS else effects
    random = np.random.default_rng(seed)
    work[rows.FLOW : rows.FLOW + 2] = random.normal(0.0, 0.6, (2, NODES))
    three(work, rows.ACCELERATION)[:, -1] = 0.0  # couplings clear the inertia at the hang-off
    tangent = three(work, rows.TANGENT)
    turning = random.normal(0.0, 0.2, (3, NODES))
    turning -= (turning * tangent).sum(axis=0) * tangent
    force = (loads(effects, work) - loads((), work))[FORCE]
    moved = work.copy()
    apply(effects, moved, some_stage(), 0, NODES)
    work[rows.FLOW_RATE : rows.FLOW_RATE + 3] = moved[rows.FLOW_RATE : rows.FLOW_RATE + 3]
    done = float((force * three(work, rows.VELOCITY)).sum())
    effects = ramped(effects, some_stage().time)
    position = seen(work, turning, 0.0)
    end = Place(*(row[..., :1] for row in position))
    power = account_sum("power", effects, wetted(effects, position))
    power += account_sum("power_end", effects, end)
    later, before = (stored(effects, seen(work, turning, dt)) for dt in (DT, -DT))
    rate = (later - before) / (2.0 * DT)
    assert done == pytest.approx(power - rate, rel=1e-6, abs=1e-6)


@pytest.mark.parametrize("name", NAMES)
def test_every_effect_that_loads_the_rope_has_an_energy_account(name: str) -> None:
    """Otherwise its work would count as numerical loss (`twin.ledger` rejects such a run)."""
    kind = type(data_of(name)[0])
    loading = bool(
        {"submerge", "load", "load_end", "load_nodes", "couple"}.intersection(hooks_of(kind))
    )
    assert loading == bool(accounts_of(kind)), (
        f"effect '{name}' loads the rope: say what it stores or brings by functions beside its"
        " kernels, @account(kind, Type) of rope_twin.core.loads.accounts"
    )


def test_duplicate_and_unknown_energy_accounts_are_rejected() -> None:
    with pytest.raises(ValueError, match="unknown account 'heat'"):
        account("heat", Weight)
    with pytest.raises(ValueError, match="Weight has registered its 'potential' already"):
        account("potential", Weight)
