"""Linear spring-dashpot contact."""

from .base import Parameter, law


@law(
    kind="pair",
    expression="F_n = -k_C (|r_ij| - r_i - r_j) - gamma_C m_r v_ij.n, while the bodies touch",
    reference="Cundall & Strack 1979, Geotechnique 29, 47; doi:10.1680/geot.1979.29.1.47",
    parameters=[
        Parameter("stiffness", "N/m", "contact stiffness k_C", low=0.0),
        Parameter("damping", "1/s", "contact damping gamma_C; the dashpot is gamma_C m_r", low=0.0, default=0.0),
    ],
    role="contact",
    loses="damping",
)
def contact_linear(gap, vn, reduced_mass, stiffness, damping):
    return -stiffness * gap - damping * reduced_mass * vn, 0.0
