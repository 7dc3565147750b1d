"""Damping between bodies that are near."""

from .base import AUTOMATIC, Parameter, law


@law(
    kind="pair",
    reach="cutoff",
    expression="F_n = -c m_r v_ij.n/(1 + gap/range), gap = 0 where they touch, while gap < cutoff",
    reference="Brenner 1961, Chem. Eng. Sci. 16, 242 (lubrication), bounded at contact; "
    "doi:10.1016/0009-2509(61)80035-3",
    parameters=[
        Parameter("c", "1/s", "damping rate at contact; the dashpot is c m_r", low=0.0, typical=1.0, in_bed=1e3),
        Parameter(
            "range", "m", "gap at which it is half as strong", low=1.0e-12, default=1.0e-4, typical=1.0e-4
        ),
        Parameter(
            "cutoff",
            "m",
            "gap beyond which there is none; five ranges where not given",
            low=0.0,
            default=AUTOMATIC,
        ),
    ],
    strength=("c",),
    candidate="named",
    phrase="lubrication between near bodies",
)
def pair_lubrication(gap, vn, reduced_mass, c, range, cutoff):
    return -c * reduced_mass * vn / (1.0 + max(gap, 0.0) / range), 0.0
