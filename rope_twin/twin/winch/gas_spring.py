"""Passive heave compensator at the winch: the rope runs over a flying sheave on a gas spring.

The sheave, of mass m, hangs in f falls of the rope and is held by the spring, whose tension is that
of `effects.compensator` at its stroke x; line out is that of the winch and f·x in addition:

    m·d²x/dt² = f·F - (G(s) + N(x) + c_1·v + c_2·|v|·v + F_f).

F is the expected tension at the step's end, as for a drum (`components`): F' = F - hold·(V' -
parting) - brace·(V' - V) with the pay-out speed V' = V_winch + f·v', at least 0. The step is that
of the implicit Euler rule in v and of the trapezoidal rule in x, so that it stays stable beside a
stop of any stiffness; it is of first order. At the start the stroke is that of the static tension.
As for a drum the line given is counted unstretched: the rope moves by its stretch in addition.
"""

from __future__ import annotations

from collections.abc import Callable

from rope_twin.effects.compensator import SEALS, CompensatorForces, forces, of
from rope_twin.scene.winch import PassiveCompensation
from rope_twin.twin.winch.payout import Payout, WinchStep

ROUNDS, ROUND_OFF = 80, 1e-13


class FlyingSheave:
    """Flying sheave on a gas spring; `add` is called once a step."""

    def __init__(self, params: PassiveCompensation) -> None:
        self._params, self._spring = params, of(params)
        self._stroke = self._rate = 0.0  # [m], [m/s]
        self._start: float | None = None  # stroke of the static tension, at which line out is given
        self._speed = 0.0  # pay-out speed at the end of the last step

    def add(self, wanted: Payout, moment: WinchStep) -> Payout:
        """Return the line at the end of the step, including the stroke."""
        feedback, h, falls = moment.feedback, moment.step_s, self._params.falls
        assert feedback is not None, "tension feedback is missing"
        if self._start is None:
            held = falls * feedback.pull_n
            self._start = self._stroke = root(
                lambda x: self._parts(x, 0.0).pull - held, -1.0, self._params.stroke_m + 1.0
            )
        free, stiff = feedback.at_speed(self._speed), feedback.hold + feedback.brace
        inertia = self._params.sheave_mass_kg / h

        def miss(rate: float) -> float:
            pull = max(free - stiff * (wanted.speed_m_per_s + falls * rate), 0.0)
            held = self._parts(self._after(rate, h), rate)
            seal = held.pull - held.seal + self._seal(self._after(rate, h))
            return inertia * (rate - self._rate) + seal - falls * pull

        width = 1.0
        while miss(self._rate - width) > 0.0 or miss(self._rate + width) < 0.0:
            width *= 4.0
        rate = root(miss, self._rate - width, self._rate + width)
        stroke = self._after(rate, h)
        self._spring.memory[SEALS, 0] = self._seal(stroke) / max(self._spring.seal, 1.0)
        self._stroke, self._rate = stroke, rate
        self._speed = wanted.speed_m_per_s + falls * rate
        return Payout(wanted.length_m + falls * (stroke - self._start), self._speed)

    def _after(self, rate: float, h: float) -> float:
        return self._stroke + 0.5 * h * (self._rate + rate)

    def _parts(self, stroke: float, rate: float) -> CompensatorForces:
        k = self._params.stop_stiffness_n_per_m
        return forces(self._spring, stroke, rate, k, 0.0)

    def _seal(self, stroke: float) -> float:
        """Return the friction of the seals after a step to this stroke [N]."""
        spring, most = self._spring, self._params.stroke_m
        moved = min(max(stroke, 0.0), most) - min(max(self._stroke, 0.0), most)
        z = float(spring.memory[SEALS, 0]) + moved
        return spring.seal * min(max(z, -spring.slip), spring.slip)

    def words(self) -> str:
        """Return the message at an end stop; "" between them."""
        if self._start is None or 0.0 < self._stroke < self._params.stroke_m:
            return ""
        side = "retracted" if self._stroke <= 0.0 else "extended"
        return f"passive heave compensator {side} to its end stop"

    def figures(self, line: Payout) -> dict[str, float]:
        """Return stroke and its rate, + gives line, gas pressure and gas force."""
        parts = self._parts(self._stroke, self._rate)
        return {
            "passive_stroke_m": self._stroke,
            "passive_stroke_m_per_s": self._rate,
            "passive_gas_pressure_pa": parts.pressure_pa,
            "passive_gas_force_n": parts.gas,
        }

    def switch(self, switch: str, time_ns: int) -> None:
        """Do nothing, as a passive compensator has no switch."""

    def set_total_length(self, whole_m: float) -> None:
        """Do nothing, as compensation does not depend on the total length."""


def root(miss: Callable[[float], float], low: float, high: float) -> float:
    """Return the zero of a rising function between these bounds, by regula falsi (Illinois)."""
    below, above, side = miss(low), miss(high), 0
    middle = low
    for _ in range(ROUNDS):
        if high - low <= ROUND_OFF * (abs(low) + abs(high)) or below >= 0.0 or above <= 0.0:
            break
        middle = (low * above - high * below) / (above - below)
        here = miss(middle)
        if here == 0.0:
            return middle
        if here < 0.0:
            above *= 0.5 if side < 0 else 1.0
            low, below, side = middle, here, -1
        else:
            below *= 0.5 if side > 0 else 1.0
            high, above, side = middle, here, 1
    return middle
