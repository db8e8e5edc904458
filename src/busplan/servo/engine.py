"""Choose the kernel: compiled when the package was built, or plain Python."""

from functools import cache
from importlib import import_module
from types import ModuleType
from typing import Literal

from busplan.errors import BusplanError

Engine = Literal["auto", "python", "compiled"]


def compiled_kernel(engine: Engine) -> ModuleType | None:
    """Find the compiled form of `busplan.servo.kernel`.

    Parameters
    ----------
    engine
        "auto" uses the compiled kernel where it is installed; "python" does not.

    Returns
    -------
    module or None
        It has the functions of `busplan.servo.kernel`, for arrays. None: use that file itself.

    Raises
    ------
    BusplanError
        "compiled" is requested, and this installation has no compiled kernel.

    Examples
    --------
    >>> compiled_kernel("python") is None
    True
    """
    kernel = None if engine == "python" else _compiled()
    if engine == "compiled" and kernel is None:
        raise BusplanError(
            "engine 'compiled': busplan was installed without a C compiler; install one and busplan again, "
            "or use 'python'"
        )
    return kernel


@cache
def _compiled() -> ModuleType | None:
    try:
        return import_module("busplan.servo._kernel")
    except ImportError:  # also if it was built for another Python
        return None
