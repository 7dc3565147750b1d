"""``granswim laws``: list the laws, or show one."""

import argparse

from ..laws import Law, all_laws, get_law

HELP = "list the laws a scene can be made of, or show one with its parameters"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("name", nargs="?", help="show this law only")


def describe(law: Law) -> str:
    """Expression, parameters with unit, bounds and meaning, and reference of a law."""
    lines = [f"{law.name} ({law.kind})", f"  {law.expression}"]
    for p in law.parameters:
        bounds = f"one of {', '.join(map(str, p.choices))}" if p.choices else f"{p.low:g} .. {p.high:g}"
        default = "required" if p.default is None else f"default {p.default}"
        lines.append(f"  {p.name} [{p.unit or '-'}] {p.meaning}; {bounds}; {default}")
    lines.append(f"  {law.reference}")
    return "\n".join(lines)


def main(args: argparse.Namespace) -> int:
    laws = [get_law(args.name)] if args.name else list(all_laws().values())
    print("\n\n".join(describe(law) for law in laws))
    return 0
