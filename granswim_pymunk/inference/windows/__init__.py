"""Missing physics of a swimmer and its grains, both seen: short windows started from estimated states.

``model`` answers the pipeline, ``driver`` has the steps. What is compared: ``windows``, ``starts``, ``sums``, ``cut``,
``hidden``, ``radii``, ``stamps``. Against what: ``likelihood``, with replicates in ``signatures`` and ``chance``. Which
law is missing: ``candidates``, ``search``, ``trial``, ``polish``. What it is worth: ``weigh``, ``judge``, ``places``,
``experiment``, ``verdict``. What it may cost: ``plan``, ``work``.
"""

from .model import diagnose_bed

__all__ = ["diagnose_bed"]
