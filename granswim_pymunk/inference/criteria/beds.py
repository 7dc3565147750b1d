"""What decides about radii of grains in a bed that is seen."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class RadiiCriteria:
    """How radii of grains are put right by who touches whom.

    looks : frames that are looked at, at most;  fewest : of them in which a pair is near
    near : of the sum of two radii, a gap, or an overlap, up to which a pair is followed
    low : quantile of a pair's distances that is taken: it has touched so often, and noise has brought it no nearer
    shift : of the noise of a distance by which noise lowers that quantile where a pair touches;  shift_spread : of it
    alike : spread of an error that all distances share: a picture's scale, which is told elsewhere
    apart : of the sum of radii, a gap beyond which a pair may as well not touch;  far : times that in the first rounds
    rough : of the sum of radii, how well a quantile tells a distance where there is no noise
    rounds : of the fit;  narrowed : of them, after which pairs count as touching no farther than in the end
    every : rounds between two looks at how well radii are known
    first : relative error that is thought likely where none was said
    worth : relative error that was not said, below which radii stay as believed. Choice: circles are read off to that
    most : relative error beyond which it is not the radii that are wrong. Choice
    told : posterior over prior variance below which a radius counts as told;  many : radii that have to be
    all : relative, the most by which all radii together, or a picture that links cannot tell of, are off. Choice
    density : relative scatter of mass over radius cubed below which masses are believed to follow from radii
    """

    looks: int = 120
    fewest: int = 10
    near: float = 0.1
    low: float = 0.2
    shift: float = 0.6
    shift_spread: float = 0.1
    alike: float = 0.03
    apart: float = 0.015
    far: float = 3.0
    rough: float = 0.002
    rounds: int = 30
    narrowed: int = 10
    every: int = 5
    first: float = 0.02
    worth: float = 0.005
    most: float = 0.05
    told: float = 0.5
    many: int = 20
    all: float = 0.04
    density: float = 2e-3
