"""Compile functions with numba, if it is available."""

from collections.abc import Callable
from functools import cache
from importlib.util import find_spec
from typing import Any, Literal

from busplan.errors import BusplanError

Engine = Literal["auto", "python", "numba"]


def is_compiled(engine: Engine) -> bool:
    """Whether an engine runs compiled code.

    Parameters
    ----------
    engine
        "auto" uses numba if it is installed.

    Returns
    -------
    bool
        True for numba.

    Raises
    ------
    BusplanError
        "numba" is requested and not installed.

    Examples
    --------
    >>> is_compiled("python")
    False
    """
    installed = find_spec("numba") is not None
    if engine == "numba" and not installed:
        raise BusplanError("engine 'numba': numba is not installed; install busplan[fast] or use 'python'")
    return installed and engine != "python"


@cache
def compiled(function: Callable[..., Any], signature: str) -> Callable[..., Any] | None:
    """Compile a function with numba; the machine code is cached on disk.

    Parameters
    ----------
    function
        A module-level function that numba can compile.
    signature
        Its numba signature, so that all errors of compilation occur here.

    Returns
    -------
    callable or None
        The compiled function; None if numba does not work, or no cache can be read or written: compiling at each start
        would take as long as a circle in plain Python.

    Examples
    --------
    >>> double = compiled(lambda x: 2 * x, "float64(float64)")  # no file, so no cache
    >>> double is None
    True
    """
    try:
        import numba  # noqa: PLC0415 - an optional extra that takes a fifth of a second to load
    except Exception:  # noqa: BLE001 - a broken installation fails in many ways, and numba is optional
        return None
    try:
        return numba.njit(signature, cache=True)(function)
    except Exception:  # noqa: BLE001 - unpickling a damaged cache may raise anything
        return None
