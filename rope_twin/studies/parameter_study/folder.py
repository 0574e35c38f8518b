"""Rows of a study on disk, so that an interrupted study can be resumed.

Every finished batch is a Parquet file of its own, written under a temporary name and renamed: a
file is complete or absent. At the end they become one, runs.parquet, sorted by run.
"""

from __future__ import annotations

import fcntl
import importlib.util
import json
from collections.abc import Sequence
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, Self

from rope_twin.errors import InputError, phrase
from rope_twin.studies.parameter_study.batch import Row
from rope_twin.studies.parameter_study.file import Study
from rope_twin.whole_file import write_whole

if TYPE_CHECKING:
    import pyarrow

WHOLE, MARK, LOCK = "runs.parquet", "study.json", "lock"
_NUMBERS = ("run", "steps", "unconverged_substeps", "elements")
_WORDS = ("card_error_words", "failure")
_LISTS = ("damage", "damage_from_lower_end_m")


def check_parquet() -> None:
    """Check that Parquet files can be written.

    Raises:
        InputError: pyarrow is not installed.
    """
    if importlib.util.find_spec("pyarrow") is None:
        right = "install it with `pip install 'rope_twin[study]'`"
        raise InputError(phrase("pyarrow", "a study writes its rows with it", right))


class StudyFolder:
    """The folder of one study; held by one process at a time.

    Raises:
        InputError: another process is at it, it holds another study, or it cannot be written.
    """

    def __init__(self, folder: Path, study: Study, stamp: str) -> None:
        """Open the folder; `stamp` identifies study, scene and solver of the rows found there."""
        check_parquet()
        self._folder, self._study = folder, study
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._lock: IO[str] = (folder / LOCK).open("w")
        except OSError as error:
            what = f"it cannot be written ({error.strerror})"
            raise InputError(phrase(str(folder), what, "choose another one with --out")) from error
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            self._lock.close()
            what = "another process is at this study"
            raise InputError(phrase(str(folder), what, "let it end, or stop it")) from error
        self._claim(stamp)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *failure: object) -> None:
        self._lock.close()

    def _claim(self, stamp: str) -> None:
        mark = self._folder / MARK
        if mark.exists():
            found = json.loads(mark.read_text(encoding="utf-8"))
            if found["stamp"] != stamp:
                self._lock.close()
                what = f"its rows are of another study, scene or solver ('{found['study']}')"
                right = "give another folder with --out, or remove this one"
                raise InputError(phrase(str(self._folder), what, right))
            return
        told = {"study": self._study.name, "scene": self._study.scene, "stamp": stamp}
        write_whole(mark, json.dumps(told, ensure_ascii=False).encode())

    def done(self) -> set[int]:
        """Return the numbers of the runs with rows in the folder."""
        return {int(row["run"]) for row in self.rows(["run"])}

    def add(self, rows: Sequence[Row]) -> None:
        """Keep the rows of a batch."""
        first = min(row["run"] for row in rows)
        self._write(self._folder / f"part-{first:06d}-{len(rows)}.parquet", rows)

    def rows(self, columns: list[str] | None = None) -> list[Row]:
        """Return all rows in the folder, by run; each once."""
        import pyarrow.parquet as parquet

        found: dict[int, Row] = {}
        for path in self._files():
            for row in parquet.read_table(path, columns=columns).to_pylist():
                found[int(row["run"])] = row
        return [found[number] for number in sorted(found)]

    def close_rows(self) -> Path:
        """Make one file of all rows; the path of it."""
        parts = [path for path in self._files() if path.name != WHOLE]
        whole = self._folder / WHOLE
        if parts:
            self._write(whole, self.rows())
        for path in parts:
            path.unlink()
        return whole

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

        words = {one.column for one in self._study.vary if one.names or one.cases}

        def kind(name: str) -> Any:
            if name in _NUMBERS:
                return pyarrow.int64()
            if name in _WORDS or name in words:
                return pyarrow.string()
            return pyarrow.list_(pyarrow.float64()) if name in _LISTS else pyarrow.float64()

        return pyarrow.schema([(name, kind(name)) for name in row])
