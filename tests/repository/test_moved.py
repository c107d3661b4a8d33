"""Tests that documented modules that have moved still work under their old names."""

from __future__ import annotations

import importlib
import subprocess
import sys

import pytest

from msggen.base.moved import MOVED


@pytest.mark.parametrize("name", MOVED)
def test_an_old_name_is_the_same_module_and_warns(name: str) -> None:
    sys.modules.pop(name, None)
    with pytest.warns(DeprecationWarning, match=f"{name} is {MOVED[name]} now") as warned:
        found = importlib.import_module(name)
    assert found is importlib.import_module(MOVED[name])
    assert len(warned) == 1


def test_both_names_work_in_any_order_and_in_any_form() -> None:
    program = (
        "import msggen.report.errors, msggen.show.report.errors as new\n"
        "from msggen import layout\n"
        "from msggen.firmware.sources import find_sources\n"
        "import msggen.definitions.layout, msggen.sources.sources\n"
        "assert msggen.report.errors is new\n"
        "assert layout is msggen.definitions.layout and layout.__name__ == 'msggen.definitions.layout'\n"
        "assert find_sources is msggen.sources.sources.find_sources\n"
    )
    done = subprocess.run([sys.executable, "-W", "always", "-c", program], capture_output=True, text=True, check=True)
    assert [line.partition(":")[0] for line in done.stderr.splitlines() if "Deprecation" in line] == ["<string>"] * 3


@pytest.mark.parametrize("name", ["msggen.primitives", "msggen.firmware.tree", "msggen.report.json", "msggen.nothing"])
def test_another_old_name_is_the_error_of_python(name: str) -> None:
    with pytest.raises(ModuleNotFoundError, match=f"^No module named '{name}'$"):
        importlib.import_module(name)
