"""Compile the kernels when the package is built; without a compiler, plain Python runs instead."""

import shutil
import tempfile
from pathlib import Path
from typing import Any

from Cython.Build import cythonize
from hatchling.builders.hooks.plugin.interface import BuildHookInterface
from setuptools import Distribution, Extension
from setuptools.command.build_ext import build_ext

_KERNELS = {"servo/_kernel": "servo/kernel.py", "buses/can/_response": "buses/can/response.py"}
"""Compiled module and its source, below the package."""
# Types stand in the .pxd beside each source.
_DIRECTIVES = {"annotation_typing": False, "boundscheck": False, "wraparound": False, "initializedcheck": False}


class CompileKernel(BuildHookInterface[Any]):
    """Build hook of hatchling."""

    PLUGIN_NAME = "custom"

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile into a wheel, or for an editable installation beside the sources."""
        self._work = Path(tempfile.mkdtemp())
        package = Path(self.root, "src", "busplan")
        self._compile()
        for name, source in _KERNELS.items():
            built = next(Path(self._work, "lib", "busplan").glob(f"{name}.*"), None)
            if version == "editable":
                # What an earlier installation compiled may be another kernel.
                for old in package.glob(f"{name}.*"):
                    if old.suffix != ".pxd":
                        old.unlink()
            if built is None:
                self.app.display_warning(
                    f"busplan: no C compiler, so {source} runs as plain Python, which takes longer"
                )
                continue
            if version == "editable":
                shutil.copy(built, package / Path(name).parent)
            else:
                build_data["force_include"][str(built)] = f"busplan/{Path(name).parent}/{built.name}"
            build_data["pure_python"], build_data["infer_tag"] = False, True

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:  # noqa: ARG002
        """Remove what the compiler left."""
        shutil.rmtree(self._work, ignore_errors=True)

    def _compile(self) -> None:
        """Compile the extensions into the folder of work, as far as that is possible here."""
        extensions = [
            Extension(
                f"busplan.{name.replace('/', '.')}",
                [str(Path(self.root, "src", "busplan", source))],
                # Fused operations would round otherwise than Python does.
                extra_compile_args=["-O2", "-g0", "-ffp-contract=off"],
            )
            for name, source in _KERNELS.items()
        ]
        generated = cythonize(
            extensions, build_dir=str(self._work / "c"), language_level=3, compiler_directives=_DIRECTIVES, quiet=True
        )
        for one in generated:
            one.optional = True
        command = build_ext(Distribution({"ext_modules": generated}))
        command.build_lib, command.build_temp = str(self._work / "lib"), str(self._work / "objects")
        command.ensure_finalized()
        command.run()
