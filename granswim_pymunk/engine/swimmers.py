"""Laws of a swimmer's joints, lifted to its disks.

A law of kind ``chain`` that asks for none of the arrays sees one joint, or the angle of the head's axis; the functions
below go along the swimmer for it. They are read as they stand here: compiled code is made of their text, in which the
law takes the place of ``law``, and the Python mode runs the same text.

Joint i lies at disk i, between the segment to disk i + 1 and the one before it; before the first is the head's axis,
at the angle A sin(2 pi f t + phase). Source: Echeverria-Huarte, Telo da Gama & Araujo, Optimal frequency for undulatory
motion in granular media, Eq. 3.
"""

from __future__ import annotations

import ast
import functools
import inspect
import itertools
import linecache
import math
import textwrap
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numba
import numpy as np

from ..laws import Law
from .law_text import definition_of

WHOLE = ("t", "x", "y", "vx", "vy", "mass", "fx", "fy")  # what a law of a whole swimmer may ask for
# what the lifting needs besides, from the law's parameters; where the law has none of that name, this
AXIS = {"amplitude": 0.0, "frequency": 0.0, "phase": 0.0, "form": 0.0, "length": 0.0, "stiffness": 0.0}


def along_joints(law, t, x, y, vx, vy, mass, fx, fy, amplitude, frequency, phase, form, length):
    """Add the forces of a law of joints: F_t on disk i + 1 across its segment, the opposite on disk i.

    Form leader (0): bends are those against the segment before; head_axis (2): against the head's axis; elastic (1):
    F_t is taken as the gradient of an energy: a torque d F_t on this segment, the opposite one on the segment before.
    What the law adds ``across`` acts on this segment alone in each form.
    """
    turning = 2.0 * math.pi * frequency
    head = amplitude * math.sin(turning * t + phase)
    head_rate = amplitude * turning * math.cos(turning * t + phase)
    previous = head
    previous_rate = head_rate
    previous_length = 1.0
    previous_tx = 0.0
    previous_ty = 0.0
    for index in range(x.shape[0] - 1):
        j = index + 1
        dx = x[j] - x[index]
        dy = y[j] - y[index]
        distance = math.sqrt(dx * dx + dy * dy)
        tx = -dy / distance
        ty = dx / distance
        angle = math.atan2(dy, dx)
        bend = angle - (head if form == 2 else previous)
        bend -= 2.0 * math.pi * math.ceil((bend - math.pi) / (2.0 * math.pi))
        vt = (vx[j] - vx[index]) * tx + (vy[j] - vy[index]) * ty
        turns = vt / distance
        rate = turns - (head_rate if form == 2 else previous_rate)
        reduced_mass = mass[index] * mass[j] / (mass[index] + mass[j])
        force, across = law(t, bend, rate, vt, reduced_mass, index)
        if form == 1:
            # d is a constant, or energy would leak
            if index > 0:
                back = force * length / previous_length
                fx[index] -= back * previous_tx
                fy[index] -= back * previous_ty
                fx[index - 1] += back * previous_tx
                fy[index - 1] += back * previous_ty
            force = force * length / distance
        force = across + force
        fx[j] += force * tx
        fy[j] += force * ty
        fx[index] -= force * tx
        fy[index] -= force * ty
        previous = angle
        previous_rate = turns
        previous_length = distance
        previous_tx = tx
        previous_ty = ty


def along_axis(law, t, x, y, fx, fy, amplitude, frequency, phase, form, length, stiffness):
    """Add what the bending force changes where the head's axis is at another angle than commanded.

    It is the law that says at which. Of the joints only the first looks at the axis; in the form head_axis (2) all do.
    """
    command = amplitude * math.sin(2.0 * math.pi * frequency * t + phase)
    follows = law(t, command)
    last = x.shape[0] - 1 if form == 2 else min(x.shape[0] - 1, 1)
    for i in range(last):
        j = i + 1
        dx = x[j] - x[i]
        dy = y[j] - y[i]
        distance = math.sqrt(dx * dx + dy * dy)
        angle = math.atan2(dy, dx)
        bend = angle - command
        bend -= 2.0 * math.pi * math.ceil((bend - math.pi) / (2.0 * math.pi))
        true_bend = angle - follows
        true_bend -= 2.0 * math.pi * math.ceil((true_bend - math.pi) / (2.0 * math.pi))
        force = -stiffness * (true_bend - bend) / distance
        if form == 1:
            force *= length / distance
        fx[j] -= force * dy
        fy[j] += force * dx
        fx[i] += force * dy
        fy[i] -= force * dx


