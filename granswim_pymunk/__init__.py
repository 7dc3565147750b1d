"""Grains and swimmers on pymunk: script a scene, watch it, hold it against a recording.

SI at every public edge (m, kg, s, rad, N); y points up, angles are counter-clockwise.
"""

__version__ = "0.1.0"
