"""Tests of the wrappers for CI: the pre-commit hooks in a real repository, and the GitHub Action step by step.

The page about them, docs/ci.md, is tested too. Both wrappers install msggen as users do, from a checkout and with the
packages of the index.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml

from msggen.base.version import __version__
from msggen.cli import main
from support.catalogs import write_definitions
from support.interpreters import build
from support.repository import DEFINITIONS, ROOT

ATTITUDE = (ROOT / "msg" / "versioned" / "VehicleAttitude.msg").read_text(encoding="utf-8")


def swap(definition: str, one: str, other: str) -> str:
    """Swap the lines of two fields: if both have the same type, the size stays the same and the values change."""
    lines = definition.splitlines()
    first, second = (next(i for i, line in enumerate(lines) if line.split(" ")[1:2] == [name]) for name in (one, other))
    lines[first], lines[second] = lines[second], lines[first]
    return "\n".join([*lines, ""])


SWAPPED = swap(ATTITUDE, "timestamp", "timestamp_sample")
NEEDED = (
    "msggen",
    "templates",
    "msg",
    "srv",
    "dds_topics.yaml",
    "zenoh_topics.yaml",
    "releases",
    "pyproject.toml",
    "README.md",
    "LICENSE",
)
HOOKS = ".pre-commit-hooks.yaml"

ENVIRONMENT = {
    **{name: value for name, value in os.environ.items() if not name.startswith("GIT_")},
    "GIT_CONFIG_GLOBAL": os.devnull,
    "GIT_CONFIG_SYSTEM": os.devnull,
    **{f"GIT_{who}_{what}": "tester@localhost" for who in ("AUTHOR", "COMMITTER") for what in ("NAME", "EMAIL")},
}


def run(folder: Path, *command: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        command,
        cwd=folder,
        env=ENVIRONMENT | environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )


def commit_all(folder: Path) -> str:
    """Commit everything in `folder`, creating a repository if there is none; return the commit."""
    for command in ("init -q", "add -A", "commit -q --no-verify -m everything"):
        done = run(folder, "git", *command.split())
        assert done.returncode == 0, done.stdout
    return run(folder, "git", "rev-parse", "HEAD").stdout.strip()


# --- pre-commit


@pytest.mark.slow
def test_pre_commit_accepts_the_hooks() -> None:
    done = run(ROOT, sys.executable, "-m", "pre_commit", "validate-manifest", HOOKS)
    assert done.returncode == 0, done.stdout


@pytest.mark.parametrize(
    ("path", "counts"),
    [
        ("msg/VehicleStatus.msg", True),
        ("msg/versioned/VehicleStatus.msg", True),
        ("srv/VehicleCommand.srv", True),
        ("src/modules/uxrce_dds_client/dds_topics.yaml", True),
        ("dds_topics.yaml", True),
        ("other_dds_topics.yaml", False),
        ("msg/CMakeLists.txt", False),
        ("notes.msg.md", False),
    ],
)
def test_the_hooks_run_when_definitions_change(path: str, *, counts: bool) -> None:
    for hook in yaml.safe_load((ROOT / HOOKS).read_text()):
        assert bool(re.search(hook["files"], path)) is counts


@pytest.fixture(scope="module")
def tool(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """A repository with the files of this checkout, uncommitted work included, and its commit."""
    folder = tmp_path_factory.mktemp("tool")
    for name in (*NEEDED, HOOKS):
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(ROOT / name, folder / name)
    return folder, commit_all(folder)


@pytest.fixture(scope="module")
def workspace(tool: tuple[Path, str], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A user's repository with a firmware, a package that matches it, the generated types and all hooks."""
    folder = tmp_path_factory.mktemp("workspace")
    hooks = [
        {"id": "msggen-check", "args": ["--px4", "firmware", "px4_msgs"]},
        {"id": "msggen-breaking", "args": ["--px4", "firmware", "--against", "HEAD"]},
        {"id": "msggen-build", "args": ["--px4", "firmware"]},
        {"id": "msggen-lint", "args": ["--px4", "firmware", "--select", "TAG"]},
    ]
    config = {"repos": [{"repo": str(tool[0]), "rev": tool[1], "hooks": hooks}]}
    write_definitions(
        folder,
        {
            "firmware/msg/VehicleAttitude.msg": ATTITUDE,
            "px4_msgs/msg/VehicleAttitude.msg": ATTITUDE,
            ".pre-commit-config.yaml": yaml.safe_dump(config),
        },
    )
    built = run(folder, sys.executable, "-m", "msggen", "build", "--px4", "firmware", "-q")
    assert built.returncode == 0, built.stdout
    commit_all(folder)
    return folder


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> str:
    return str(tmp_path_factory.mktemp("cache"))


