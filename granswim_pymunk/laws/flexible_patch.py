"""The flexible arm in drag: one that differs from place to place, as on a table that is rough in one corner."""

from .base import Parameter, law

_NAMES = ("1", "x", "y", "xx", "xy", "yy", "xxx", "xxy", "xyy", "yyy")


@law(
    kind="body",
    expression="F_i = -(m_i/m_0)^q sum_k c_k p_k(x_i, y_i) v_i, p_k the monomials to the third degree, m_0 = 1 kg for "
    "q = 1",
    reference="Hastie, Tibshirani & Friedman, The Elements of Statistical Learning, ch. 5 (varying coefficients)",
    parameters=[
        Parameter("centre", "m", "where the scaled coordinates are zero", size=2, default=(0.0, 0.0)),
        Parameter("size", "m", "length that scales the coordinates", low=0.0, default=1.0),
        Parameter("q", "1", "power of the mass: 0 a force, 1 an acceleration", default=0.0, choices=(0, 1)),
        *[
            Parameter(f"c{k}", "kg/s", f"drag times {name} (scaled coordinates)", default=0.0, typical=1.0)
            for k, name in enumerate(_NAMES)
        ],
    ],
    strength=tuple(f"c{k}" for k in range(len(_NAMES))),
    nests=("linear_drag",),
    candidate="flexible",
    phrase="a drag that depends on the place",
)
def flexible_patch(x, y, vx, vy, mass, centre_x, centre_y, size, q, c0, c1, c2, c3, c4, c5, c6, c7, c8, c9):
    u = (x - centre_x) / size
    v = (y - centre_y) / size
    second = c3 * u * u + c4 * u * v + c5 * v * v
    third = c6 * u * u * u + c7 * u * u * v + c8 * u * v * v + c9 * v * v * v
    rate = c0 + c1 * u + c2 * v + second + third
    if q == 1:
        rate = rate * mass
    return -rate * vx, -rate * vy
