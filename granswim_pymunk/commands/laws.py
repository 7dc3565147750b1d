"""``granswim laws``: list the laws, or show one."""

import argparse
import math
from typing import TYPE_CHECKING, Any

from ..console import put_figures

if TYPE_CHECKING:
    from ..laws import Law

EXAMPLES = ("granswim laws", "granswim laws bending", "granswim laws --json laws.json")
HELP = "list the laws a scene can be made of, or show one with its parameters"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("name", nargs="?", help="show this law only")


def describe(law: "Law") -> str:
    """Expression, parameters with unit, bounds and meaning, and reference of a law."""
    lines = [f"{law.name} ({law.kind})", f"  {law.expression}"]
    for p in law.parameters:
        bounds = f"one of {', '.join(map(str, p.choices))}" if p.choices else f"{p.low:g} .. {p.high:g}"
        default = "required" if p.default is None else f"default {p.default}"
        lines.append(f"  {p.name} [{p.unit or '-'}] {p.meaning}; {bounds}; {default}")
    lines.append(f"  {law.reference}")
    return "\n".join(lines)


def figures(law: "Law") -> dict[str, Any]:
    """The same as a dictionary, for JSON; a bound without an end and an automatic default are None."""
    from ..laws import AUTOMATIC

    parameters = [
        {
            "name": p.name, "unit": p.unit, "meaning": p.meaning, "choices": list(p.choices) or None, "size": p.size,
            "low": p.low if math.isfinite(p.low) else None, "high": p.high if math.isfinite(p.high) else None,
            "default": None if p.default is AUTOMATIC else p.default, "required": p.default is None,
        }
        for p in law.parameters
    ]  # fmt: skip
    return {
        "name": law.name, "kind": law.kind, "expression": law.expression, "reference": law.reference,
        "parameters": parameters,
    }  # fmt: skip


def main(args: argparse.Namespace) -> int:
    from ..laws import all_laws, get_law

    laws = [get_law(args.name)] if args.name else list(all_laws().values())
    put_figures(args, [figures(law) for law in laws])
    print("\n\n".join(describe(law) for law in laws))
    return 0
