"""Exit codes of all commands, each with one meaning."""

from __future__ import annotations

from enum import IntEnum


class ExitCode(IntEnum):
    """What the exit code of a command means."""

    OK = 0
    ERROR = 1
    USAGE = 2
    NEGATIVE = 3
    LIMIT = 4
    INTERRUPTED = 130


MEANINGS = {
    ExitCode.OK: "success",
    ExitCode.ERROR: "error, reported in one sentence on stderr; no or incomplete output; a scene "
    "that is invalid or exceeds a limit in static equilibrium (scene check)",
    ExitCode.USAGE: "invalid command line, reported in one sentence on stderr",
    ExitCode.NEGATIVE: "completed with a negative result: messages lost (recover), a difference "
    "(replay --verify), runs that stopped early (ensemble, study), a fault not flagged in time "
    "(faults), an error target missed (accuracy --within), a convergence study missing or out of "
    "date (accuracy --status), a check with ERROR (doctor)",
    ExitCode.LIMIT: "a limit of the scene was exceeded (run, unless --allow-overload)",
    ExitCode.INTERRUPTED: "interrupted (Ctrl-C) before there was a result",
}
