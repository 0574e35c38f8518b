"""Results of a plan with named axes: an xarray Dataset, and the netCDF file of it.

Limits are arrays over phase, peak period and heading, loads with their intervals are those at the
limit, and dimension `run` has a row for each run. Names end in the unit, which stands in `units`
too (CF conventions 1.11); numbers that are not known are NaN.
"""

from __future__ import annotations

import io
import math
import operator
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rope_twin import __version__
from rope_twin.errors import require
from rope_twin.files import write_whole
from rope_twin.planning.judgement import quantity_of
from rope_twin.planning.results import daf
from rope_twin.quantity import or_nan, unit_of
from rope_twin.scene.convergence import solver_version

if TYPE_CHECKING:
    from xarray import Dataset

    from rope_twin.planning.cells import CellLimit
    from rope_twin.planning.run import PlanResult

CELL = ("phase", "tp_s", "heading_deg")
SUFFIXES = {"kN": "_n", "m": "_m", "m/s": "_m_per_s", "": ""}  # of the SI unit, by a table's unit
ROW_WORDS = {
    "run": "number of the run, which tells its place in the plan",
    "purpose": "what it is for: `statistics` of its cell",
    "leg": "number of the leg in its phase",
    "seed": "number of the seed in its cell",
    "sea_seed": "random number of the sea",
    "hs_m": "significant wave height",
    "top_max_n": "largest hook load in the exposure",
    "top_min_n": "least hook load",
    "payload_min_n": "minimum tension at the payload",
    "min_n": "minimum tension anywhere in the rope",
    "slack_share": "share of the time with a slack element",
    "setting_error": "discretisation error measured when mesh and step were chosen; NaN: given, "
    "or made finer for its cell, whose discretisation_error counts",
    "seconds": "simulated time, with the settling before the exposure",
    "failure": "why the run did not reach its end; empty: it did",
}


def check_netcdf() -> None:
    """Check, before any computation, that netCDF can be written.

    Raises:
        InputError: xarray or h5netcdf is not installed.
    """
    for name in ("xarray", "h5netcdf"):
        require(name, "netCDF needs it and it is not there", "planning")


def plan_dataset(result: PlanResult) -> Dataset:
    """Return limits and runs as one dataset. Raises InputError: xarray is not installed."""
    check_netcdf()
    import xarray

    plan = result.plan
    attrs = {
        "Conventions": "CF-1.11",
        "title": plan.about or plan.name,
        "source": f"rope_twin {__version__}, solver {solver_version(result.scene)}",
        "plan": plan.name,
        "plan_digest_sha256": plan.digest,
        "scene": result.scene.name,
        "scene_digest_sha256": result.scene.digest,
        "percentile": plan.method.percentile,
        "confidence": plan.method.confidence,
        "first_seed": plan.method.seed,
        "comment": "Loads are characteristic values at the limiting height, with the interval of "
        "their estimate; limits are operational limits, before any alpha factor.",
    }
    units = {limit.key: unit_of(variable_name(limit.quantity))
             for work in result.works for limit in work.limits}  # fmt: skip
    coordinates = {
        "phase": ("phase", [work.title for work in result.works], {"long_name": "phase"}),
        "tp_s": ("tp_s", list(plan.sea.tp_s), {
            "units": "s", "long_name": "peak period of the spectrum",
            "standard_name": "sea_surface_wave_period_at_variance_spectral_density_maximum",
        }),
        "heading_deg": ("heading_deg", list(plan.sea.headings_deg), {
            "units": "degree",
            "long_name": "where the waves travel to, from the bow to port; 180: head seas",
        }),
        "bound": ("bound", ["low", "high"], {"long_name": "end of the interval"}),
        "criterion": ("criterion", list(units), {"long_name": "key of the plan's criteria"}),
        "criterion_unit": ("criterion", list(units.values()), {"long_name": "unit of its limit"}),
    }  # fmt: skip
    variables = {**dict(_limits(result)), **dict(_phases(result)), **dict(_runs(result))}
    return xarray.Dataset(variables, coordinates, attrs)


def write_netcdf(result: PlanResult, path: Path) -> None:
    """Write the dataset as netCDF 4.

    Raises:
        InputError: xarray or h5netcdf is not installed.
        OSError: it cannot be written.
    """
    stream = io.BytesIO()
    plan_dataset(result).to_netcdf(stream, engine="h5netcdf")
    write_whole(path, stream.getvalue())


def _criteria(result: PlanResult) -> list[str]:
    return list(dict.fromkeys(limit.key for work in result.works for limit in work.limits))


Named = Iterator[tuple[str, tuple[Any, ...]]]


def _over_cells(result: PlanResult, value: Callable[[CellLimit], Any], *more: int) -> Any:
    """Return a value of each cell as an array (phases, periods, headings, *more)."""
    sea = result.plan.sea
    shape = (len(result.works), len(sea.tp_s), len(sea.headings_deg), *more)
    return np.array([value(cell) for cell in result.cells]).reshape(shape)


