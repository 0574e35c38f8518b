"""A parameter study, run to its end: on the cores of this machine or on a Dask cluster."""

from __future__ import annotations

import fcntl
import hashlib
import json
import logging
import socket
import time
from collections.abc import Callable, Collection, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, Self, TypeVar

from rope_twin.core.jit.wide import LANES
from rope_twin.core.lanes.joined_group import why_joined_alone
from rope_twin.errors import InputError, RopeTwinError, require
from rope_twin.files import write_whole
from rope_twin.quantity import or_none
from rope_twin.scene.convergence import known_error, solver_version
from rope_twin.scene.joined_model import build_joined
from rope_twin.scene.rigging import is_joined
from rope_twin.scene.schema import Scene
from rope_twin.studies.ensemble import MemberHeave
from rope_twin.studies.study_design import (
    FatigueRequest,
    Row,
    Study,
    StudyRun,
    design_runs,
    run_of,
    run_system,
    run_together,
)
from rope_twin.twin.ensemble.ensemble import cores, whole_steps

if TYPE_CHECKING:
    import pyarrow

CHANGED = "; the convergence study is of the scene before its numbers were varied"


@dataclass(frozen=True)
class Batch:
    """Runs of one scene; the complete input of a worker."""

    scene: Scene
    runs: tuple[StudyRun, ...]
    columns: tuple[str, ...]  # names of the variables
    seconds: float
    slack_interval_s: float
    fatigue: FatigueRequest | None


def cut_into_batches(study: Study, runs: Sequence[StudyRun], at_once: int = LANES) -> list[Batch]:
    """Group runs of the same scene into batches of limited size."""
    groups: dict[str, list[StudyRun]] = {}
    for run in runs:
        groups.setdefault(run.scene.digest, []).append(run)
    columns = tuple(variable.column for variable in study.vary)
    return [
        Batch(group[0].scene, tuple(group[first : first + at_once]), columns, study.seconds,
              study.slack_interval_s, study.fatigue)
        for group in groups.values() for first in range(0, len(group), at_once)
    ]  # fmt: skip


def run_batch(batch: Batch) -> list[Row]:
    """Return a row of results for each run.

    Raises:
        RopeTwinError: the sea is not there or too short, or the curve does not fit the rope.
    """
    start_s = time.perf_counter()
    results = list(_results(batch))
    error = known_error(batch.scene)
    took_s = (time.perf_counter() - start_s) / len(batch.runs)
    return [
        {
            "run": run.number,
            **dict(zip(batch.columns, run.values, strict=True)),
            **result,
            # of the scene's convergence study; indicative for a run with other values
            "study_error_rms_pct": or_none(error.rms_pct),
            "study_error_peak_pct": or_none(error.peak_pct),
            "study_error_words": error.words + (CHANGED if run.changes else ""),
            "took_s": took_s,
        }
        for run, result in zip(batch.runs, results, strict=True)
    ]


def _results(batch: Batch) -> Iterator[Row]:
    """Yield the results of each run, stepped together unless poses move a multi-line scene."""
    seas = MemberHeave(batch.scene, batch.seconds)  # rejects a sea that does not reach
    variations = [
        seas.variation(run.changes, run.sea_offset_s, "seconds", f"run {run.number}")
        for run in batch.runs
    ]
    posed = any(
        variation.heave is not None and variation.heave.lateral is not None
        for variation in variations
    )
    if not (posed and is_joined(batch.scene)):
        yield from run_together(
            batch.scene, variations, batch.seconds, batch.slack_interval_s, batch.fatigue
        )
        return
    for run in batch.runs:
        yield run_system(run, batch.seconds, batch.slack_interval_s, batch.fatigue)


WHOLE, MARK, LOCK = "runs.parquet", "study.json", "lock"


def check_parquet() -> None:
    """Check that Parquet files can be written. Raises InputError: pyarrow is not installed."""
    require("pyarrow", "a study writes its rows with it", "study")


