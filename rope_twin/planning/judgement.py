"""Judgement of a sea state: characteristic values of its seeds against the criteria of the plan."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rope_twin.planning.extremes import LEAST_SEEDS, Extreme, characteristic_maximum
from rope_twin.planning.slings import sling_shares

if TYPE_CHECKING:
    from rope_twin.planning.phases import Leg, RopeAtRest
    from rope_twin.planning.plan_file import Criteria, Plan
    from rope_twin.planning.simplified import Simplified
    from rope_twin.planning.twin_runs import Row
    from rope_twin.scene.schema import Scene


class Quantity(NamedTuple):
    """A judged quantity: larger is worse."""

    words: str
    unit: str
    scale: float  # from SI to the unit of tables


QUANTITIES = {
    "hook_load": Quantity("hook load", "kN", 1e-3),
    "uplift": Quantity("hydrodynamic uplift over submerged weight", "", 1.0),
    "rope_load": Quantity("tension", "kN", 1e-3),
    "rope_loss": Quantity("loss over static tension", "", 1.0),
    "lower_end_load": Quantity("load at the lower end of the rope", "kN", 1e-3),
    "loss": Quantity("loss of the least tension", "kN", 1e-3),
    "landing_speed": Quantity("landing speed", "m/s", 1.0),
    "re_hit": Quantity("re-hit speed of the deck", "m/s", 1.0),
    "offset": Quantity("lateral offset", "m", 1.0),
    "stroke": Quantity("stroke of the compensation", "m", 1.0),
    "stroke_speed": Quantity("speed of the compensation", "m/s", 1.0),
}


LEAST_SPEED = 1e-3  # of a limit that is a speed of 0 [m/s]


@dataclass(frozen=True)
class Limit:
    """A criterion: a quantity and what it may be."""

    key: str  # of the criteria
    quantity: str  # of QUANTITIES
    most: float
    words: str


def limits_of(plan: Plan, scene: Scene, legs: Sequence[Leg]) -> list[Limit]:
    """Return the criteria that apply to a phase."""
    criteria, found, weight = plan.criteria, [], legs[0].payload_n
    if criteria.swl_n is not None:
        found.append(Limit("swl_n", "hook_load", criteria.swl_n, "SWL"))
    if criteria.safety_factor is not None:
        breaking = scene.ropes[0].breaking_load_n
        words = f"MBL/{criteria.safety_factor:g}"
        found.append(Limit("safety_factor", "hook_load", breaking / criteria.safety_factor, words))
    if legs[0].ropes:
        found = list(_rope_limits(criteria, legs[0].ropes))
    if plan.slings is not None:
        shares = sling_shares(plan.slings, weight)
        most = plan.slings.strength_n / float(shares.largest.max())
        found.append(Limit("slings", "lower_end_load", most, "slings"))
    if criteria.uplift_share is not None and not legs[0].ropes:
        found.append(Limit("uplift_share", "uplift", criteria.uplift_share, "slack"))
    if criteria.least_tension_n is not None:
        most = weight - criteria.least_tension_n
        found.append(Limit("least_tension_n", "loss", most, "least tension"))
    if criteria.landing_speed_m_per_s is not None and legs[0].bed_m is not None:
        most = criteria.landing_speed_m_per_s
        found.append(Limit("landing_speed_m_per_s", "landing_speed", most, "landing speed"))
    if criteria.re_hit_m_per_s is not None and legs[0].deck_m is not None:
        most = max(criteria.re_hit_m_per_s, LEAST_SPEED)
        found.append(Limit("re_hit_m_per_s", "re_hit", most, "re-hit"))
    if criteria.offset_m is not None:
        found.append(Limit("offset_m", "offset", criteria.offset_m, "offset"))
    if criteria.stroke_m is not None:
        found.append(Limit("stroke_m", "stroke", criteria.stroke_m, "stroke"))
    if criteria.compensation_speed_m_per_s is not None:
        most = criteria.compensation_speed_m_per_s
        found.append(Limit("compensation_speed_m_per_s", "stroke_speed", most, "AHC speed"))
    return found


def _rope_limits(criteria: Criteria, ropes: Sequence[RopeAtRest]) -> Iterator[Limit]:
    """Yield the criteria of each of several ropes; those from the ship are held by a crane."""
    for one in ropes:
        load, loss = f"rope_load[{one.name}]", f"rope_loss[{one.name}]"
        if criteria.swl_n is not None and one.from_ship:
            yield Limit(f"swl_n[{one.name}]", load, criteria.swl_n, f"SWL {one.name}")
        if criteria.safety_factor is not None:
            most = one.breaking_load_n / criteria.safety_factor
            words = f"MBL/{criteria.safety_factor:g} {one.name}"
            yield Limit(f"safety_factor[{one.name}]", load, most, words)
        if criteria.uplift_share is not None and one.lower_n > 0.0:
            words = f"slack {one.name}"
            yield Limit(f"uplift_share[{one.name}]", loss, criteria.uplift_share, words)


def plain_name(name: str) -> str:
    """Return a key or quantity without the rope that it is of."""
    return name.partition("[")[0]


def quantity_of(name: str) -> Quantity:
    """Return words, unit and scale of a quantity, such as `hook_load` or `rope_load[fore]`."""
    known, _, rope = name.partition("[")
    found = QUANTITIES[known]
    return found._replace(words=f"{found.words}, {rope[:-1]}") if rope else found


def samples_of(rows: Sequence[Row], weight_n: float) -> dict[str, list[float]]:
    """Return the maxima of each quantity, one of each seed; rows: of all legs of the seeds.

    A seed's maximum is that over the legs of its phase.
    """
    by_seed: dict[int, list[Row]] = {}
    for row in rows:
        by_seed.setdefault(int(row["seed"]), []).append(row)
    found: dict[str, list[float]] = {name: [] for name in QUANTITIES if "rope_" not in name}
    for own in (by_seed[seed] for seed in sorted(by_seed)):
        found["hook_load"].append(max(row["top_max_n"] for row in own))
        found["uplift"].append(max(1.0 - row["payload_min_n"] / weight_n for row in own))
        found["lower_end_load"].append(max(row["payload_max_n"] for row in own))
        found["loss"].append(max(weight_n - row["least_n"] for row in own))
        found["landing_speed"].append(max(row["landing_speed_m_per_s"] for row in own))
        found["re_hit"].append(max(row["re_hit_m_per_s"] for row in own))
        found["offset"].append(max(row["offset_m"] for row in own))
        found["stroke"].append(max(row["stroke_m"] for row in own))
        found["stroke_speed"].append(max(row["stroke_speed_m_per_s"] for row in own))
    for name in next(iter(by_seed.values()), [{}])[0]:
        if name.startswith(("rope_load[", "rope_loss[")):
            found[name] = [max(row[name] for row in by_seed[seed]) for seed in sorted(by_seed)]
    return {name: values for name, values in found.items() if np.isfinite(values).all()}


@dataclass(frozen=True)
class Judgement:
    """Characteristic values in one sea state, and their use of the limits."""

    height_m: float
    seeds: int
    values: Mapping[str, Extreme]  # by quantity
    uses: Mapping[str, Extreme]  # value over limit, by criterion
    slack_share: float  # of the time, over all seeds
    failures: int  # runs that did not reach their end
    fault: str = ""  # why the sea could not be run
    governing_seed: int = -1  # of the largest use
    governing_leg: int = 0

    @property
    def governing(self) -> str:
        """Return the criterion with the largest use; "" if nothing was judged."""
        return max(self.uses, key=lambda key: self.uses[key].value, default="")

    @property
    def use(self) -> float:
        """Return the largest use; infinite if the sea could not be run."""
        if self.fault or self.failures:
            return math.inf
        return max((one.value for one in self.uses.values()), default=0.0)

    @property
    def passed(self) -> bool:
        """Return whether all criteria are met."""
        return self.use <= 1.0

    @property
    def clear(self) -> bool:
        """Return whether the intervals leave no doubt about it."""
        if not math.isfinite(self.use):
            return True
        above = any(one.low > 1.0 for one in self.uses.values())
        return above or all(one.high <= 1.0 for one in self.uses.values())

    def narrow(self, within: float) -> bool:
        """Return whether the values that count are known to ± this share of them.

        They are the hook load, the governing one, and each whose interval contains its limit.
        """
        count = [one for one in self.uses.values() if one.low <= 1.0 < one.high]
        count += [self.uses[self.governing]] if self.uses else []
        count += [self.values["hook_load"]] if "hook_load" in self.values else []
        return all(one.half_width <= within for one in count)


def judge(
    plan: Plan, limits: Sequence[Limit], rows: Sequence[Row], height_m: float, weight_n: float
) -> Judgement:
    """Return the judgement of rows of a sea state."""
    failures = sum(bool(row["failure"]) for row in rows)
    samples = samples_of([row for row in rows if not row["failure"]], weight_n)
    method, values = plan.method, {}
    for name, sample in samples.items():
        if len(sample) >= LEAST_SEEDS:
            values[name] = characteristic_maximum(sample, method.percentile, method.confidence)
    uses = {
        one.key: values[one.quantity].scaled(1.0 / one.most)
        for one in limits
        if one.quantity in values and one.most > 0.0
    }
    beyond = next((one for one in limits if one.most <= 0.0), None)
    fault = f"{beyond.key} is out of reach at rest" if beyond is not None else ""
    seed, leg = _governing_run(limits, uses, rows, weight_n)
    return Judgement(
        height_m=height_m,
        seeds=len({row["seed"] for row in rows}),
        values=values,
        uses=uses,
        slack_share=float(np.mean([row["slack_share"] for row in rows])) if rows else 0.0,
        failures=failures,
        fault=fault,
        governing_seed=seed,
        governing_leg=leg,
    )


def _governing_run(
    limits: Sequence[Limit], uses: Mapping[str, Extreme], rows: Sequence[Row], weight_n: float
) -> tuple[int, int]:
    """Return seed and leg of the run with the largest value of the governing quantity."""
    good = [row for row in rows if not row["failure"]]
    if not uses or not good:
        return -1, 0
    key = max(uses, key=lambda name: uses[name].value)
    quantity = next(one.quantity for one in limits if one.key == key)
    worst = max(good, key=lambda row: samples_of([row], weight_n)[quantity][0])
    return int(worst["seed"]), int(worst["leg"])


def simplified_uses(limits: Sequence[Limit], found: Sequence[Simplified], weight_n: float
                    ) -> dict[str, float]:  # fmt: skip
    """Return the use of each criterion by the simplified method; found: one of each leg."""
    values = {
        "hook_load": max(one.hook_n for one in found),
        "uplift": max(one.uplift_share for one in found),
        "lower_end_load": max(one.payload_max_n for one in found),
        "loss": weight_n - min(one.payload_min_n for one in found),
        "landing_speed": max(one.payload_m_per_s for one in found),
        "re_hit": max(one.re_hit_m_per_s for one in found),
        "offset": max(one.offset_m for one in found),
        "stroke": max(one.tip_m for one in found),
        "stroke_speed": max(one.tip_m_per_s for one in found),
    }
    return {one.key: values[one.quantity] / one.most for one in limits if one.most > 0.0}
