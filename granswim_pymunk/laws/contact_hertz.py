"""Hertz contact: the 3/2 power of the overlap."""

import math

from .base import Parameter, law


@law(
    kind="pair",
    expression="F_n = k_H delta^(3/2) - gamma_C m_r v_ij.n, delta = r_i + r_j - |r_ij| > 0",
    reference="Hertz 1882, J. reine angew. Math. 92, 156; doi:10.1515/crll.1882.92.156",
    parameters=[
        Parameter("stiffness", "N/m^1.5", "contact stiffness k_H", low=0.0),
        Parameter("damping", "1/s", "contact damping gamma_C, as in the linear law", low=0.0, default=0.0),
    ],
    role="contact",
    loses="damping",
)
def contact_hertz(gap, vn, reduced_mass, stiffness, damping):
    overlap = -gap
    # x*sqrt(x) is four times faster than x**1.5
    return stiffness * overlap * math.sqrt(max(overlap, 0.0)) - damping * reduced_mass * vn, 0.0
