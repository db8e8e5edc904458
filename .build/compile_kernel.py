"""Compile the kernel of the simulation when the package is built; without a compiler, plain Python runs instead."""

import shutil
import tempfile
from pathlib import Path
from typing import Any

from Cython.Build import cythonize
from hatchling.builders.hooks.plugin.interface import BuildHookInterface
from setuptools import Distribution, Extension
from setuptools.command.build_ext import build_ext

_MODULE = "busplan.servo._kernel"
_SOURCE = "src/busplan/servo/kernel.py"
_DIRECTIVES = {"boundscheck": False, "wraparound": False, "initializedcheck": False}


class CompileKernel(BuildHookInterface[Any]):
    """Build hook of hatchling."""

    PLUGIN_NAME = "custom"

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile into a wheel, or for an editable installation beside the source."""
        self._work = Path(tempfile.mkdtemp())
        folder = Path(self.root, _SOURCE).parent
        built = self._compiled()
        if version == "editable":
            # What an earlier installation compiled may be another kernel.
            for old in folder.glob("_kernel.*"):
                if old.suffix != ".pxd":
                    old.unlink()
        if built is None:
            self.app.display_warning("busplan: no C compiler, so circle tests run in plain Python, which takes longer")
        elif version == "editable":
            shutil.copy(built, folder)
        else:
            build_data["force_include"][str(built)] = f"busplan/servo/{built.name}"
        if built is not None:
            build_data["pure_python"], build_data["infer_tag"] = False, True

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:  # noqa: ARG002
        """Remove what the compiler left."""
        shutil.rmtree(self._work, ignore_errors=True)

    def _compiled(self) -> Path | None:
        """Compile the extension; None if that is not possible here."""
        extension = Extension(
            _MODULE,
            [str(Path(self.root, _SOURCE))],
            # Fused operations would round otherwise than Python does.
            extra_compile_args=["-O2", "-g0", "-ffp-contract=off"],
        )
        generated = cythonize(
            [extension], build_dir=str(self._work / "c"), language_level=3, compiler_directives=_DIRECTIVES, quiet=True
        )
        for one in generated:
            one.optional = True
        command = build_ext(Distribution({"ext_modules": generated}))
        command.build_lib, command.build_temp = str(self._work / "lib"), str(self._work / "objects")
        command.ensure_finalized()
        command.run()
        return next(Path(command.build_lib).rglob("_kernel.*"), None)
