"""What a sweep has found so far, in an SQLite file: a sweep that was cut off goes on from there."""

from __future__ import annotations

import json
import os
import sqlite3
from collections.abc import Iterable
from typing import Any

from .errors import ArgumentError

__all__ = ["SweepStore"]

Point = dict[str, Any]


def key_of(point: Point) -> str:
    """A point as a text that is the same for equal points."""
    return json.dumps(point, sort_keys=True)


class SweepStore:
    """Results of points by themselves; in memory without a path. One process writes, and every write is complete or not there."""

    def __init__(self, path: str | os.PathLike | None, fingerprint: str):
        self.path = path
        try:
            self._file = sqlite3.connect(":memory:" if path is None else os.fspath(path))
            self._file.execute("CREATE TABLE IF NOT EXISTS sweep (key TEXT PRIMARY KEY, value TEXT)")
            self._file.execute("CREATE TABLE IF NOT EXISTS results (point TEXT PRIMARY KEY, result TEXT)")
            known = self._file.execute("SELECT value FROM sweep WHERE key = 'problem'").fetchone()
            if known is None:
                with self._file:
                    self._file.execute("INSERT INTO sweep VALUES ('problem', ?)", (fingerprint,))
        except sqlite3.DatabaseError as error:
            raise ArgumentError(f"'{path}' is no store of a sweep: {error}") from None
        if known is not None and known[0] != fingerprint:
            self.close()
            raise ArgumentError(f"'{path}' holds results of another problem: give another file, or delete it")

    def add(self, found: Iterable[tuple[Point, dict[str, Any]]]) -> None:
        """Keep results of points."""
        with self._file:
            rows = [(key_of(point), json.dumps(result)) for point, result in found]
            self._file.executemany("INSERT OR REPLACE INTO results VALUES (?, ?)", rows)

    def known(self) -> dict[str, dict[str, Any]]:
        """All results by the keys of their points."""
        return {key: json.loads(result) for key, result in self._file.execute("SELECT point, result FROM results")}

    def close(self) -> None:
        """Close the file."""
        self._file.close()
