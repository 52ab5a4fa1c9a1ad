"""Documents in JSON: what their readers have in common."""

from __future__ import annotations

import ctypes
import json
from typing import Any, Iterable

from ._call import encode
from .errors import ArgumentError
from .function import Function


class Reader:
    """A text and the functions it names, as arguments of the library."""

    def __init__(self, document: Any, functions: Iterable[Function]):
        self.functions = list(functions)
        for f in self.functions:
            if not isinstance(f, Function):
                raise ArgumentError(f"functions must hold objects of Function, not {type(f).__name__}")
            f._hold()
            f._release()
        self._text = encode(document, "document")
        handles = (ctypes.c_void_p * len(self.functions))(*(f._handle for f in self.functions))
        self.arguments = (self._text, handles if self.functions else None, len(self.functions))

    def data(self) -> dict[str, Any]:
        """Content of a document; nothing if it is none, which the library says better."""
        try:
            found = json.loads(self._text)
        except (ValueError, RecursionError):
            return {}
        return found if isinstance(found, dict) else {}
