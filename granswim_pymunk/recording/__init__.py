"""Recordings: what was seen, the folder they live in, the importers, and the camera of a simulation."""

from .camera import film, rod_angle, see
from .folder import read_recording, write_recording
from .recording import Recording, Track
from .shipped import resolve_recording, shipped, shipped_names

__all__ = [
    "Recording", "Track", "film", "read_recording", "resolve_recording", "rod_angle", "see", "shipped",
    "shipped_names", "write_recording",
]  # fmt: skip
