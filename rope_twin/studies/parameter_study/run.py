"""A parameter study, run to its end: on the cores of this machine or on a Dask cluster."""

from __future__ import annotations

import hashlib
import importlib.util
import socket
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path
from typing import Any

from rope_twin.core.jit.wide import LANES
from rope_twin.errors import InputError, RopeTwinError, phrase
from rope_twin.scene.card import solver_version
from rope_twin.scene.schema import Scene
from rope_twin.scene.validation.rigging import refuse_joined
from rope_twin.studies.parameter_study.batch import Batch, Row, cut_into_batches, run_batch
from rope_twin.studies.parameter_study.design import design_runs, made_of
from rope_twin.studies.parameter_study.file import Study
from rope_twin.studies.parameter_study.folder import StudyFolder
from rope_twin.twin.ensemble.ensemble import cores, whole_steps

Report = Callable[[int, int], None]  # runs done, runs in all
CONNECT_S = 10
RETRIES = 2  # of a batch whose worker died


def study_stamp(study: Study, scene: Scene) -> str:
    """Return a digest of study, scene and solver, on which all rows depend."""
    told = repr((study.digest, scene.digest, solver_version(scene)))
    return hashlib.sha256(told.encode()).hexdigest()[:16]


def run_parameter_study(
    study: Study,
    scene: Scene,
    into: Path,
    report: Report,
    scheduler: str = "",
    at_once: int = LANES,
) -> tuple[list[Row], Path]:
    """Run all runs that have no row in the folder yet; return all rows, and their file.

    Args:
        study: what varies.
        scene: what it varies in.
        into: folder of the rows.
        report: called at the start and whenever a batch is done.
        scheduler: address of a Dask scheduler; empty: the cores of this machine.
        at_once: runs in a batch; LANES of them step in one core's vectors.

    Raises:
        RopeTwinError: one sentence; rows that were finished stay.
    """
    refuse_joined(scene)
    runs = [(run, made_of(study, scene, run)) for run in design_runs(study)]
    _check_times(study, {made.scene.time.step_s for _, made in runs})
    with StudyFolder(into, study, study_stamp(study, scene)) as folder:
        done = folder.done()
        report(len(done), len(runs))
        batches = cut_into_batches(
            study, [(run, made) for run, made in runs if run.number not in done], at_once
        )
        results = _on_cluster(batches, scheduler) if scheduler else _on_cores(batches)
        count = len(done)
        for rows in results:
            folder.add(rows)
            count += len(rows)
            report(count, len(runs))
        whole = folder.close_rows()
        return folder.rows(), whole


def _check_times(study: Study, steps_s: set[float]) -> None:
    for step_s in steps_s:
        whole_steps(f"{study.path}: seconds", study.seconds, step_s)
        whole_steps(f"{study.path}: look_s", study.look_s, step_s)
        if study.fatigue is not None:
            whole_steps(f"{study.path}: fatigue.sample_s", study.fatigue.sample_s, step_s)
            samples = study.seconds / study.fatigue.sample_s
            if abs(samples - round(samples)) > 1e-6:
                what = f"{study.seconds:g} s are no whole number of samples"
                right = f"give a part of {study.seconds:g} s"
                raise InputError(phrase(f"{study.path}: fatigue.sample_s", what, right))


def _on_cores(batches: Sequence[Batch]) -> Iterator[list[Row]]:
    """Run one batch per core; the first by itself, since it may have to compile."""
    if not batches:
        return
    yield run_batch(batches[0])
    with ThreadPoolExecutor(cores()) as pool:
        try:
            for future in as_completed([pool.submit(run_batch, one) for one in batches[1:]]):
                yield future.result()
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _on_cluster(batches: Sequence[Batch], address: str) -> Iterator[list[Row]]:
    """Run one batch per worker at a time; a batch of a failed worker goes to another one."""
    if importlib.util.find_spec("distributed") is None:
        right = "install it with `pip install 'rope_twin[study]'`"
        raise InputError(phrase("distributed", "--scheduler needs it", right))
    import distributed

    try:
        _knock(address)
        client = distributed.Client(address, timeout=CONNECT_S, set_as_default=False)
    except OSError as error:
        what = f"no Dask scheduler answers there within {CONNECT_S} s"
        right = "start one with `dask scheduler` and workers with `dask worker ADDRESS`"
        raise InputError(phrase(f"--scheduler {address}", what, right)) from error
    with client:
        if not client.scheduler_info()["workers"]:
            right = "start some with `dask worker ADDRESS --nthreads 1`"
            raise InputError(phrase(f"--scheduler {address}", "it has no workers", right))
        futures = client.map(run_batch, batches, pure=False, retries=RETRIES)
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
        place = get_address_host_port(address)
    except (ValueError, KeyError, NotImplementedError) as error:
        right = "give host and port as the scheduler tells them, like tcp://10.0.0.5:8786"
        raise InputError(phrase(f"--scheduler {address}", "it is no address", right)) from error
    socket.create_connection(place, CONNECT_S).close()


def _result(future: Any, address: str) -> list[Row]:
    try:
        rows: list[Row] = future.result()
    except RopeTwinError:
        raise
    except Exception as error:  # whatever went wrong on a worker, this process is to say it
        right = "see its log; the rows that are done stay"
        raise InputError(
            phrase(f"--scheduler {address}", f"a worker could not go on ({error!r})", right)
        ) from error
    return rows