class RowFolder:
    """The folder of the rows of one study or plan; held by one process at a time.

    `whole`, `words` and `lists` name the columns that are no numbers with a fraction; those of
    lists may follow the name of a rope.
    """

    title = "study"
    whole: Collection[str] = ("run",)
    words: Collection[str] = ("failure",)
    lists: Collection[str] = ()

    def __init__(self, folder: Path, name: str, scene: str, stamp: str) -> None:
        """Open the folder; `stamp` identifies study, scene and solver of the rows found there.

        name, scene: of the study.

        Raises:
            InputError: another process is at it, it holds another study, or it cannot be read or
                written.
        """
        check_parquet()
        self._folder = folder
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._lock: IO[str] = (folder / LOCK).open("w")
        except OSError as error:
            problem = f"it cannot be written ({error.strerror})"
            raise InputError(str(folder), problem, "choose another one with --out") from error
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            self._lock.close()
            problem = f"another process is at this {self.title}"
            raise InputError(str(folder), problem, "let it end, or stop it") from error
        self._claim({"study": name, "scene": scene, "stamp": stamp})

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *failure: object) -> None:
        self._lock.close()

    def _claim(self, content: dict[str, str]) -> None:
        mark = self._folder / MARK
        if not mark.exists() and not self._files():
            write_whole(mark, json.dumps(content, ensure_ascii=False).encode())
            return
        try:
            claim = json.loads(mark.read_text(encoding="utf-8"))
            stamp, study = claim["stamp"], claim["study"]
        except (OSError, ValueError, TypeError, LookupError):
            stamp = study = ""
        if stamp != content["stamp"]:
            self._lock.close()
            problem = f"its rows are of another {self.title}, scene or solver ('{study}')"
            if not stamp:
                problem = f"{MARK} is missing or damaged: its rows may be of another {self.title}"
            remedy = "give another folder with --out, or remove this one"
            raise InputError(str(self._folder), problem, remedy)

    def done(self) -> set[int]:
        """Return the numbers of the runs with rows in the folder."""
        return {int(row["run"]) for row in self.rows(["run"])}

    def add(self, rows: Sequence[Row]) -> None:
        """Keep the rows of a batch."""
        first = min(row["run"] for row in rows)
        self._write(self._folder / f"part-{first:06d}-{len(rows)}.parquet", rows)

    def rows(self, columns: list[str] | None = None) -> list[Row]:
        """Return all rows in the folder, by run; each once.

        Raises:
            InputError: one of its files was damaged or edited.
        """
        import pyarrow
        import pyarrow.parquet as parquet

        row_of_run: dict[int, Row] = {}
        for path in self._files():
            try:
                for row in parquet.read_table(path, columns=columns).to_pylist():
                    row_of_run[int(row["run"])] = row
            except (pyarrow.ArrowException, OSError, LookupError, TypeError, ValueError) as error:
                problem = f"it holds no rows of a {self.title}: damaged, or edited by hand"
                remedy = "remove the file, and its runs are made again"
                raise InputError(str(path), problem, remedy) from error
        return [row_of_run[number] for number in sorted(row_of_run)]

    def close_rows(self) -> Path:
        """Write all rows to one file; return its path."""
        parts = [path for path in self._files() if path.name != WHOLE]
        table = self._folder / WHOLE
        if parts:
            self._write(table, self.rows())
        for path in parts:
            path.unlink()
        return table

    def _files(self) -> list[Path]:
        return sorted([*self._folder.glob("part-*.parquet"), *self._folder.glob(WHOLE)])

    def _write(self, path: Path, rows: Sequence[Row]) -> None:
        import pyarrow
        import pyarrow.parquet as parquet

        table = pyarrow.Table.from_pylist(list(rows), schema=self._schema(rows[0]))
        sink = pyarrow.BufferOutputStream()
        parquet.write_table(table, sink)
        write_whole(path, sink.getvalue().to_pybytes())

    def _schema(self, row: Row) -> pyarrow.Schema:
        """Return the types by column, whichever values the first row lacks."""
        import pyarrow

        def kind(name: str) -> Any:
            if name in self.whole:
                return pyarrow.int64()
            if name in self.words:
                return pyarrow.string()
            listed = name.rpartition(".")[2] in self.lists
            return pyarrow.list_(pyarrow.float64()) if listed else pyarrow.float64()

        return pyarrow.schema([(name, kind(name)) for name in row])


class StudyFolder(RowFolder):
    """The folder of a parameter study."""

    whole = "run", "steps", "unconverged_substeps", "elements"
    lists = "damage", "damage_from_lower_end_m"

    def __init__(self, folder: Path, study: Study, stamp: str) -> None:
        """Open the folder, as any of rows."""
        super().__init__(folder, study.name, study.scene, stamp)
        text_columns = (
            variable.column for variable in study.vary if variable.names or variable.cases
        )
        self.words = {"study_error_words", "damage_worst_rope", "failure", *text_columns}


Report = Callable[[int, int], None]  # runs done, runs in all
Item = TypeVar("Item")
Result = TypeVar("Result")
CONNECT_S = 10
RETRIES = 2  # of a batch whose worker died


def run_parameter_study(
    study: Study,
    scene: Scene,
    into: Path,
    report: Report,
    scheduler: str = "",
    at_once: int = LANES,
) -> tuple[list[Row], Path]:
    """Run all runs that have no row in the folder yet; return all rows, and their file.

    report: called at the start and whenever a batch is done. scheduler: address of a Dask
    scheduler; empty: the cores of this machine. at_once: runs in a batch; LANES of them step in one
    core's vectors. A multi-line run that does not step in lanes is a batch by itself.

    Raises:
        RopeTwinError: a run cannot be made; rows that were finished stay.
    """
    runs = [run_of(study, scene, *numbered) for numbered in enumerate(design_runs(study))]
    _check_times(study, {run.scene.time.step_s for run in runs})
    depends_on = repr((study.digest, scene.digest, solver_version(scene)))
    stamp = hashlib.sha256(depends_on.encode()).hexdigest()[:16]
    with StudyFolder(into, study, stamp) as folder:
        done = folder.done()
        report(len(done), len(runs))
        is_alone = is_joined(scene) and why_joined_alone(build_joined(scene).system)
        batches = cut_into_batches(
            study,
            [run for run in runs if run.number not in done],
            1 if is_alone else at_once,
        )
        count = len(done)
        for rows in spread(run_batch, batches, scheduler):
            folder.add(rows)
            count += len(rows)
            report(count, len(runs))
        table = folder.close_rows()
        return folder.rows(), table


