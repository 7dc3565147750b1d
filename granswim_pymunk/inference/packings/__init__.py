"""A bed that is not seen: statistics of the swimmer's motion, and curves of its speed, against their spread.

``model`` answers the pipeline. What is compared: ``summaries``, of ``runs`` in other packings; ``response`` predicts
and fits. Which law is missing: ``state`` is what the search knows, ``recalibrate``, ``candidates``, ``amounts``,
``screening``, ``refitting``, ``conclude``. What it is worth: ``local``, ``checks``, ``verdict``.
"""

from .model import diagnose_unseen

__all__ = ["diagnose_unseen"]
