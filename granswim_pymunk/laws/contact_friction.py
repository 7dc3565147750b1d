"""Coulomb friction between touching disks, which sets them spinning."""

import math

from .base import AUTOMATIC, Parameter, law


@law(
    kind="pair",
    expression="F_t = -mu F_n v_t/sqrt(v_t^2 + v_0^2), F_n >= 0 that of the scene's contact laws, v_t with "
    "the spins; of rigid disks Chipmunk's own: the impulse across is at most mu times that along",
    reference="Haff & Werner 1986, Powder Technol. 48, 239; doi:10.1016/0032-5910(86)80048-1",
    parameters=[
        Parameter("mu", "1", "friction coefficient", low=0.0, typical=0.1, in_bed=0.05),
        Parameter(
            "v_0", "m/s", "slip speed below which the force goes smoothly to zero", low=0.0, default=1.0e-3
        ),
        Parameter(
            "stiffness",
            "N/m",
            "stiffness of the linear contact; the scene's where not given",
            low=0.0,
            default=AUTOMATIC,
        ),
        Parameter(
            "hertz",
            "N/m^1.5",
            "stiffness of the Hertz contact; the scene's where not given",
            low=0.0,
            default=AUTOMATIC,
        ),
        Parameter(
            "damping",
            "1/s",
            "damping of the contact; the scene's where not given",
            low=0.0,
            default=AUTOMATIC,
        ),
    ],
    strength=("mu",),
    candidate="named",
    phrase="friction in contacts",
    refines=("contact_linear", "contact_hertz", "contact_elastic"),
    role="spin",
)
def contact_friction(gap, vn, vt, reduced_mass, mu, v_0, stiffness, hertz, damping):
    overlap = max(-gap, 0.0)
    normal = (stiffness + hertz * math.sqrt(overlap)) * overlap - damping * reduced_mass * vn
    slip = math.sqrt(vt * vt + v_0 * v_0)
    if normal <= 0.0 or slip == 0.0:
        return 0.0, 0.0
    return 0.0, -mu * normal * vt / slip