class _Placed(ast.NodeTransformer):
    """Put a law in its place: its own arguments, and its one answer where it gives no second."""

    def __init__(self, law: Law, own: list[str]) -> None:
        self.law, self.own = law, own

    def visit_Assign(self, node: ast.Assign) -> Any:
        if not (isinstance(node.value, ast.Call) and ast.unparse(node.value.func) == "law"):
            return node
        names = [f"own_{name}" if name in self.own else name for name in self.law.arguments]
        node.value.args = [ast.Name(name, ast.Load()) for name in names]
        target = node.targets[0]
        if isinstance(target, ast.Tuple) and "vt" not in self.law.arguments:
            first, second = target.elts
            node.targets = [first]
            return [node, ast.Assign([second], ast.Constant(0.0))]
        return node


class _Lean(ast.NodeTransformer):
    """Leave out what is worked out and never read; a name that only its own next value reads counts as that."""

    def __init__(self, tree: ast.Module) -> None:
        self.read: set[str] = set()
        self._collect(tree, "")

    def _collect(self, node: ast.AST, given: str) -> None:
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load) and node.id != given:
            self.read.add(node.id)
        if isinstance(node, ast.Assign | ast.AugAssign):
            target = node.targets[0] if isinstance(node, ast.Assign) else node.target
            given = target.id if isinstance(target, ast.Name) else ""
        for inner in ast.iter_child_nodes(node):
            self._collect(inner, given)

    def _kept(self, node: Any, target: ast.expr) -> Any:
        return None if isinstance(target, ast.Name) and target.id not in self.read else node

    def visit_Assign(self, node: ast.Assign) -> Any:
        return self._kept(node, node.targets[0])

    def visit_AugAssign(self, node: ast.AugAssign) -> Any:
        return self._kept(node, node.target)


def _lean(tree: ast.Module) -> ast.Module:
    while True:
        before = sum(1 for _ in ast.walk(tree))
        tree = _Lean(tree).visit(tree)
        if sum(1 for _ in ast.walk(tree)) == before:
            return tree


@functools.lru_cache(maxsize=256)
def lifted(law: Law, compiled: bool = True) -> Law:
    """The law as one that sees a whole swimmer and adds to ``fx``, ``fy``; other laws as they are.

    compiled : numba can compile its function; else it calls the law as the Python function that it is
    """
    if not law.sees_joint:
        return law
    tree = ast.parse(textwrap.dedent(inspect.getsource(_way(law))))
    whole = tree.body[0]
    assert isinstance(whole, ast.FunctionDef)
    whole.name = law.name
    own = [a for p in law.parameters for a in p.arguments]
    needed = [a.arg for a in whole.args.args[1:]]
    whole.args.args = [ast.arg(name) for name in (*(n for n in needed if n in WHOLE), *own)]
    # a number of the law may have the name of something that is worked out on the way
    opening = [f"own_{name} = {name}" for name in own if name in law.arguments]
    opening += [f"{name} = {AXIS[name]}" for name in needed if name not in WHOLE and name not in own]
    whole.body = ast.parse("\n".join(opening)).body + [_Placed(law, own).visit(node) for node in whole.body[1:]]
    known: dict[str, Any] = {"math": math, "np": np, "numpy": np}
    inner = definition_of(law, "law") if compiled else None
    if inner is not None:
        whole.body.insert(0, inner)
    else:
        known["law"] = numba.njit(error_model="numpy", nogil=True)(law.function) if compiled else law.function
    text = ast.unparse(ast.fix_missing_locations(_lean(tree)))
    file = f"<{law.name} along a swimmer, {next(_NUMBERS)}>"
    linecache.cache[file] = (len(text), None, text.splitlines(True), file)
    exec(compile(text, file, "exec"), known)
    function: Callable[..., Any] = known[law.name]
    function.__module__ = law.function.__module__
    return replace(law, function=function)


_NUMBERS = itertools.count()


def _way(law: Law) -> Callable[..., None]:
    """How a law is lifted; one that says what becomes of a command is about the head's axis."""
    return along_axis if law.series is not None or "command" in law.arguments else along_joints


def swimmer_forces(
    law: Law, values: Mapping[str, Any], t: float, xy: np.ndarray, v: np.ndarray, mass: np.ndarray
) -> np.ndarray:
    """(2, n) forces [N] of a law of kind ``chain`` on one swimmer, head first.

    values : of all its parameters;  t [s];  xy, v : (n, 2) [m, m/s];  mass : (n,) [kg]
    """
    whole = lifted(law, compiled=False)
    force = np.zeros((2, len(mass)))
    names = [a for p in law.parameters for a in p.arguments]
    given = dict(zip(WHOLE, (t, *xy.T, *v.T, mass, *force), strict=True)) | dict(
        zip(names, law.encode(values), strict=True)
    )
    whole.function(*(given[name] for name in whole.arguments))
    return force
