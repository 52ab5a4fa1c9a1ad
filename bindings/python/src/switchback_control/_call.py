"""Calls into the library: objects and their lifetime, exceptions out of callbacks, Ctrl-C."""

from __future__ import annotations

import ctypes
import os
import re
import signal
import threading
import weakref
from collections import Counter
from typing import Any, Callable, ClassVar

from . import _ffi
from ._library import lib
from .errors import StateError, Undefined, from_status

try:
    # those of `signal` make members of enumerations of whatever they give back, which takes ten times as long as a short call
    from _signal import getsignal, signal as set_signal
except ImportError:  # not CPython
    from signal import getsignal, signal as set_signal

_PACKAGE = os.path.dirname(__file__) + os.sep

live: Counter[str] = Counter()  # objects of the library by kind, for tests
_live_lock = threading.RLock()


class Frame:
    """What the callbacks of one running call have to say to it."""

    # of the class, until a callback says something: to make an object without a constructor is cheap
    error: BaseException | None = None
    undefined: Undefined | None = None
    stop = False


class _Frames(threading.local):
    """Running calls of this thread, the innermost last: callbacks run on the thread of the call."""

    def __init__(self) -> None:
        self.stack: list[Frame] = []


_frames = _Frames()


def frame() -> Frame:
    return _frames.stack[-1] if _frames.stack else Frame()


def failed(error: BaseException) -> int:
    """What a callback returns because of an exception, which is kept for the end of the call."""
    current = frame()
    if isinstance(error, Undefined):
        current.undefined = error
        return 1
    if current.error is None:
        current.error = error
    return -1


_SIGINT = int(signal.SIGINT)


class Interrupts:
    """While a call runs, the first Ctrl-C asks it to stop; the handler of before hears of it at the end.

    A second Ctrl-C goes to that handler at once, so that a callback that hangs can be left; but not while Python
    is in this package, because an exception at the very start of a callback would be lost in ctypes.
    """

    def __init__(self, current: Frame):
        self.current = current
        self.previous: Any = None
        self.pending: tuple[int, Any] | None = None

    def _handle(self, number: int, where: Any) -> None:
        if self.pending is None:
            self.pending = (number, where)
            self.current.stop = True
        elif where is None or not where.f_code.co_filename.startswith(_PACKAGE):
            self.previous(number, where)

    def __enter__(self) -> Interrupts:
        if threading.get_ident() == threading.main_thread().ident:
            handler = getsignal(_SIGINT)
            if callable(handler):
                self.previous = handler
                set_signal(_SIGINT, self._handle)
        return self

    def __exit__(self, kind: Any, error: Any, trace: Any) -> None:
        if self.previous is not None:
            set_signal(_SIGINT, self.previous)
            if self.pending is not None and error is None:
                self.previous(*self.pending)


_C_NAMES = re.compile(r"\b(enum )?swb_([a-z0-9_]+)\b")


_KINDS = re.findall(r"\bswb_(\w+)_free\b", " ".join(_ffi.FUNCTIONS))


def _python_name(found: re.Match[str]) -> str:
    """What a name of the C interface is called here: a method without the object, an enumeration as a class."""
    name = found[2]
    kind = "".join(part.capitalize() for part in name.split("_"))
    if hasattr(_ffi, kind):
        return kind
    for prefix in sorted(_KINDS, key=len, reverse=True):
        if name.startswith(prefix + "_"):
            method = name[len(prefix) + 1 :]
            return f"{prefix.capitalize()}.{method}" if method.startswith("from_") else method
    return found[0]


def check(status: int, cause: BaseException | None = None) -> None:
    """Raise the exception of a status code with the message of the library."""
    if status != 0:
        message = _C_NAMES.sub(_python_name, lib.swb_last_error().decode("utf-8", "replace"))
        code = lib.swb_last_user_code()
        lib.swb_error_handled()  # the exception says it
        raise from_status(status, message, code) from cause


def _framed(stack: list[Frame], current: Frame, function: Callable[..., int], converted: list[Any]) -> int:
    stack.append(current)
    try:
        return function(*converted)
    finally:
        stack.remove(current)


def call(function: Callable[..., int], *arguments: Any, interruptible: bool = False) -> None:
    """Call the library; objects among the arguments are kept alive and stand for their handles.

    An exception that a callback left behind is raised again; else a status that is not OK becomes one.
    """
    held: list[Handle] = []
    current = Frame()
    stack = _frames.stack
    try:
        converted = []
        for a in arguments:
            if isinstance(a, Handle):
                a._hold()
                held.append(a)
                a = a._handle
            converted.append(a)
        if interruptible:
            with Interrupts(current):
                status = _framed(stack, current, function, converted)
        else:
            status = _framed(stack, current, function, converted)
    finally:
        for h in held:
            h._release()
    if current.error is not None:
        error, current.error = current.error, None
        try:
            raise error
        finally:
            del error
    check(status, current.undefined)


