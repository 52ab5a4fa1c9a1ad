"""Where the lines of the log go: to `on_log`, to the terminal with `verbose`, or to Python's logging."""

from __future__ import annotations

import logging
from typing import Any

from .errors import ArgumentError
from .results import OnIteration, OnLog, print_iteration

__all__ = ["log_to_python", "monitors", "take_verbose"]

logger = logging.getLogger("switchback")
_LEVELS = {"error": logging.ERROR, "warning": logging.WARNING, "info": logging.INFO, "debug": logging.DEBUG, "trace": 5}


def log_to_python(level: str, line: str) -> None:
    """Hand a line of the log to the logger "switchback" of Python; what `on_log` is by default."""
    logger.log(_LEVELS.get(level, logging.INFO), line)


def _print(_: str, line: str) -> None:
    print(line, flush=True)


def take_verbose(options: dict[str, Any]) -> bool:
    """Take `verbose` out of options: is the work to be shown? Then the log is as detailed as "info", unless they say otherwise."""
    verbose = options.pop("verbose", False)
    if not isinstance(verbose, (bool, int)):
        raise ArgumentError(f"verbose must be True or False, not {verbose!r:.40}; log_level says how much")
    if verbose:
        options.setdefault("log_level", "info")
    return bool(verbose)


def monitors(chosen: Any, verbose: bool, on_log: OnLog | None, on_iteration: OnIteration | None = None) -> tuple[Any, Any]:
    """Who hears of the log and of the iterations of work with settings `chosen`: what was given, else the terminal if `verbose`,
    else the logger "switchback", whose level counts where the option log_level was not set."""
    if verbose:
        return on_log or _print, on_iteration or print_iteration
    silent = chosen._c.log_level == 0
    if on_log is None and silent and logger.level != logging.NOTSET:
        chosen.log_level = next((name for name, level in reversed(_LEVELS.items()) if logger.isEnabledFor(level)), "silent")
        silent = chosen._c.log_level == 0
    return on_log or (None if silent else log_to_python), on_iteration
