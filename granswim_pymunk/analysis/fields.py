"""Coarse-grained fields: a truncated Gaussian for bodies, its line integral for contacts.

phi(r) = exp(-r^2/2 w^2)/A inside r < 3 w, A = 2 pi w^2 (1 - exp(-9/2)), so that its integral is one.
Sources: Goldhirsch 2010, Granular Matter 12, 239 (doi:10.1007/s10035-010-0181-z); appendix B of the paper.
Pressures are positive in compression; in two dimensions they are forces per length [N/m].
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import numpy as np

from ..compiled import njit

CUT = 3.0  # cut-off of the kernel in widths


@dataclass(frozen=True)
class Grid:
    """Points (ny, nx) at left + (k + 1/2) spacing, bottom + (l + 1/2) spacing [m]."""

    left: float
    bottom: float
    spacing: float
    nx: int
    ny: int

    @property
    def x(self) -> np.ndarray:
        return self.left + (np.arange(self.nx) + 0.5) * self.spacing

    @property
    def y(self) -> np.ndarray:
        return self.bottom + (np.arange(self.ny) + 0.5) * self.spacing

    def moved(self, dx: float, dy: float) -> Grid:
        return Grid(self.left + dx, self.bottom + dy, self.spacing, self.nx, self.ny)

    @classmethod
    def around(cls, x: float, y: float, width: float, height: float, spacing: float) -> Grid:
        """A grid of about width x height [m] with its middle at x, y."""
        nx, ny = max(round(width / spacing), 1), max(round(height / spacing), 1)
        return cls(x - 0.5 * nx * spacing, y - 0.5 * ny * spacing, spacing, nx, ny)


@dataclass(frozen=True)
class Fields:
    """Fields on a grid, each (ny, nx); sums of several snapshots until ``mean`` divides them.

    number [1/m^2], fraction [1], density [kg/m^2], momentum_x, momentum_y [kg/(m s)]
    area_flux_x, area_flux_y : sum of A_p v phi [m/s], for the velocity as the paper has it
    kinetic_xx, kinetic_xy, kinetic_yy : sum of m v* v* phi [N/m], v* = v - V(r), V = momentum/density
    stated_kinetic : trace of sum v* v* phi without the mass, as the paper writes it [1/s^2]
    contact_xx, contact_xy, contact_yx, contact_yy : sum over contacts of r_ij F_ij int_0^1 phi ds [N/m]
    """

    number: np.ndarray
    fraction: np.ndarray
    density: np.ndarray
    momentum_x: np.ndarray
    momentum_y: np.ndarray
    area_flux_x: np.ndarray
    area_flux_y: np.ndarray
    kinetic_xx: np.ndarray
    kinetic_xy: np.ndarray
    kinetic_yy: np.ndarray
    stated_kinetic: np.ndarray
    contact_xx: np.ndarray
    contact_xy: np.ndarray
    contact_yx: np.ndarray
    contact_yy: np.ndarray
    snapshots: int = 1

    def __add__(self, other: Fields) -> Fields:
        sums = {f.name: getattr(self, f.name) + getattr(other, f.name) for f in fields(self)}
        return Fields(**sums)

    @property
    def mean(self) -> Fields:
        """The average over the snapshots that were added up."""
        return Fields(
            **{f.name: getattr(self, f.name) / self.snapshots for f in fields(self) if f.name != "snapshots"}
        )

    @property
    def velocity(self) -> tuple[np.ndarray, np.ndarray]:
        """V = sum m v phi / sum m phi [m/s], zero where nothing is."""
        safe = np.where(self.density > 0, self.density, 1.0)
        return self.momentum_x / safe, self.momentum_y / safe

    @property
    def stated_velocity(self) -> tuple[np.ndarray, np.ndarray]:
        """V = A_p sum v phi / Phi [m/s], as the paper writes it."""
        safe = np.where(self.fraction > 0, self.fraction, 1.0)
        return self.area_flux_x / safe, self.area_flux_y / safe

    @property
    def kinetic_pressure(self) -> np.ndarray:
        """Trace of the kinetic stress [N/m]."""
        return self.kinetic_xx + self.kinetic_yy

    @property
    def contact_pressure(self) -> np.ndarray:
        """Trace of the contact stress [N/m]."""
        return self.contact_xx + self.contact_yy

    @property
    def pressure(self) -> np.ndarray:
        """P = (p^K + p^C)/2 [N/m]."""
        return 0.5 * (self.kinetic_pressure + self.contact_pressure)


def coarse_grain(
    grid: Grid,
    width: float,
    xy: np.ndarray,
    v: np.ndarray,
    mass: np.ndarray,
    radius: np.ndarray,
    contacts: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None,
    period: float | None = None,
) -> Fields:
    """Fields of one snapshot.

    width : w, rms width of the kernel [m] (the paper: the mean radius of the grains)
    xy, v : (n, 2) [m], [m/s];  mass [kg], radius [m] : (n,)
    contacts : start r_i (k, 2) [m], branch r_j - r_i (k, 2) [m], force on j (k, 2) [N] of each contact, once
    period : length of a periodic x [m]
    """
    start, branch, force = contacts if contacts is not None else (np.zeros((0, 2)),) * 3
    sums = np.zeros((13, grid.ny, grid.nx))
    stress = np.zeros((4, grid.ny, grid.nx))
    arrays = [np.ascontiguousarray(a, dtype=float) for a in (xy, v, mass, radius, start, branch, force)]
    place = (grid.left, grid.bottom, grid.spacing, float(width), float(period or 0.0))
    _deposit(sums, *place, *arrays[:4])
    _deposit_contacts(stress, *place, *arrays[4:])
    number, fraction, density, px, py, ax, ay, nx, ny, xx, mixed, yy, square = sums
    vx, vy = px / np.where(density > 0, density, 1.0), py / np.where(density > 0, density, 1.0)
    ux, uy = ax / np.where(fraction > 0, fraction, 1.0), ay / np.where(fraction > 0, fraction, 1.0)
    # sum m (v - V)(v - V) phi = sum m v v phi - (sum m phi) V V, as V is the mean with these weights
    stated = square - 2 * (ux * nx + uy * ny) + number * (ux**2 + uy**2)
    return Fields(
        number, fraction, density, px, py, ax, ay, xx - px * vx, mixed - px * vy, yy - py * vy,
        np.maximum(stated, 0.0), *stress,
    )  # fmt: skip


def shear_rate(vx: np.ndarray, vy: np.ndarray, spacing: float) -> np.ndarray:
    """1/2 sqrt((d_x v_y + d_y v_x)^2 + (d_x v_x - d_y v_y)^2) [1/s] of fields (ny, nx) [m/s]."""
    dxy, dxx = np.gradient(vx, spacing)
    dyy, dyx = np.gradient(vy, spacing)
    return 0.5 * np.hypot(dyx + dxy, dxx - dyy)


def inertial_number(
    shear: np.ndarray, pressure: np.ndarray, diameter: float, density: float, depth: float | None = None
) -> np.ndarray:
    """I = shear d/sqrt(P/rho), zero pressure gives NaN.

    shear [1/s], pressure [N/m] in two dimensions, diameter d [m], density rho [kg/m^3].
    ``depth`` [m] turns the force per length into a pressure P/depth, which makes I a pure number; the
    thickness of a layer of spheres of volume pi d^3/6 over disks of area pi d^2/4 is 2 d/3. Left out, P is
    put in as it stands, as the paper seems to do: I then has the unit m^(1/2).
    """
    effective = pressure / depth if depth is not None else pressure
    with np.errstate(divide="ignore", invalid="ignore"):
        number = shear * diameter / np.sqrt(effective / density)
    return np.where(effective > 0, number, np.nan)


@njit(cache=True, nogil=True)
def _cells(place, low, spacing, count, reach):
    """First and last grid point within ``reach`` of a place, as a half-open range."""
    first = max(math.ceil((place - reach - low) / spacing - 0.5), 0)
    last = min(math.floor((place + reach - low) / spacing - 0.5), count - 1)
    return first, last + 1


@njit(cache=True, nogil=True)
def _deposit(sums, left, bottom, spacing, width, period, xy, v, mass, radius):
    ny, nx = sums.shape[1], sums.shape[2]
    reach = CUT * width
    scale = 1.0 / (2.0 * math.pi * width * width * (1.0 - math.exp(-0.5 * CUT * CUT)))
    middle = left + 0.5 * nx * spacing
    images = 1 if period > 0.0 else 0
    for i in range(xy.shape[0]):
        base = xy[i, 0]
        if period > 0.0:
            base -= period * math.floor((base - middle) / period + 0.5)
        area = math.pi * radius[i] * radius[i]
        for image in range(-images, images + 1):
            x = base + image * period
            k0, k1 = _cells(x, left, spacing, nx, reach)
            if k0 >= k1:
                continue
            l0, l1 = _cells(xy[i, 1], bottom, spacing, ny, reach)
            for l in range(l0, l1):
                dy = bottom + (l + 0.5) * spacing - xy[i, 1]
                for k in range(k0, k1):
                    dx = left + (k + 0.5) * spacing - x
                    square = dx * dx + dy * dy
                    if square >= reach * reach:
                        continue
                    phi = scale * math.exp(-0.5 * square / (width * width))
                    ux, uy, m = v[i, 0], v[i, 1], mass[i] * phi
                    sums[0, l, k] += phi
                    sums[1, l, k] += area * phi
                    sums[2, l, k] += m
                    sums[3, l, k] += m * ux
                    sums[4, l, k] += m * uy
                    sums[5, l, k] += area * phi * ux
                    sums[6, l, k] += area * phi * uy
                    sums[7, l, k] += phi * ux
                    sums[8, l, k] += phi * uy
                    sums[9, l, k] += m * ux * ux
                    sums[10, l, k] += m * ux * uy
                    sums[11, l, k] += m * uy * uy
                    sums[12, l, k] += phi * (ux * ux + uy * uy)


@njit(cache=True, nogil=True)
def _deposit_contacts(stress, left, bottom, spacing, width, period, start, branch, force):
    """r_ij F_ij times the integral of phi along the branch, which is exact: an error function."""
    ny, nx = stress.shape[1], stress.shape[2]
    reach = CUT * width
    scale = 1.0 / (2.0 * math.pi * width * width * (1.0 - math.exp(-0.5 * CUT * CUT)))
    middle = left + 0.5 * nx * spacing
    images = 1 if period > 0.0 else 0
    root = math.sqrt(2.0) * width
    for c in range(start.shape[0]):
        bx, by = branch[c, 0], branch[c, 1]
        length = math.sqrt(bx * bx + by * by)
        if length == 0.0:
            continue
        ex, ey = bx / length, by / length
        base = start[c, 0] + 0.5 * bx
        if period > 0.0:
            base -= period * math.floor((base - middle) / period + 0.5)
        my = start[c, 1] + 0.5 * by
        for image in range(-images, images + 1):
            mx = base + image * period
            k0, k1 = _cells(mx, left, spacing, nx, reach + 0.5 * abs(bx))
            if k0 >= k1:
                continue
            l0, l1 = _cells(my, bottom, spacing, ny, reach + 0.5 * abs(by))
            for l in range(l0, l1):
                dy = bottom + (l + 0.5) * spacing - my
                for k in range(k0, k1):
                    dx = left + (k + 0.5) * spacing - mx
                    across = dx * ey - dy * ex
                    if across * across >= reach * reach:
                        continue
                    along = dx * ex + dy * ey
                    half = math.sqrt(reach * reach - across * across)
                    low = max(-0.5 * length, along - half) - along
                    high = min(0.5 * length, along + half) - along
                    if high <= low:
                        continue
                    part = math.exp(-0.5 * across * across / (width * width)) * width * math.sqrt(0.5 * math.pi)
                    weight = scale * part * (math.erf(high / root) - math.erf(low / root)) / length
                    stress[0, l, k] += bx * force[c, 0] * weight
                    stress[1, l, k] += bx * force[c, 1] * weight
                    stress[2, l, k] += by * force[c, 0] * weight
                    stress[3, l, k] += by * force[c, 1] * weight


__all__ = ["Fields", "Grid", "coarse_grain", "inertial_number", "shear_rate"]
