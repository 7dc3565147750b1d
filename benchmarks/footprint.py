"""``python -m granswim_pymunk.benchmarks.footprint ENGINE GRAINS``: megabytes a bed adds to this process.

Linux only: the peak of the resident memory less what Python, the libraries and the compiled code take,
which a small bed brings in first.
"""

from __future__ import annotations

import gc
import sys
from pathlib import Path

from .beds import bed
from .lammps_bed import find_lammps
from .speed import build


def resident(field: str) -> float:
    """A field of /proc/self/status [MB]."""
    for line in Path("/proc/self/status").read_text(encoding="ascii").splitlines():
        if line.startswith(f"{field}:"):
            return int(line.split()[1]) / 1024
    raise RuntimeError(f"/proc/self/status has no {field}")


def main(engine: str, grains: int) -> float:
    if engine == "lammps":
        find_lammps()  # loads MPI
    steps = 2 if engine == "python" else 200
    build(engine, bed(100)).advance(steps)
    gc.collect()
    before = resident("VmRSS")
    it = build(engine, bed(grains))
    it.advance(steps)
    return resident("VmHWM") - before


if __name__ == "__main__":
    print(main(sys.argv[1], int(sys.argv[2])))
