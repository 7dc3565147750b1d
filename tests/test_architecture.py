"""The map in docs/architecture.md is true: imports go one way, functions are short, no law is named in the diagnosis.

What is not yet so stands in the lists below. They may only become shorter.
"""

from __future__ import annotations

import ast
import re
import tomllib
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from granswim_pymunk.laws import all_laws

ROOT = Path(__file__).parent.parent
PACKAGE = ROOT / "granswim_pymunk"
BESIDE = {"benchmarks", "validation"}  # installed with the package, and no part of it
UNITS = ("6", "60", "60.0", "100", "1000", "1000.0", "1000000.0")  # ball volumes, seconds, per cent, seeds, mm, um
SHORT, FEW = 80, 8  # lines of a function, parameters of a signature in the inference

# against the flow, each imported late, inside a function: (who, what)
AGAINST = {
    ("scene", "render"),  # Scene.plot draws itself
    ("inference.entry", "report"),  # diagnose(..., out=...) writes its report
    ("commands.completion", "cli"),
}
KINDS = ("tracks", "windows", "packings")  # folders of the inference
# modules that import one another, at least one of them late
CIRCLES = {"scene", "scene.model", "scene.reading", "render"}
# lines of functions that are longer: compiled kernels alone
LONG = {
    "proof.kernels.run": 155, "engine.neighbours.build_list": 139, "proof.kernels.pair_forces": 90,
    "proof.kernels.list_pairs": 84,
}  # fmt: skip


@cache
def modules() -> dict[str, ast.Module]:
    """Dotted name inside the package to its syntax; "" is the package itself."""
    found = {}
    for file in sorted(PACKAGE.rglob("*.py")):
        parts = file.relative_to(PACKAGE).with_suffix("").parts
        name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        found[name] = ast.parse(file.read_text(encoding="utf-8"))
    return found


def is_package(name: str) -> bool:
    return (PACKAGE / name.replace(".", "/") / "__init__.py").is_file()


@cache
def imports() -> dict[str, dict[str, bool]]:
    """Module to the modules it imports when it runs (not for types alone), and whether only inside functions."""
    found: dict[str, dict[str, bool]] = {}
    for name, tree in modules().items():
        base = name.split(".") if name else []
        base = base if is_package(name) else base[:-1]
        typed = {
            id(inner)
            for node in ast.walk(tree) if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)
            for inner in ast.walk(node)
        }  # fmt: skip
        at_once = {id(node) for node in tree.body}
        mine = found.setdefault(name, {})
        for node in ast.walk(tree):
            if not isinstance(node, ast.ImportFrom) or not node.level or id(node) in typed:
                continue
            here = base[: len(base) - node.level + 1] + (node.module or "").split(".")
            place = ".".join(part for part in here if part)
            for alias in node.names:
                full = f"{place}.{alias.name}".strip(".")
                target = full if full in modules() else place
                if target != name:
                    mine[target] = mine.get(target, True) and id(node) not in at_once
    return found


def places() -> list[str]:
    """The first column of the table, from top to bottom."""
    text = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    table = text[text.index("| place | holds |") :]
    return re.findall(r"^\| `(\w+)` \| \S.*\|$", table, re.M)


def place_of(module: str) -> str:
    return module.partition(".")[0]


def test_the_map_names_every_place_and_no_other():
    there = {place_of(name) for name in modules()} - {"", "__main__"}
    assert sorted(places()) == sorted(there)


def test_imports_go_with_the_flow():
    order = {place: k for k, place in enumerate(places())}
    wrong = []
    for name, targets in imports().items():
        here = place_of(name)
        if here not in order:
            continue
        for target, late in targets.items():
            there = place_of(target)
            if there in BESIDE | {"", here} or order[there] < order[here]:
                continue
            if not (late and ({(name, there), (here, there)} & AGAINST)):
                wrong.append(f"{name} imports {target}")
    assert not wrong, "; ".join(wrong)


