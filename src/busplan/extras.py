"""Libraries of optional extras. They are asked for before any work."""

from importlib import import_module
from importlib.util import find_spec

from busplan.errors import BusplanError


def require_extra(library: str, *, option: str, module: str, extra: str | None = None) -> None:
    """Raise BusplanError if a library is not installed, or does not load.

    `option` is the option or method that needs it, for the message; `module` is the one to import; `extra` is the extra
    of busplan with the library, None for a library of its own.
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
    """Raise BusplanError if no PNG can be made."""
    require_extra("resvg_py", extra="plot", option=option, module="resvg_py")


def require_pyarrow(option: str) -> None:
    """Raise BusplanError if no Parquet file can be written."""
    require_extra("pyarrow", extra="table", option=option, module="pyarrow.parquet")
