"""A surface, or a track, whose slope is not the same everywhere."""

from .base import Parameter, law


@law(
    kind="body",
    expression="F_i = -m_i g K (r_i - r_0), K the curvature in all directions, along x alone or along y alone",
    reference="Goldstein 1980, Classical Mechanics, ch. 6 (small slopes: the potential m g h(r) to second order)",
    parameters=[
        Parameter(
            "curvature", "1/m", "curvature of the surface: above 0 a bowl, below 0 a dome", typical=0.01, within="lean"
        ),
        Parameter(
            "bent",
            "1",
            "directions that it is bent along: 0 all, 1 along x, 2 along y",
            default=0.0,
            choices=(0, 1, 2),
            always=True,
        ),
        Parameter("centre", "m", "where its slope is that of the scene", size=2, default=(0.0, 0.0)),
    ],
    strength=("curvature",),
    candidate="beside",
    phrase="a surface that is curved",
    role="surface",
)
def curved_surface(x, y, mass, g, curvature, bent, centre_x, centre_y):
    weight = mass * g * curvature
    along_x = 0.0 if bent == 2 else -weight * (x - centre_x)
    along_y = 0.0 if bent == 1 else -weight * (y - centre_y)
    return along_x, along_y
