"""What is kept between runs: only in folders of the user's own, whole or not at all."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from granswim_pymunk import storage
from granswim_pymunk.cli import main

FALL = """
import logging, sys
logging.basicConfig(format="%(message)s")
import numpy as np
from granswim_pymunk.compiled import njit

@njit(nogil=True)
def double(x):
    return 2.0 * x

assert double(3.0) == 6.0
print(sum(double.stats.cache_hits.values()))
"""


@pytest.fixture
def fresh(tmp_path, monkeypatch):
    monkeypatch.setenv("GRANSWIM_CACHE", str(tmp_path / "cache"))
    for found in (storage._checked, storage._code_folder, storage._for_this_process):
        found.cache_clear()
    yield tmp_path / "cache"
    for found in (storage._checked, storage._code_folder, storage._for_this_process):
        found.cache_clear()


def compiled(folder: Path, script: Path) -> tuple[str, str]:
    """Times a function came out of the cache, and what was said."""
    script.write_text(FALL)
    environment = os.environ | {"GRANSWIM_CACHE": str(folder)}
    run = subprocess.run(
        [sys.executable, str(script)], capture_output=True, text=True, env=environment, timeout=100, check=False
    )
    assert run.returncode == 0, run.stderr
    return run.stdout.strip(), run.stderr


def test_machine_code_is_kept_and_a_damaged_one_made_anew(tmp_path):
    folder, script = tmp_path / "cache", tmp_path / "script.py"
    assert compiled(folder, script) == ("0", "")
    (code,) = (folder / "compiled").glob("*.code")
    assert code.stat().st_mode & 0o777 == 0o600 and (folder / "compiled").stat().st_mode & 0o777 == 0o700
    assert compiled(folder, script) == ("1", "")
    whole = code.read_bytes()
    for damaged in (whole[: len(whole) // 2], whole[:-5] + b"xxxxx"):
        code.write_bytes(damaged)
        hits, said = compiled(folder, script)
        assert hits == "0" and "damaged" in said and len(said.splitlines()) == 1
        assert code.read_bytes() != damaged
    assert compiled(folder, script) == ("1", "")
    assert not list(tmp_path.rglob("*.nb[ic]"))  # numba's own files, beside the source


def test_the_first_compilation_is_shown(fresh, monkeypatch):
    from granswim_pymunk import compiled

    seen = []

    class Bar:
        def __init__(self, **how):
            seen.append(how["total"])

        def update(self, count):
            seen.append("one")

        def close(self):
            seen.append("done")

    monkeypatch.setattr(compiled, "tqdm", Bar)
    for _ in range(2):

        @compiled.njit(nogil=True)
        def half(x):
            return 0.5 * x

        with compiled.shown(1):
            assert half(3.0) == 1.5
    assert seen == [1, "one", "done"]  # the second one came out of the cache


def test_a_disk_that_takes_no_code(tmp_path):
    """Machine code that cannot be kept is compiled and used all the same."""
    folder, script = tmp_path / "cache", tmp_path / "script.py"
    (folder / "compiled").mkdir(parents=True, mode=0o700)
    script.write_text("import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (2000, 2000))\n" + FALL)
    run = subprocess.run(
        [sys.executable, "-B", str(script)], capture_output=True, text=True, timeout=100, check=False,
        env=os.environ | {"GRANSWIM_CACHE": str(folder)},
    )  # fmt: skip
    assert run.returncode == 0 and run.stdout == "0\n" and "not kept" in run.stderr
    assert not list((folder / "compiled").iterdir())


def test_kernel_whose_text_was_cut(fresh):
    """The text of a kernel is laid out for a person: nothing is loaded from it, and it is put right."""
    from granswim_pymunk.engine.callbacks import _lay_out

    storage.cache_folder().mkdir(exist_ok=True)
    file = fresh / "kernel.py"
    for before in (None, b"x =", b"", b"\xff"):
        if before is not None:
            file.write_bytes(before)
        _lay_out(file, "x = 1\n")
        assert file.read_text() == "x = 1\n"


def test_a_folder_of_another_user_is_not_used(fresh, monkeypatch, caplog):
    fresh.mkdir(mode=0o700)
    assert storage.cache_folder() == fresh and storage.code_folder() == fresh / "compiled"
    storage._checked.cache_clear()
    monkeypatch.setattr(os, "geteuid", lambda: os.getuid() + 1)
    other = storage.cache_folder()
    assert other != fresh and "another user" in caplog.text
    # and in the temporary folder nothing is taken over either
    assert other.name.startswith("granswim-") and not list(other.iterdir())
    assert storage.cache_folder() == other


@pytest.mark.parametrize("mode", [0o777, 0o770, 0o1777])
def test_a_folder_that_others_can_write_to_is_not_used(fresh, caplog, mode):
    fresh.mkdir()
    fresh.chmod(mode)
    assert storage.cache_folder() != fresh and "others can write" in caplog.text


def test_code_that_others_could_have_put_there_is_not_loaded(fresh, caplog):
    (fresh / "compiled").mkdir(parents=True)
    (fresh / "compiled").chmod(0o775)
    assert storage.code_folder() is None and "no machine code is loaded" in caplog.text


def test_cache_that_cannot_be_made(tmp_path, fresh, monkeypatch, caplog):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("GRANSWIM_CACHE", str(tmp_path / "file" / "cache"))
    assert storage.cache_folder().is_dir() and "is not used" in caplog.text


def test_compiled_functions_of_the_package_are_kept_in_the_cache():
    """None leaves machine code beside the installed modules."""
    import importlib
    import pkgutil

    from numba.core.registry import CPUDispatcher

    import granswim_pymunk
    from granswim_pymunk.compiled import _Cache

    seen = 0
    for info in pkgutil.walk_packages(granswim_pymunk.__path__, "granswim_pymunk."):
        # scripts of scenarios do their work when they are imported, and declare candidates for all that comes after
        if info.name.endswith("__main__") or any(part in info.name for part in (".benchmarks", ".scenarios")):
            continue
        for item in vars(importlib.import_module(info.name)).values():
            if isinstance(item, CPUDispatcher) and item.py_func.__module__.startswith("granswim_pymunk"):
                assert isinstance(item._cache, _Cache), item
                assert Path(item._cache.cache_path).name == "compiled"
                seen += 1
    assert seen > 10


def test_folders_beside_the_package_are_found_from_a_copy_of_the_repository():
    """Where it is plainly installed, too: started there, Python takes the copy's package, which has no such folder."""
    code = """
import sys
sys.meta_path[:] = [m for m in sys.meta_path if "editable" not in f"{m} {getattr(m, '__module__', '')}"]
sys.path.insert(0, ".")
import importlib.util
import granswim_pymunk.validation.output
found = [importlib.util.find_spec(f"granswim_pymunk.{n}") for n in ("scenarios.swim", "benchmarks", "tests", "docs")]
print(granswim_pymunk.__file__, *(f is not None for f in found))
"""
    root = Path(__file__).parent.parent
    done = subprocess.run([sys.executable, "-c", code], cwd=root, capture_output=True, text=True, check=True)
    place, *found = done.stdout.split()
    assert Path(place).resolve() == (root / "granswim_pymunk/__init__.py").resolve()
    assert found == ["True", "True", "False", "False"]


def test_command(fresh, capsys):
    assert main(["cache"]) == 0
    assert "nothing" in capsys.readouterr().out
    for name in ("beds", "runs"):
        (fresh / name).mkdir()
        (fresh / name / "a.npz").write_bytes(b"x" * 1000)
    (fresh / "mine.txt").write_text("not of the cache")
    assert main(["cache"]) == 0
    said = capsys.readouterr().out
    assert str(fresh) in said and "beds" in said and "runs" in said
    assert main(["cache", "--clear", "nonsense"]) == 2
    assert "nonsense" in capsys.readouterr().err
    assert main(["cache", "--clear", "beds"]) == 0
    assert not (fresh / "beds").exists() and (fresh / "runs").exists()
    assert main(["cache", "--clear"]) == 0
    assert [p.name for p in fresh.iterdir()] == ["mine.txt"]