def _limits(result: PlanResult) -> Named:
    """Yield name and content of each variable over the cells."""

    def over(value: Callable[[CellLimit], Any], name: str, long_name: str, **more: str) -> Any:
        return name, (CELL, _over_cells(result, value), _attributes(name, long_name, **more))

    def at_limit(name: str) -> Callable[[CellLimit], float]:
        return lambda cell: math.nan if cell.judged is None else getattr(cell.judged, name)

    # fmt: off
    yield over(lambda cell: or_nan(cell.height_m), "limiting_hs_m",
               "largest Hs of the grid that meets all criteria; NaN: none does",
               standard_name="sea_surface_wave_significant_height",
               ancillary_variables="crossing_hs_m crossing_hs_interval_m capped governing")
    yield over(lambda cell: cell.crossing_m, "crossing_hs_m", "Hs at which the largest use is 1")
    intervals = _over_cells(result, lambda cell: (cell.low_m, cell.high_m), 2)
    description = "interval of the Hs at which the largest use is 1"
    yield "crossing_hs_interval_m", ((*CELL, "bound"), intervals, _attributes("_m", description))
    for name, description in (("capped", "why no higher sea was judged; empty: it was"),
                              ("simplified_capped", "likewise by the simplified method"),
                              ("governing", "criterion that the next height breaks")):
        texts = _over_cells(result, operator.attrgetter(name))
        yield name, (CELL, texts, {"long_name": description})
    yield over(lambda cell: cell.error, "discretisation_error",
               "error of the governing run's hook load and least load from mesh and step")
    yield over(lambda cell: cell.setting.elements, "elements", "elements of the governing run")
    yield over(lambda cell: cell.setting.step_s, "step_s", "time step of the governing run")
    yield over(lambda cell: daf(result, cell), "daf", "characteristic over static hook load")
    yield over(at_limit("slack_share"), "slack_share", "share of the time with a slack element")
    yield over(at_limit("seeds"), "seeds", "seeds at the limiting height")
    yield over(at_limit("governing_seed"), "governing_seed", "seed with the largest use")
    yield over(lambda cell: cell.runs, "runs", "runs of the cell")
    yield over(lambda cell: or_nan(cell.simplified_height_m), "simplified_hs_m",
               "largest Hs by the simplified method of DNV-RP-N103")
    yield over(lambda cell: max((load.hook_n for load in cell.simplified), default=math.nan),
               "simplified_hook_load_n", "hook load by the simplified method of DNV-RP-N103, at "
               "the limiting height; NaN: it has no formulas")
    # fmt: on
    judged = [cell.judged for cell in result.cells if cell.judged is not None]
    for key in dict.fromkeys(name for judgement in judged for name in judgement.values):
        yield from _values(result, key)
    keys = _criteria(result)
    uses = _over_cells(result, lambda cell: [_use(cell, key) for key in keys], len(keys))
    description = "characteristic value over its limit, at the limiting height; NaN: no such limit"
    yield "use", ((*CELL, "criterion"), uses, _attributes("use", description))


def variable_name(quantity: str, part: str = "") -> str:
    """Return the name of a quantity with its SI unit: of `rope_load[fore]` `rope_load_fore_n`."""
    rope = quantity.replace("[", "_").rstrip("]")
    return f"{rope}{part}{SUFFIXES[quantity_of(quantity).unit]}"


def _values(result: PlanResult, key: str) -> Named:
    """Yield a characteristic value at the limit and its interval, in SI units."""
    long_name = quantity_of(key).words

    def ends(cell: CellLimit) -> tuple[float, float, float]:
        if cell.judged is None or key not in cell.judged.values:
            return math.nan, math.nan, math.nan
        value = cell.judged.values[key]
        return value.value, value.low, value.high

    values = _over_cells(result, ends, 3).astype(float)
    name, interval = variable_name(key), variable_name(key, "_interval")
    attributes = _attributes(name, f"characteristic {long_name}", ancillary_variables=interval)
    yield name, (CELL, values[..., 0], attributes)
    attributes = _attributes(interval, f"interval of the characteristic {long_name}")
    yield interval, ((*CELL, "bound"), values[..., 1:], attributes)


def _use(cell: CellLimit, key: str) -> float:
    if cell.judged is None or key not in cell.judged.uses:
        return math.nan
    return cell.judged.uses[key].value


def _phases(result: PlanResult) -> Named:
    """Yield name and content of each variable over the phases."""
    keys = _criteria(result)
    works = result.works
    for name, long_name, values in (
        ("depth_begin_m", "depth of the payload at the start", [w.legs[0].from_m for w in works]),
        ("depth_end_m", "depth of the payload at the end", [w.legs[-1].to_m for w in works]),
        ("static_hook_load_n", "largest static hook load", [w.static_hook_n for w in works]),
        ("payload_submerged_n", "submerged weight of the payload", [w.weight_n for w in works]),
    ):
        yield name, ("phase", values, _attributes(name, long_name))
    limits = [{limit.key: limit.most for limit in work.limits} for work in result.works]
    table = [[limit.get(key, math.nan) for key in keys] for limit in limits]
    long_name = "limit of each criterion, in its `criterion_unit`; NaN: none"
    yield "criterion_limit", (("phase", "criterion"), table, {"long_name": long_name})


def _runs(result: PlanResult) -> Named:
    """Yield the columns of the runs as `run_...`."""
    if not result.rows:
        return
    for key in result.rows[0]:
        values = np.array([row.get(key, math.nan) for row in result.rows])
        name = variable_name(key) if "[" in key else key
        attributes = _attributes(name, ROW_WORDS.get(name, name.replace("_", " ")))
        if values.dtype.kind == "U":
            attributes.pop("units")
        yield ("run" if name == "run" else f"run_{name}"), ("run", values, attributes)


def _attributes(name: str, long_name: str, **more: str) -> dict[str, str]:
    return {"long_name": long_name, "units": unit_of(name)} | more
