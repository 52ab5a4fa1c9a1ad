"""How far long work is."""

from __future__ import annotations

import sys
from typing import Any

__all__ = ["Progress"]


class Progress:
    """Says how far work is that has `total` parts, `done` of them already: to a function of (done, total), by tqdm where it is
    installed, else in lines; not at all where `wanted` is false."""

    def __init__(self, wanted: Any, done: int, total: int, what: str):
        self._call, self._bar, self._total, self._done, self._said, self._what = None, None, total, done, -1, what
        if callable(wanted):
            self._call = wanted
        elif wanted:
            try:
                from tqdm.auto import tqdm
            except ImportError:
                self._call = self._line
            else:
                self._bar = tqdm(total=total, initial=done, unit=what)

    def _line(self, done: int, total: int) -> None:
        tenth = 10 * done // max(total, 1)
        if tenth > self._said:
            self._said = tenth
            print(f"{done} of {total} {self._what}", file=sys.stderr, flush=True)

    def add(self, n: int = 1) -> None:
        """So many parts more are done."""
        self._done += n
        if self._bar is not None:
            self._bar.update(n)
        if self._call is not None:
            self._call(self._done, self._total)

    def close(self) -> None:
        """The work has ended."""
        if self._bar is not None:
            self._bar.close()