def test_what_serves_every_kind_of_recording_knows_none():
    """Only the entry imports the kinds, and the kinds do not import one another."""
    wrong = []
    for name, targets in imports().items():
        here, *rest = name.split(".")
        if here == "inference" and name != "inference.entry":
            kind = rest[0] if rest and rest[0] in KINDS else None
            others = {f"inference.{other}" for other in KINDS if other != kind}
            wrong += [f"{name} imports {t}" for t in targets if ".".join(t.split(".")[:2]) in others]
    assert not wrong, "; ".join(wrong)
    assert all(is_package(f"inference.{kind}") for kind in KINDS)


def components(graph: dict[str, set[str]]) -> Iterator[set[str]]:
    """Sets of two or more modules that import one another: Tarjan's strongly connected components."""
    index: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []

    def visit(node: str) -> Iterator[set[str]]:
        index[node] = low[node] = len(index)
        stack.append(node)
        for other in graph.get(node, ()):
            if other not in index:
                yield from visit(other)
                low[node] = min(low[node], low[other])
            elif other in stack:
                low[node] = min(low[node], index[other])
        if low[node] == index[node]:
            found = set(stack[stack.index(node) :])
            del stack[stack.index(node) :]
            if len(found) > 1:
                yield found

    for node in graph:
        if node not in index:
            yield from visit(node)


def test_no_modules_import_one_another():
    at_once = {name: {t for t, late in targets.items() if not late} for name, targets in imports().items()}
    assert not list(components(at_once))
    with_late = {name: set(targets) for name, targets in imports().items()}
    for found in components(with_late):
        assert found <= CIRCLES, found - CIRCLES
    assert {frozenset(c) for c in components({"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": {"a"}})} == {frozenset("abc")}


def functions() -> Iterator[tuple[str, ast.FunctionDef]]:
    for name, tree in modules().items():
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef):
                yield f"{name}.{node.name}", node


def test_functions_are_short():
    for name, node in functions():
        lines = (node.end_lineno or node.lineno) - node.lineno + 1
        assert lines <= LONG.get(name, SHORT), f"{name} has {lines} lines"


def test_signatures_of_the_inference_are_narrow():
    for name, node in functions():
        if place_of(name) == "inference":
            given = [a.arg for a in (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs)]
            count = len([a for a in given if a not in ("self", "cls")])
            assert count <= FEW, f"{name} has {count} parameters"


def test_no_law_is_named_in_the_diagnosis():
    laws = set(all_laws())
    found = [
        f"{name}, line {node.lineno}: {node.value}"
        for name, tree in modules().items() if place_of(name) == "inference"
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and node.value.partition(".")[0] in laws
    ]  # fmt: skip
    assert not found, f"declare it with the law: {found}"


def number(node: ast.expr) -> bool:
    """Whether an expression is made of literal numbers alone."""
    if isinstance(node, ast.UnaryOp):
        return number(node.operand)
    if isinstance(node, ast.BinOp):
        return number(node.left) and number(node.right)
    if isinstance(node, ast.Tuple | ast.List):
        return bool(node.elts) and all(map(number, node.elts))
    return isinstance(node, ast.Constant) and type(node.value) in (int, float)


def decides(node: ast.AST) -> bool:
    """Whether a literal in a comparison is more than the sign of something, or how many there are of it."""
    return isinstance(node, ast.Constant) and (
        (type(node.value) is float and node.value != 0) or (type(node.value) is int and node.value > 3)
    )


def constants_of(tree: ast.Module) -> int:
    found = 0
    for node in tree.body:
        if isinstance(node, ast.Assign | ast.AnnAssign) and node.value is not None and number(node.value):
            target = node.targets[0] if isinstance(node, ast.Assign) else node.target
            found += len(target.elts) if isinstance(target, ast.Tuple) else 1
    return found


def literals_of(tree: ast.Module) -> int:
    compared = [node for node in ast.walk(tree) if isinstance(node, ast.Compare)]
    sides = [side for node in compared for side in (node.left, *node.comparators)]
    # shares of a budget, after which a step is left out
    calls = [node for node in ast.walk(tree) if isinstance(node, ast.Call)]
    sides += [part for node in calls if ast.unparse(node.func).endswith("late") for part in node.args]
    return sum(decides(inner) for side in sides for inner in ast.walk(side))


