"""Resistance of a contact to the spin of the disks."""

import math

from .base import AUTOMATIC, Parameter, law


@law(
    kind="pair",
    expression="torque on i = -mu_r r_i F_n w_i/sqrt(w_i^2 + w_0^2), on j alike; F_n >= 0 that of the "
    "scene's contact laws",
    reference="Ai, Chen, Rotter & Ooi 2011, Powder Technol. 206, 269 (model A); "
    "doi:10.1016/j.powtec.2010.09.030",
    parameters=[
        Parameter("mu_r", "1", "coefficient of rolling resistance", low=0.0, typical=0.1),
        Parameter("w_0", "rad/s", "spin below which the torque goes smoothly to zero", low=0.0, default=10.0),
        Parameter(
            "stiffness", "N/m", "of the linear contact; the scene's where not given", low=0.0, default=AUTOMATIC
        ),
        Parameter(
            "hertz", "N/m^1.5", "of the Hertz contact; the scene's where not given", low=0.0, default=AUTOMATIC
        ),
        Parameter(
            "damping", "1/s", "of the contact; the scene's where not given", low=0.0, default=AUTOMATIC
        ),
    ],
    strength=("mu_r",),
    candidate="named",
    phrase="resistance to rolling in contacts",
    refines=("contact_linear", "contact_hertz"),
    role="spin",
)
def rolling_resistance(
    gap, vn, spin_i, spin_j, radius_i, radius_j, reduced_mass, mu_r, w_0, stiffness, hertz, damping
):
    overlap = max(-gap, 0.0)
    normal = (stiffness + hertz * math.sqrt(overlap)) * overlap - damping * reduced_mass * vn
    size_i = math.sqrt(spin_i * spin_i + w_0 * w_0)
    size_j = math.sqrt(spin_j * spin_j + w_0 * w_0)
    if normal <= 0.0 or size_i == 0.0 or size_j == 0.0:
        return 0.0, 0.0, 0.0, 0.0
    most = mu_r * normal
    return 0.0, 0.0, -most * radius_i * spin_i / size_i, -most * radius_j * spin_j / size_j
