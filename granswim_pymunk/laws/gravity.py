"""Gravity of the scene."""

from .base import law


@law(kind="body", expression="F_i = m_i g", reference="Galilei 1638; the vector is the scene's gravity")
def gravity(mass, gx, gy):
    return mass * gx, mass * gy
