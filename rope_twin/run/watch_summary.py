"""Run summary of VIV response and fatigue damage."""

from __future__ import annotations

from rope_twin.twin.snapshot import Snapshot

Figures = dict[str, float | str]


def vibration_figures(snapshot: Snapshot) -> Figures | None:
    """Return the VIV response at its maximum; None: not enabled, or not known yet."""
    shaking = snapshot.vibration
    if shaking is None:
        return None
    at = shaking.worst
    figures: Figures = {
        "model": shaking.model,
        "cross_flow_diameters": float(shaking.cross_flow[at]),
        "frequency_hz": float(shaking.cross_flow_hz[at]),
        "from_hang_off_m": float(snapshot.arc_length_m[at]),
        "drag_amplification": float(shaking.drag_amplification.max()),
        "cost_pct": shaking.cost_pct,
        "solves": shaking.solves,
    }
    if shaking.in_line is not None:
        figures["in_line_diameters"] = float(shaking.in_line.max())
    return figures


def fatigue_figures(snapshot: Snapshot) -> Figures | None:
    """Return the maximum fatigue damage and its location; None: not enabled."""
    wear = snapshot.fatigue
    if wear is None:
        return None
    at = wear.worst
    return {
        "curve": wear.curve,
        "counted_s": wear.counted_s,
        "used": float(wear.used[at]),
        "from_lower_end_m": float(wear.from_lower_end_m[at]),
        "from_hang_off_m": float(wear.from_hang_off_m[at]),
    }


def watch_words(vibration: Figures | None, fatigue: Figures | None) -> list[str]:
    """Return a line of text for each of the two that is not None."""
    lines = []
    if vibration is not None:
        lines.append(
            f"VIV ({vibration['model']}): maximum cross-flow A/D "
            f"{vibration['cross_flow_diameters']:.3g} at {vibration['frequency_hz']:.3g} Hz, "
            f"{vibration['from_hang_off_m']:.4g} m below the hang-off; drag amplification up to "
            f"{vibration['drag_amplification']:.3g}; monitoring took "
            f"{vibration['cost_pct']:.2g} % of real time"
        )
    if fatigue is not None:
        lines.append(
            f"fatigue ({fatigue['curve']}): maximum damage {fatigue['used']:.3g} (failure at 1), "
            f"{fatigue['from_lower_end_m']:.4g} m from the lower end, in {fatigue['counted_s']:g} s"
        )
    return lines
