"""In a copy of the repository: the folders that lie beside the package, and inside it once it is installed.

Python looks for ``granswim_pymunk.validation`` in the first folder that has a ``granswim_pymunk``. Where it is started
in a copy of the repository that is that one, even where the package is installed.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec
from importlib.util import spec_from_file_location
from types import ModuleType

FOLDERS = ("benchmarks", "scenarios", "validation")  # as in pyproject.toml


class Beside:
    """Finds them, asked when nobody else has."""

    def __init__(self, package: str, root: str) -> None:
        self.package, self.root = package, root

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Where such a folder is; None for everything else."""
        package, _, folder = name.rpartition(".")
        place = os.path.join(self.root, folder)
        start = os.path.join(place, "__init__.py")
        if package != self.package or folder not in FOLDERS or not os.path.isfile(start):
            return None
        return spec_from_file_location(name, start, submodule_search_locations=[place])


def find_beside(package: str, file: str) -> None:
    """Look beside ``package``, whose ``__init__.py`` is ``file``, where that lies in a copy of the repository."""
    root = os.path.dirname(os.path.dirname(os.path.abspath(file)))
    if os.path.isfile(os.path.join(root, "pyproject.toml")):
        sys.meta_path.append(Beside(package, root))