def run_hooks(workspace: Path, cache: str) -> tuple[int, str]:
    done = run(
        workspace, sys.executable, "-m", "pre_commit", "run", "--all-files", "--color=never", PRE_COMMIT_HOME=cache
    )
    return done.returncode, done.stdout


@pytest.mark.night
@pytest.mark.tools("git")
def test_the_hooks_pass_what_is_in_step(workspace: Path, cache: str) -> None:
    code, output = run_hooks(workspace, cache)
    assert (code, output.count("...Passed")) == (0, 4), output


@pytest.mark.night
@pytest.mark.tools("git")
def test_the_hooks_stop_a_silent_change(workspace: Path, cache: str) -> None:
    definition = workspace / "firmware" / "msg" / "VehicleAttitude.msg"
    definition.write_text(SWAPPED)
    try:
        code, output = run_hooks(workspace, cache)
    finally:
        run(workspace, "git", "checkout", "-q", ".")
    assert (code, output.count("...Failed")) == (1, 3), output
    checked, broken, built = re.split(r"^- hook id: .*\n", output, flags=re.MULTILINE)[1:]
    assert "px4_msgs/msg/VehicleAttitude.msg" in checked
    assert "silent" in checked
    assert "firmware/msg/VehicleAttitude.msg" in broken
    assert "silent" in broken
    assert "files were modified by this hook" in built


# --- GitHub Action


ACTION = yaml.safe_load((ROOT / "action.yml").read_text())
INSTALL, RUN = ACTION["runs"]["steps"]


def test_the_action_has_what_github_asks_for() -> None:
    assert {"name", "description", "runs"} <= set(ACTION)
    assert ACTION["runs"]["using"] == "composite"
    assert all({"shell", "run"} <= set(step) for step in ACTION["runs"]["steps"])


def test_inputs_never_become_part_of_a_script() -> None:
    assert [step["name"] for step in ACTION["runs"]["steps"] if "${{" in step["run"]] == []


def run_step(  # noqa: PLR0913
    step: dict[str, Any], folder: Path, runner: Path, inputs: dict[str, str], *, ref: str = "main", server: str = ""
) -> tuple[int, str]:
    """Run a step as GitHub does: with expressions filled in, the script in a file, and bash with the same options."""
    values = {f"inputs.{name}": about.get("default", "") for name, about in ACTION["inputs"].items()}
    values |= {f"inputs.{name}": text for name, text in inputs.items()}
    values |= {"github.action_ref": ref, "github.action_repository": "msggen/msggen"}
    environment = {
        name: re.sub(r"\${{ ([\w.]+) }}", lambda match: values[match[1]], text)
        for name, text in step.get("env", {}).items()
    } | {"GITHUB_SERVER_URL": server}
    script = runner / "step.sh"
    script.write_text(step["run"])
    command = ["bash", "--noprofile", "--norc", "-eo", "pipefail", str(script)]
    path = os.pathsep.join([os.path.dirname(sys.executable), os.environ["PATH"]])
    done = run(folder, *command, PATH=path, RUNNER_TEMP=str(runner), GITHUB_ACTION_PATH=str(ROOT), **environment)
    return done.returncode, done.stdout


