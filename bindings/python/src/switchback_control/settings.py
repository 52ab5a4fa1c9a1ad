"""Settings of discretisation and solver."""

from __future__ import annotations

import ctypes
import numbers
from dataclasses import dataclass
from typing import Any, ClassVar, Iterator, Mapping, Union

from . import _ffi
from ._call import call, encode, text
from ._library import lib
from .errors import ArgumentError

__all__ = ["Option", "Settings", "options"]

Value = Union[int, float, str]


@dataclass(frozen=True)
class Option:
    """One option of the library."""

    name: str
    kind: str
    doc: str
    symbol: str
    default: Value
    min: float
    max: float
    min_open: bool
    max_open: bool
    values: tuple[str, ...]
    setup_only: bool


def _option(i: int) -> Option:
    kind, setup_only = ctypes.c_int32(), ctypes.c_int32()
    low, high, default = ctypes.c_double(), ctypes.c_double(), ctypes.c_double()
    low_open, high_open = ctypes.c_int32(), ctypes.c_int32()
    ref = ctypes.byref
    call(lib.swb_option_kind, i, ref(kind))
    call(lib.swb_option_range, i, ref(low), ref(high), ref(low_open), ref(high_open))
    call(lib.swb_option_default, i, ref(default))
    call(lib.swb_option_setup_only, i, ref(setup_only))
    values: list[str] = []
    if kind.value == _ffi.Kind.ENUM:
        while (name := lib.swb_option_value_name(i, len(values))) is not None:
            values.append(name.decode())
    start: Value = default.value
    if kind.value == _ffi.Kind.ENUM:
        start = values[int(default.value)]
    elif kind.value == _ffi.Kind.INT:
        start = int(default.value)
    return Option(
        lib.swb_option_name(i).decode(),
        _ffi.Kind(kind.value).name.lower(),
        lib.swb_option_doc(i).decode(),
        lib.swb_option_symbol(i).decode(),
        start,
        low.value,
        high.value,
        bool(low_open.value),
        bool(high_open.value),
        tuple(values),
        bool(setup_only.value),
    )


def options() -> dict[str, Option]:
    """All options of the library, by name."""
    found = [_option(i) for i in range(lib.swb_option_count())]
    return {o.name: o for o in found}


def set_option(prefix: str, target: Any, name: str, value: Any) -> None:
    """Set an option of settings or of an object, by the function for the type of the value."""
    key = encode(name, "the name of an option")
    if isinstance(value, str):
        call(getattr(lib, f"{prefix}_set_string"), target, key, encode(value, f"option '{name}'"))
    elif isinstance(value, numbers.Integral):  # bool too
        n = int(value)
        if -(2**63) <= n < 2**63:
            call(getattr(lib, f"{prefix}_set_int"), target, key, n)
        else:
            call(getattr(lib, f"{prefix}_set_double"), target, key, float(n) if abs(n) < 2**1000 else float("inf"))
    elif isinstance(value, numbers.Real):
        call(getattr(lib, f"{prefix}_set_double"), target, key, float(value))
    else:
        call(lib.swb_option_find, key, ctypes.byref(ctypes.c_int64()))  # an unknown name is the worse mistake
        raise ArgumentError(f"option '{name}' must be a number or a text, not {value!r:.60}")


class Settings:
    """Settings: `Settings(n_s=3, cross="stage")`; attributes read and write, enumerations as text."""

    __slots__ = ("_c",)
    _c: _ffi.swb_settings

    def __init__(self, **values: Any):
        c = _ffi.swb_settings()
        call(lib.swb_settings_init, ctypes.byref(c), ctypes.sizeof(c))
        object.__setattr__(self, "_c", c)
        self.update(**values)

    @classmethod
    def _from(cls, settings: Any, values: Mapping[str, Any]) -> Settings:
        """A copy of what a constructor was given, with options by keyword on top."""
        if settings is None:
            return cls(**values)
        if isinstance(settings, Settings):
            copy = settings.copy()
        elif isinstance(settings, Mapping):
            copy = cls(**settings)
        else:
            raise ArgumentError(f"settings must be Settings or a dictionary, not {type(settings).__name__}")
        copy.update(**values)
        return copy

    def update(self, **values: Any) -> None:
        """Set several options."""
        for name, value in values.items():
            set_option("swb_settings", ctypes.byref(self._c), name, value)

    def __setattr__(self, name: str, value: Any) -> None:
        self.update(**{name: value})

    def __getattr__(self, name: str) -> Value:
        if name.startswith("__"):
            raise AttributeError(name)
        try:
            return self[name]
        except ArgumentError as error:
            raise AttributeError(str(error)) from None

    def __getitem__(self, name: str) -> Value:
        i = ctypes.c_int64()
        key = encode(name, "the name of an option")
        call(lib.swb_option_find, key, ctypes.byref(i))
        kind = ctypes.c_int32()
        call(lib.swb_option_kind, i.value, ctypes.byref(kind))
        if kind.value == _ffi.Kind.ENUM:
            return text(lib.swb_settings_get_string, ctypes.byref(self._c), key)
        out: Any = ctypes.c_int64() if kind.value == _ffi.Kind.INT else ctypes.c_double()
        read = lib.swb_settings_get_int if kind.value == _ffi.Kind.INT else lib.swb_settings_get_double
        call(read, ctypes.byref(self._c), key, ctypes.byref(out))
        return out.value

    def __setitem__(self, name: str, value: Any) -> None:
        self.update(**{name: value})

    def __iter__(self) -> Iterator[str]:
        return (lib.swb_option_name(i).decode() for i in range(lib.swb_option_count()))

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self]

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Settings) and self.to_dict() == other.to_dict()

    __hash__ = None  # type: ignore[assignment]

    def to_dict(self) -> dict[str, Value]:
        """All options by name."""
        return {name: self[name] for name in self}

    def to_json(self) -> str:
        """All options as JSON."""
        return text(lib.swb_settings_to_json, ctypes.byref(self._c))

    def validate(self) -> None:
        """Check all options together."""
        call(lib.swb_settings_validate, ctypes.byref(self._c))

    def copy(self) -> Settings:
        """A copy."""
        other = Settings()
        ctypes.pointer(other._c)[0] = self._c
        return other

    __copy__ = copy

    def __deepcopy__(self, _: Any) -> Settings:
        return self.copy()

    def __reduce__(self) -> Any:
        return (_unpickle, (self.to_dict(),))

    def __repr__(self) -> str:
        default = Settings()
        changed = ", ".join(f"{n}={self[n]!r}" for n in self if self[n] != default[n])
        return f"Settings({changed})"


def _unpickle(values: dict[str, Value]) -> Settings:
    return Settings(**values)


class HasSettings:
    """Common part of objects with options of their own."""

    _kind: ClassVar[str]

    def set(self, **values: Any) -> None:
        """Set options: `set(n_s=3, cross="stage")`."""
        for name, value in values.items():
            set_option(f"swb_{self._kind}", self, name, value)

    @property
    def settings(self) -> Settings:
        """A copy of the options; assign to set them all."""
        out = Settings()
        call(
            getattr(lib, f"swb_{self._kind}_get_settings"),
            self,
            ctypes.byref(out._c),
            ctypes.sizeof(out._c),
        )
        return out

    @settings.setter
    def settings(self, value: Settings | Mapping[str, Any] | None) -> None:
        new = Settings._from(value, {})
        call(getattr(lib, f"swb_{self._kind}_set_settings"), self, ctypes.byref(new._c))