def odd(node: ast.expr | None) -> bool:
    """Whether a literal is more than how many there are of something, its half, or where rounding ends."""
    node = node.operand if isinstance(node, ast.UnaryOp) else node
    if not (isinstance(node, ast.Constant) and type(node.value) in (int, float)):
        return False
    return node.value not in (0, 1, 2, 3, 4, 0.5) and not 0 < node.value <= 1e-6


def inline_of(tree: ast.Module) -> int:
    """Literals that are passed by a name, are defaults, factors, or stand in a row of numbers.

    Units of a text, volumes of balls and ratios of two whole numbers are none that decide; nor are how much is done of
    a diagnosis, shapes of arrays and how exactly equations are solved.
    """
    calls = [node for node in ast.walk(tree) if isinstance(node, ast.Call)]
    told = [c for c in calls if ast.unparse(c.func).endswith(("progress", "again", "zeros"))]
    left_out = {id(inner) for call in told for inner in ast.walk(call)}
    found = 0
    for node in ast.walk(tree):
        if isinstance(node, ast.keyword):
            found += node.arg not in ("rcond", "mode") and odd(node.value)
        elif isinstance(node, ast.arguments):
            found += sum(map(odd, (*node.defaults, *node.kw_defaults)))
        elif id(node) in left_out:
            continue
        elif isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult | ast.Div):
            sides = [s for s in (node.left, node.right) if odd(s) and ast.unparse(s).strip("-") not in UNITS]
            found += len(sides) * (not number(node))
        elif isinstance(node, ast.Tuple | ast.List):
            found += number(node) and any(map(odd, node.elts))
    return found


def test_what_decides_is_a_field_of_the_criteria():
    """No module of the inference has a number for a constant, or compares with another literal than 0 to 3, or asks
    with one whether it is late, or hands one on that is more than a count."""
    here = {n: t for n, t in modules().items() if place_of(n) == "inference" and ".criteria" not in n}
    told = "f(a, evaluations=20)\ng(0.4 * a)\ndef h(most=400): ...\nfor k in (0.6, 1.4): ..."
    assert inline_of(ast.parse(told)) == 4
    assert not inline_of(ast.parse("f(a, ddof=1)\nprogress('', 0.2 + 0.7 * k)\nb = 1e3 * a / 2\nc = 17 / 18 * pi / 6"))
    for count in (constants_of, literals_of, inline_of):
        found = {name: count(tree) for name, tree in here.items() if count(tree)}
        assert not found, f"make it a field of inference/criteria: {found}"


def test_every_criterion_says_what_it_means():
    """Each field stands in the docstring of its class, before a colon or in quotation marks of its own."""
    for name, tree in modules().items():
        for node in tree.body if ".criteria." in name else ():
            if isinstance(node, ast.ClassDef):
                text = ast.get_docstring(node) or ""
                for line in node.body:
                    if isinstance(line, ast.AnnAssign):
                        field = ast.unparse(line.target)
                        said = re.search(rf"\b{field}\b(``)?( \[[^\]]+\])? ?:|``{field}``", text)
                        assert said, f"{name}.{node.name}.{field} is not explained"


def test_exceptions_are_about_what_is_there():
    assert set(LONG) <= {name for name, _ in functions()}


def test_the_wheel_carries_every_folder_of_code():
    """The list in pyproject.toml is kept by hand, as three folders of the repository move into the package."""
    with (ROOT / "pyproject.toml").open("rb") as file:
        listed = set(tomllib.load(file)["tool"]["setuptools"]["packages"])
    there = {".".join(f.parent.relative_to(ROOT).parts) for f in (ROOT / "granswim_pymunk").rglob("__init__.py")}
    assert listed == there | {f"granswim_pymunk.{name}" for name in ("benchmarks", "scenarios", "validation")}
