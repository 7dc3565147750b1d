"""F8: coarse-grained solid fraction, kinetic and contact pressure around the head at 4, 9 and 15 Hz."""

import numpy as np
from matplotlib.figure import Figure

from ..analysis.speed import mean_error
from .claim import Claim, Finding, above, number
from .draw import styled
from .results import HEIGHTS, LENGTH, RADIUS, Results, nan_mean

THREE = (4.0, 9.0, 15.0)
ROWS = (
    ("fraction", "Φ", 1.0, "viridis"),
    ("kinetic", "p^K [mN/m]", 1e3, "magma"),
    ("stated_kinetic", "p^K without mass [1/s²]", 1.0, "magma"),
    ("contact", "p^C [N/m]", 1.0, "cividis"),
)


def near(profile: np.ndarray) -> float:
    """Mean of a vertical profile within one diameter of the swimmer's line."""
    return float(nan_mean(profile[np.abs(HEIGHTS) <= 1.0]))


def far(profile: np.ndarray) -> float:
    """Mean of a vertical profile beyond four diameters."""
    return float(nan_mean(profile[np.abs(HEIGHTS) >= 4.0]))


def judge(results: Results) -> list[Finding]:
    findings = []
    slow, mid, fast = ({"frequency": f} for f in THREE)
    d, e, n = results.difference("profile_fraction", slow, fast, near)
    findings.append(
        Finding(
            says="15 Hz: solid fraction near the swimmer is much lower", packings=n,
            measured=f"lower by {number(d, e)} than at 4 Hz (grains only, within one diameter)",
            verdict=above(d, e), value=d, error=e,
        )
    )  # fmt: skip
    for one, two, text in ((mid, slow, "from 4 to 9 Hz"), (fast, mid, "from 9 to 15 Hz")):
        d, e, n = results.difference("profile_kinetic", one, two, near)
        stated = results.difference("profile_stated_kinetic", one, two, near)
        findings.append(
            Finding(
                says="velocity fluctuations intensify with f", measured=f"p^K near the swimmer rises by "
                f"{number(d, e, 'mN/m', 1e3)} {text}", verdict=above(d, e), value=d, error=e, unit="N/m", packings=n,
                note=f"as stated, without the mass: by {number(*stated[:2], '1/s²')}",
            )
        )  # fmt: skip

    def reach(profile: np.ndarray) -> float:
        return far(profile) / near(profile)

    d, e, n = results.difference("profile_kinetic", mid, fast, reach)
    findings.append(
        Finding(
            says="at 9 Hz fluctuations reach across the region, at 15 Hz they stay near the swimmer",
            measured=f"p^K far over near falls by {number(d, e)} from 9 to 15 Hz",
            verdict=above(d, e), value=d, error=e, packings=n,
        )
    )  # fmt: skip
    ratio = np.array([reach(p) for p in results.values("profile_contact", **fast)])
    alone = np.array([reach(p) for p in results.values("profile_bed_contact", **fast)])
    mean, error = map(float, mean_error(ratio)) if len(ratio) else (np.nan, np.nan)
    other = map(float, mean_error(alone)) if len(alone) else (np.nan, np.nan)
    findings.append(
        Finding(
            says="15 Hz: contact pressure is larger far from the swimmer",
            measured=f"p^C far over near {number(mean, error)}", verdict=above(mean, error, 1.0), value=mean,
            error=error, packings=len(ratio),
            note=f"without those of the swimmer {number(*other)}. Every contact of a grain, with grains, swimmer "
            "and walls, along its whole branch, once; the paper's double sum has those between grains twice",
        )
    )  # fmt: skip
    d, e, n = results.difference("profile_contact", fast, slow, reach)
    other = results.difference("profile_bed_contact", fast, slow, reach)[:2]
    findings.append(
        Finding(
            says="4 Hz: contact pressure is more homogeneous than at 15 Hz",
            measured=f"p^C far over near grows by {number(d, e)} from 4 to 15 Hz",
            verdict=above(d, e), value=d, error=e, packings=n,
            note=f"without the contacts of the swimmer by {number(*other)}",
        )
    )  # fmt: skip
    return findings


@styled
def draw(results: Results) -> Figure | None:
    maps = {(name, f): results.averaged(name, frequency=f) for name, *_ in ROWS for f in THREE}
    if not any(m is not None for m in maps.values()):
        return None
    figure = Figure(figsize=(6.8, 2.05 * len(ROWS)), layout="constrained")
    axes = figure.subplots(len(ROWS), 3, sharex=True, sharey=True)
    half = 1e3 * LENGTH
    for row, (name, label, scale, colours) in enumerate(ROWS):
        shown = [m[0] * scale for f in THREE if (m := maps[name, f]) is not None]
        low = 0.0 if name != "fraction" else float(np.percentile(shown, 2))
        high = float(np.percentile(shown, 99))
        for column, f in enumerate(THREE):
            axis = axes[row, column]
            found = maps[name, f]
            if found is not None:
                image = axis.imshow(
                    found[0] * scale, origin="lower", extent=(-half, half, -half, half), vmin=low, vmax=high,
                    cmap=colours,
                )  # fmt: skip
            axis.plot([0], [0], "o", color="red", markersize=4)
            if row == 0:
                axis.set_title(f"{f:g} Hz" + (f", {found[1]} packings" if found else ""))
                body = [-1e3 * RADIUS, 1e3 * (LENGTH - RADIUS)]
                sides = 1e3 * RADIUS * np.array([-1, -1, 1, 1, -1])
                axis.plot([*body, *body[::-1], body[0]], sides, "r-", linewidth=0.8)
        figure.colorbar(image, ax=axes[row].tolist(), label=label, shrink=0.9)
    for axis in axes[-1]:
        axis.set_xlabel("x − x_head [mm]")
    for axis in axes[:, 0]:
        axis.set_ylabel("y − y_head [mm]")
    return figure


CLAIM = Claim("F8", "Coarse-grained fields", "Fig. 8, appendix B", ("free",), judge, draw)
