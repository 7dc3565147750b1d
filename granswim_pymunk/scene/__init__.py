"""A scene: bodies, box and a list of laws with parameters. Built, read, printed, hashed.

SI throughout (m, kg, s, rad, N); y points up, angles are counter-clockwise.
"""

from ..walls import Wall
from .model import Scene
from .parts import ROLES, Adjustable, Bed, Body, LawUse, SceneWarning, Time, use
from .reading import read_inputs, read_scene, read_toml, scene_from_dict, swimmer, write_scene

__all__ = [
    "ROLES", "Adjustable", "Bed", "Body", "LawUse", "Scene", "SceneWarning", "Time", "Wall", "read_inputs",
    "read_scene", "read_toml", "scene_from_dict", "swimmer", "use", "write_scene",
]  # fmt: skip