@pytest.fixture(scope="module")
def runner(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The temporary folder of a runner that has run the first step of the action."""
    folder = tmp_path_factory.mktemp("runner temp")
    code, output = run_step(INSTALL, folder, folder, {})
    assert code == 0, output
    return folder


WHEEL = f"msggen-{__version__}-py3-none-any.whl"
RELEASED = f"server/msggen/msggen/releases/download/v{__version__}/{WHEEL}"
PIP = """#!/bin/sh
for word; do :; done
echo "$2 $3 $word"
case "$word" in http*) exit %d ;; esac
"""
"""The program `python3` that prints what pip installs, and fails to install a URL."""


@pytest.mark.parametrize(
    ("ref", "code", "installed"),
    [
        (f"v{__version__}", 0, [f"https://{RELEASED}"]),
        (f"v{__version__}", 1, [f"https://{RELEASED}", str(ROOT)]),
        (f"v{__version__}0", 0, [str(ROOT)]),
        ("main", 0, [str(ROOT)]),
        ("0123abc", 0, [str(ROOT)]),
        ("", 0, [str(ROOT)]),
    ],
    ids=["a release", "a tag without a wheel", "another tag", "a branch", "a commit", "a folder"],
)
def test_the_action_installs_the_wheel_of_its_release(
    ref: str, code: int, installed: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "python3").write_text(PIP % code, encoding="utf-8")
    (tmp_path / "python3").chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(tmp_path / "python3"))
    done, output = run_step(INSTALL, tmp_path, tmp_path, {}, ref=ref, server="https://server")
    lines = [f"pip install {each}" for each in installed]
    if installed[-1] == str(ROOT):
        lines.insert(-1, f"{ref or 'the action'} has no wheel: msggen is built from its files")
    assert (done, output.splitlines()) == (0, lines)


@pytest.mark.night  # installs
def test_the_action_works_with_the_wheel(checkout: Path, tmp_path: Path) -> None:
    assert build(ROOT, (tmp_path / RELEASED).parent) == tmp_path / RELEASED
    server = (tmp_path / "server").as_uri()
    code, output = run_step(INSTALL, tmp_path, tmp_path, {}, ref=f"v{__version__}", server=server)
    assert (code, "is built from its files" in output) == (0, False), output
    assert run_step(RUN, checkout, tmp_path, {"arguments": "old old"})[0] == 0


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    files = {"old/msg/VehicleAttitude.msg": ATTITUDE, "my package/msg/VehicleAttitude.msg": SWAPPED}
    return write_definitions(tmp_path, files)


@pytest.mark.night
def test_the_action_annotates_what_differs_and_fails(runner: Path, checkout: Path) -> None:
    code, output = run_step(RUN, checkout, runner, {"arguments": "old 'my package'"})
    *annotations, summary = output.splitlines()
    assert code == 1, output
    assert all(each.startswith("::error file=my package/msg/VehicleAttitude.msg,line=") for each in annotations)
    assert any("::silent both ways: " in each for each in annotations)
    assert summary.startswith("my package differs from old: ")


@pytest.mark.night
def test_the_action_passes_what_is_in_step(runner: Path, checkout: Path) -> None:
    code, output = run_step(RUN, checkout, runner, {"arguments": "old\nold\n"})
    assert (code, output) == (0, "old matches old: 1 message, 0 services\n")


@pytest.mark.night
def test_the_action_runs_breaking(runner: Path, checkout: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    inputs = {"command": "breaking", "arguments": "--px4 'my package' --against old"}
    summary = checkout / "summary.md"
    monkeypatch.setitem(ENVIRONMENT, "GITHUB_STEP_SUMMARY", str(summary))
    code, output = run_step(RUN, checkout, runner, inputs)
    assert (code, output.splitlines()[0].partition(" ")[0]) == (1, "::error"), output
    assert "### silent: readers decode wrong values without an error" in summary.read_text(encoding="utf-8")


@pytest.mark.night
@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ("old nowhere", "nowhere: S101"),
        ("old 'my", "::error::arguments: No closing quotation"),
        ("--px5 old", "::error title=usage::msggen check: unknown argument '--px5', did you mean '--px4'?"),
        ("", "::error title=usage::msggen check: the following arguments are required: PKG"),
    ],
)
def test_the_action_tells_when_it_cannot_tell(runner: Path, checkout: Path, arguments: str, said: str) -> None:
    code, output = run_step(RUN, checkout, runner, {"arguments": arguments})
    assert code == 2, output
    assert said in output
    assert "Traceback" not in output


@pytest.mark.night
@pytest.mark.parametrize("hostile", ["$(touch pwned)", "old old; touch pwned", "`touch pwned`", "'\ntouch pwned\n'"])
def test_the_action_takes_its_inputs_for_data(runner: Path, checkout: Path, hostile: str) -> None:
    for inputs in ({"arguments": hostile}, {"command": hostile, "arguments": "old old"}):
        code, output = run_step(RUN, checkout, runner, inputs)
        assert code == 2, output
    assert not (checkout / "pwned").exists()


@pytest.mark.night
def test_the_action_is_not_led_astray_by_modules_of_the_checkout(runner: Path, checkout: Path) -> None:
    write_definitions(checkout, {"msggen.py": "raise SystemExit(7)\n", "yaml/__init__.py": "raise SystemExit(7)\n"})
    assert run_step(RUN, checkout, runner, {"arguments": "old old"})[0] == 0


# --- docs/ci.md

PAGE = (ROOT / "docs" / "ci.md").read_text(encoding="utf-8")
CONSOLE: list[list[str]] = [block.splitlines() for block in re.findall(r"```console\n(.*?)```", PAGE, re.DOTALL)]


@pytest.fixture
def documented(working_folder: Path) -> None:
    """Create the example of the page: a firmware with two fields swapped and one renamed, and an older package.

    Another package has a new field that is not committed.
    """
    firmware, package = working_folder / "PX4-Autopilot", working_folder / "src" / "px4_msgs"
    for name in ("msg", "srv"):
        shutil.copytree(ROOT / name, firmware / name)
        (package / name).mkdir(parents=True)
    (package / "package.xml").write_text("<package><name>px4_msgs</name></package>")
    for path in (*DEFINITIONS, *(ROOT / "srv").glob("*.srv")):
        shutil.copy(path, package / path.suffix[1:])
    commit_all(firmware)
    run(firmware, "git", "tag", "v1.17.0")
    setpoint, armed = (firmware / "msg" / name for name in ("versioned/TrajectorySetpoint.msg", "ActuatorArmed.msg"))
    setpoint.write_text(swap(setpoint.read_text(encoding="utf-8"), "acceleration", "jerk"), encoding="utf-8")
    armed.write_text(armed.read_text(encoding="utf-8").replace("bool kill ", "bool killed "), encoding="utf-8")
    rotor = "uint64 timestamp\nfloat32 vibration\n"
    own = {"package.xml": "<package><name>acme_msgs</name></package>", "msg/RotorHealth.msg": rotor}
    commit_all(write_definitions(working_folder / "src" / "acme_msgs", own))
    (working_folder / "src/acme_msgs/msg/RotorHealth.msg").write_text(f"{rotor}float32 temperature\n")


def console(command: str) -> list[str]:
    """Return the lines that the page shows below a command."""
    lines = next(block for block in CONSOLE if block[0].startswith(command))[1:]
    return lines[: next((index for index, line in enumerate(lines) if line.startswith("$ ")), len(lines))]


@pytest.mark.slow
@pytest.mark.tools("git")
@pytest.mark.parametrize("command", [block[0] for block in CONSOLE if block[0].startswith("$ msggen ")])
@pytest.mark.usefixtures("documented")
def test_the_page_shows_what_the_commands_print(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    code = main(command.split()[2:])
    told = capsys.readouterr()
    assert code == (2 if told.err else 1)
    assert [*told.out.splitlines(), *told.err.splitlines()] == console(command)


@pytest.mark.slow
@pytest.mark.tools("git")
@pytest.mark.usefixtures("documented")
def test_the_page_shows_what_the_hook_prints(capsys: pytest.CaptureFixture[str]) -> None:
    shown = console("$ git commit")
    hooks = next(each for each in snippets() if "repos" in each)["repos"][0]["hooks"]
    assert main(["check", *hooks[0]["args"]]) == 1
    assert shown[shown.index("") + 1 :] == capsys.readouterr().out.splitlines()


def snippets() -> list[Any]:
    return [yaml.safe_load(text) for text in re.findall(r"```yaml\n(.*?)```", PAGE, re.DOTALL)]


def test_the_snippets_see_warnings_and_commits_of_submodules() -> None:
    """Only `--strict` fails for a changed unit, and only `always_run` sees a new commit of a submodule."""
    hooks = {hook["id"]: hook for hook in next(each for each in snippets() if "repos" in each)["repos"][0]["hooks"]}
    assert "--strict" in hooks["msggen-check"]["args"]
    assert all(hook.get("always_run") for hook in hooks.values() if "PX4-Autopilot" in hook["args"])
    blocks = re.findall(r"```(?:yaml|groovy)\n(.*?)```", PAGE, re.DOTALL)
    checks = [line for block in blocks for line in block.splitlines() if "PX4-Autopilot src/px4_msgs" in line]
    assert len(checks) == 4
    assert all("--strict" in line for line in checks)


def test_the_snippets_name_hooks_and_inputs_that_exist() -> None:
    known = {hook["id"] for hook in yaml.safe_load((ROOT / HOOKS).read_text())}
    hooks = next(each for each in snippets() if "repos" in each)["repos"][0]["hooks"]
    assert {hook["id"] for hook in hooks} == known
    steps = next(each for each in snippets() if "jobs" in each)["jobs"]["messages"]["steps"]
    given = [set(step["with"]) for step in steps if "msggen" in step["uses"]]
    assert given
    assert set().union(*given) <= set(ACTION["inputs"])