def _check_times(study: Study, steps_s: set[float]) -> None:
    for step_s in steps_s:
        whole_steps(f"{study.path}: seconds", study.seconds, step_s)
        whole_steps(f"{study.path}: slack_interval_s", study.slack_interval_s, step_s)
        if study.fatigue is not None:
            whole_steps(f"{study.path}: fatigue.sample_s", study.fatigue.sample_s, step_s)
            samples = study.seconds / study.fatigue.sample_s
            if abs(samples - round(samples)) > 1e-6:
                problem = f"{study.seconds:g} s are no whole number of samples"
                remedy = f"give a part of {study.seconds:g} s"
                raise InputError(f"{study.path}: fatigue.sample_s", problem, remedy)


def on_cores(
    work: Callable[[Item], Result],
    items: Sequence[Item],
    threads: int | None = None,
    stop: Callable[[], None] = lambda: None,
) -> Iterator[Result]:
    """Yield results of the work on each item, as they come.

    The first item is worked on by itself, since it may have to compile.

    threads: None: one a core. stop: called on an error, to end the work in progress early.
    """
    if not items:
        return
    yield work(items[0])
    with ThreadPoolExecutor(threads or cores()) as pool:
        try:
            for future in as_completed([pool.submit(work, item) for item in items[1:]]):
                yield future.result()
        except BaseException:
            stop()
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def spread(
    work: Callable[[Item], Result], items: Sequence[Item], address: str, threads: int | None = None
) -> Iterator[Result]:
    """Yield results of the work on each item, of a cluster if an address is given, else `on_cores`.

    Raises:
        RopeTwinError: there is no such cluster, or the work cannot be done; one sentence.
    """
    return on_cluster(work, items, address) if address else on_cores(work, items, threads)


def on_cluster(
    work: Callable[[Item], Result], items: Sequence[Item], address: str
) -> Iterator[Result]:
    """Yield results of the work on each item, as they come.

    A worker does one item at a time; that of a failed worker goes to another one.

    Raises:
        RopeTwinError: there is no such cluster, or the work cannot be done; one sentence.
    """
    require("distributed", "--scheduler needs it", "study")
    import distributed

    try:
        _knock(address)
        client = distributed.Client(address, timeout=CONNECT_S, set_as_default=False)
    except OSError as error:
        problem = f"no Dask scheduler answers there within {CONNECT_S} s"
        remedy = "start one with `dask scheduler` and workers with `dask worker ADDRESS`"
        raise InputError(f"--scheduler {address}", problem, remedy) from error
    # A lost connection is reported once, by `_result`, and not with the tracebacks of dask.
    logging.getLogger("distributed.client").setLevel(logging.CRITICAL)
    with client:
        if not client.scheduler_info()["workers"]:
            remedy = "start some with `dask worker ADDRESS --nthreads 1`"
            raise InputError(f"--scheduler {address}", "it has no workers", remedy)
        futures = client.map(work, items, pure=False, retries=RETRIES)
        for future in distributed.as_completed(futures, loop=client.loop):
            yield _result(future, address)


def _knock(address: str) -> None:
    """Check that the cluster answers, since a client that cannot connect reports it too late.

    Raises:
        InputError: it is no address.
        OSError: nobody answers.
    """
    from distributed.comm import get_address_host_port

    try:
        host_port = get_address_host_port(address)
    except (ValueError, KeyError, NotImplementedError) as error:
        remedy = "give host and port as the scheduler tells them, like tcp://10.0.0.5:8786"
        raise InputError(f"--scheduler {address}", "it is no address", remedy) from error
    socket.create_connection(host_port, CONNECT_S).close()


def _result(future: Any, address: str) -> Any:
    from distributed import CancelledError

    try:
        result = future.result()
    except RopeTwinError:
        raise
    except CancelledError as error:  # nobody here cancels: the client does, without a connection
        remedy = "start it and its workers again; the same command goes on with the rows left"
        raise InputError(
            f"--scheduler {address}", "the connection to the Dask scheduler is lost", remedy
        ) from error
    except Exception as error:  # whatever went wrong on a worker, this process is to say it
        remedy = "see its log; the rows that are done stay"
        raise InputError(
            f"--scheduler {address}", f"a worker could not go on ({error!r})", remedy
        ) from error
    return result
