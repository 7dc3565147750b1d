"""A form without a name in place: a smooth force field with no name."""

from .base import Parameter, law

SCALED = (
    Parameter("centre", "m", "where the scaled coordinates are zero", size=2, default=(0.0, 0.0)),
    Parameter("size", "m", "length that scales the coordinates", low=0.0, default=1.0),
)


def coefficients(*monomials: str) -> list[Parameter]:
    """Those of a series in scaled coordinates: a0, a1, ... along x, then b0, b1, ... along y [N]."""
    return [
        Parameter(f"{axis}{k}", "N", f"force along {axis} times {name} (scaled coordinates)", default=0.0, typical=1.0)
        for axis in ("a", "b")
        for k, name in enumerate(monomials)
    ]


_COEFFICIENTS = coefficients("1", "x", "y", "xx", "xy", "yy", "xxx", "xxy", "xyy", "yyy")


@law(
    kind="body",
    expression="F_i = (m_i/m_0)^q sum_k a_k p_k(x_i, y_i), p_k the monomials to the third degree, m_0 = 1 kg for q = 1",
    reference="Hastie, Tibshirani & Friedman, The Elements of Statistical Learning, ch. 5 (basis expansions)",
    parameters=[
        *SCALED,
        Parameter("q", "1", "power of the mass: 0 a force, 1 an acceleration", default=0.0, choices=(0, 1)),
        *_COEFFICIENTS,
    ],
    strength=tuple(p.name for p in _COEFFICIENTS),
    low_order=("a0", "a1", "a2", "b0", "b1", "b2"),
    candidate="flexible",
    role="place",
    phrase="a force that depends on the place",
)
def flexible_place(
    x, y, mass, centre_x, centre_y, size, q,
    a0, a1, a2, a3, a4, a5, a6, a7, a8, a9, b0, b1, b2, b3, b4, b5, b6, b7, b8, b9,
):  # fmt: skip
    u = (x - centre_x) / size
    v = (y - centre_y) / size
    uu = u * u
    uv = u * v
    vv = v * v
    along_x = a0 + a1 * u + a2 * v + a3 * uu + a4 * uv + a5 * vv + a6 * uu * u + a7 * uu * v + a8 * u * vv + a9 * vv * v
    along_y = b0 + b1 * u + b2 * v + b3 * uu + b4 * uv + b5 * vv + b6 * uu * u + b7 * uu * v + b8 * u * vv + b9 * vv * v
    weight = mass if q == 1 else 1.0
    return weight * along_x, weight * along_y
