"""Whole tracks of bodies, in one piece or in segments between impacts, held against simulations.

``model`` answers the pipeline. How a recording is followed: ``segments``, ``follow``, ``bearing``, ``steps``. How
numbers are found: ``fit`` and ``solve``, a result is a ``fitted.Fit``, with ``believed`` masses and radii. Which law is
missing: ``study`` has the order, ``signatures``, ``name`` (one law), ``nulls``, ``choose``, ``pairs`` (several, from a
``sets.SetSearch``), ``whom``, ``settle``, ``closer``. What it is worth: ``blocks``, ``forms``, ``held_out``,
``intervals``, ``score_test``, ``kicks``, ``innovations`` (where), ``experiment``, ``verdict``.
"""

from .model import TrackFinding, diagnose_tracks

__all__ = ["TrackFinding", "diagnose_tracks"]
