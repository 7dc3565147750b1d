"""Medium that is carried along: more inertia, the same forces. Impulses move what is carried, too."""

from .base import Parameter, law


@law(
    kind="constraint",
    expression="m_i (1 + beta) dv_i/dt = F_i, gravity and dampings as before; about a pin the given "
    "inertia grows alike",
    reference="Poisson 1832, Mem. Acad. R. Sci. 11, 521; Lamb, Hydrodynamics, art. 92",
    parameters=[
        # masses are off by one to three per cent
        Parameter("beta", "1", "added inertia in units of the mass", low=-0.9, high=1.0, typical=0.1, in_bed=0.2,
                  ordinary=0.03, usual=0.02, within="weight")
    ],
    strength=("beta",),
    candidate="named",
    linear=True,
)
def added_mass(fx, fy, beta):
    less = -beta / (1.0 + beta)
    return less * fx, less * fy
