"""Where the arithmetic of doubles ends, which have sixteen digits: none of these decides between laws."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class RoundingCriteria:
    """What is nothing but rounding. Theory: doubles end at 2e-308, and are good to 1e-16 of their size.

    nothing : below which nothing is divided by, and no probability is told
    eigenvalue : of the largest, below which one of normal equations is none;  singular : the same of a singular value
    direction : of the largest, below which a direction of signatures is none;  column : of its length, to which columns
        depend on one another
    told : of the largest, below which what is told of a direction is nothing
    bound : of its scale, within which a number is at its bound
    time [s] : two times nearer than this are one
    """

    nothing: float = 1e-300
    eigenvalue: float = 1e-10
    singular: float = 1e-7
    direction: float = 1e-8
    column: float = 1e-9
    told: float = 1e-12
    bound: float = 1e-6
    time: float = 1e-9