def aside(work: Callable[[], None], stop: Callable[[], object]) -> None:
    """Do work that calls no Python function on its way, such as a batch: on a thread of its own, for Python handles
    Ctrl-C on the main thread, between two of its own instructions. Then `stop` is called, and what the handler raised
    is raised when the work has ended."""
    if threading.current_thread() is not threading.main_thread():
        work()
        return
    raised: list[BaseException] = []
    done = threading.Event()

    def run() -> None:
        try:
            work()
        except BaseException as error:
            raised.append(error)
        finally:
            done.set()

    interrupt: BaseException | None = None
    thread = threading.Thread(target=run, daemon=True)
    while not done.is_set():
        try:
            if thread.ident is None:
                thread.start()
            done.wait(1.0)  # a wait without an end is deaf on Windows
        except BaseException as error:
            interrupt = interrupt or error
            stop()
    if interrupt is not None:
        raise interrupt
    if raised:
        raise raised[0]


def _free(kind: str, handle: int) -> None:
    getattr(lib, f"swb_{kind}_free")(handle)
    with _live_lock:
        live[kind] -= 1


class Handle:
    """An object of the library. It is freed by `close`, at the end of a `with` block, or when it is not used
    any more."""

    _kind: ClassVar[str]
    _handle: int
    _finalizer: weakref.finalize | None = None
    # until an object is made, which has its own
    _lock: Any = threading.RLock()

    def _create(self, *arguments: Any) -> None:
        self._make(getattr(lib, f"swb_{self._kind}_create"), *arguments)

    def _make(self, constructor: Callable[..., int], *arguments: Any) -> None:
        """Take what a constructor hands out as its last argument."""
        self._lock = threading.RLock()
        self._uses = 0
        handle = ctypes.c_void_p()
        call(constructor, *arguments, ctypes.byref(handle))
        self._own(handle.value)

    def _own(self, handle: int | None) -> None:
        assert handle is not None
        self._handle = handle
        with _live_lock:
            live[self._kind] += 1
        self._finalizer = weakref.finalize(self, _free, self._kind, handle)

    def _check_open(self) -> None:
        """With the lock held: there is an object behind this."""
        finalizer = self._finalizer
        if finalizer is None:
            raise StateError(f"{type(self).__name__} was not created: its constructor did not finish")
        if not finalizer.alive:
            raise StateError(f"{type(self).__name__} is closed")

    def _hold(self) -> None:
        with self._lock:
            self._check_open()
            self._uses += 1

    def _release(self) -> None:
        with self._lock:
            self._uses -= 1

    @property
    def closed(self) -> bool:
        """Was it closed?"""
        return self._finalizer is None or not self._finalizer.alive

    def close(self) -> None:
        """Free it; a second time does nothing."""
        if self._finalizer is None:
            return
        with self._lock:
            if self._uses:
                raise StateError(f"{type(self).__name__} is in use and cannot be closed")
            self._finalizer()

    def __enter__(self) -> Any:
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()

    def __reduce__(self) -> Any:
        raise TypeError(f"{type(self).__name__} cannot be pickled or copied")

    def _do(self, name: str, *arguments: Any, interruptible: bool = False) -> None:
        call(getattr(lib, f"swb_{self._kind}_{name}"), self, *arguments, interruptible=interruptible)

    def _read(self, function: Callable[..., int], *arguments: Any) -> None:
        """Call what only copies something out. It calls nobody back and ends at once, so it leaves nothing behind and there is nothing
        to stop; the lock is held meanwhile, so that nobody frees the object."""
        with self._lock:
            self._check_open()
            status = function(self._handle, *arguments)
        if status:
            check(status)

    def _get(self, name: str, kind: Any) -> Any:
        out = kind()
        self._do(name, ctypes.byref(out))
        return out.value

    def _struct(self, name: str, kind: Any) -> Any:
        out = kind()
        self._do(name, ctypes.byref(out), ctypes.sizeof(out))
        return out


def text(function: Callable[..., int], *arguments: Any) -> str:
    """A text from a function that fills a buffer."""
    needed = ctypes.c_int64()
    call(function, *arguments, None, 0, ctypes.byref(needed))
    buffer = ctypes.create_string_buffer(needed.value)
    call(function, *arguments, buffer, needed.value, None)
    return buffer.value.decode("utf-8")


def encode(value: Any, what: str) -> bytes:
    """A text for the library."""
    from .errors import ArgumentError

    if not isinstance(value, str):
        raise ArgumentError(f"{what} must be a text, not {type(value).__name__}")
    if "\0" in value:
        raise ArgumentError(f"{what} contains a NUL character")
    try:
        return value.encode("utf-8")
    except UnicodeEncodeError:
        raise ArgumentError(f"{what} is no valid text") from None


NO_ITERATION = _ffi.swb_iteration_fn(0)
NO_LOG = _ffi.swb_log_fn(0)
