"""Libraries that come with an extra: whether they are there is asked before any work."""

from importlib import import_module
from importlib.util import find_spec

from busplan.errors import BusplanError


def require_extra(library: str, *, option: str, module: str, extra: str | None = None) -> None:
    """Refuse to start without a library.

    Parameters
    ----------
    library
        Name of the library.
    option
        Option or method that asks for it, for messages.
    module
        Module of the library that is needed.
    extra
        The extra of busplan that it comes with; None for a library of its own.

    Raises
    ------
    BusplanError
        The library is not installed, or does not load.
    """
    if find_spec(library) is None:
        package = library if extra is None else f"'busplan[{extra}]'"
        way = "it" if extra is None else "it with the extra"
        raise BusplanError(f"{option} needs {library}: install {way}, as in pip install {package}")
    try:
        import_module(module)
    except Exception as error:  # noqa: BLE001 - a broken installation fails in many ways
        raise BusplanError(
            f"{option} needs {library}, and the installed one does not load ({type(error).__name__}: {error}); "
            f"install it again, as in pip install --force-reinstall {library}"
        ) from None


def require_resvg(option: str) -> None:
    """Refuse to start if no PNG can be made; as `require_extra`."""
    require_extra("resvg_py", extra="plot", option=option, module="resvg_py")


def require_pyarrow(option: str) -> None:
    """Refuse to start if no Parquet file can be written; as `require_extra`."""
    require_extra("pyarrow", extra="table", option=option, module="pyarrow.parquet")
