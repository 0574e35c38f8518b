"""Memory of the operator console over hours: a page and its server, faster than real time.

Rows are made and sent PACE times as often as in a run, and the twin's time passes as fast. The
page's memory is that of its scripts after a collection of garbage; the server's is what the whole
process holds. Growth counts from the end of the first tenth, when the trend's minute is full.
"""

from __future__ import annotations

import time
from collections.abc import Callable

from benchmarks.console_speed import CHROMIUM, HangingRope, Row, browsing_tools, serve
from rope_twin.console.pages import RATE_HZ
from rope_twin.errors import InputError

PACE = 12.0  # times real time: more than that, one core is too slow for page and server
LOOKS = 30  # in all
LIMIT_MB = 10.0


def endure(hours: float, show: Callable[[int, int, str], None]) -> list[Row]:
    """Return how much page and server grow over so many hours of rows [MB].

    Raises:
        InputError: Chromium or Playwright is missing, or the hours are no positive number.
    """
    if not 0.0 < hours < 1000.0:
        raise InputError("--hours", f"{hours:g}", "give a positive number below 1000")
    psutil, sync_playwright = browsing_tools()
    served = serve(time.time_ns(), PACE)
    me = psutil.Process()
    wait_s = 3600.0 * hours / PACE / LOOKS
    heaps: list[float] = []
    resident_b: list[float] = []
    with sync_playwright() as play:
        browser = play.chromium.launch(executable_path=str(CHROMIUM), args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        page.goto(served.address)
        tools = page.context.new_cdp_session(page)
        tools.send("Performance.enable")
        for look in range(LOOKS):
            show(look, LOOKS, f"{hours:g} h at {PACE:g} times real time")
            time.sleep(wait_s)
            tools.send("HeapProfiler.collectGarbage")
            metrics = tools.send("Performance.getMetrics")["metrics"]
            heaps.append(
                next(metric["value"] for metric in metrics if metric["name"] == "JSHeapUsedSize")
            )
            resident_b.append(me.memory_info().rss)
        browser.close()
    source = served.source
    assert isinstance(source, HangingRope)
    served.close()
    show(LOOKS, LOOKS, "")
    made_h = source.polls / RATE_HZ / 3600.0  # less than `hours` if the machine could not keep up
    return [
        Row(f"{label} grows in {made_h:.1f} h of rows [MB]", _growth_mb(sizes), LIMIT_MB)
        for label, sizes in (("page", heaps), ("server", resident_b))
    ]


def _growth_mb(sizes: list[float]) -> float:
    """Return the growth from the first looks to the last, each the least of a tenth of all [MB].

    The least, since what a page holds between two drawings comes and goes.
    """
    some = max(1, len(sizes) // 10)
    return (min(sizes[-some:]) - min(sizes[some : 2 * some])) / 1e6
