"""Friction with the substrate and the layers above, coarse-grained to a viscous force."""

from .base import AUTOMATIC, Parameter, law


@law(
    kind="body",
    expression="F_i = -mu_eff W v_i, W = <m> g layers, g = 9.81 m/s^2",
    reference="Echeverria-Huarte, Telo da Gama & Araujo, "
    "Optimal frequency for undulatory motion in granular media, Eq. 5",
    parameters=[
        Parameter("mu_eff", "s/m", "effective friction coefficient", low=0.0),
        Parameter("layers", "1", "number of layers of grains above", low=0.0),
        Parameter(
            "mean_mass",
            "kg",
            "mean mass of a grain; that of the scene's grains where not given",
            low=0.0,
            default=AUTOMATIC,
        ),
    ],
    strength=("mu_eff",),
    linear=True,
)
def confinement(vx, vy, mu_eff, layers, mean_mass):
    # 9.81 whatever the scene's gravity: the contract fixes it
    rate = mu_eff * mean_mass * 9.81 * layers
    return -rate * vx, -rate * vy
