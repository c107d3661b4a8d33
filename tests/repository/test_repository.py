"""Tests of the files for contributors and for GitHub: paths, versions and URLs agree, and workflows are valid."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from datetime import datetime, timezone
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import pytest
import yaml

from msggen.base.version import __version__
from support.interpreters import VERSIONS
from support.repository import ROOT

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

GITHUB = ROOT / ".github"
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
PYTHONS = [line.rpartition(" ")[2] for line in PROJECT["classifiers"] if "Python :: 3." in line]


def load(path: Path) -> Any:
    return yaml.safe_load(path.read_text(encoding="utf-8"))


# --- paths in the prose

PLACEHOLDERS = re.compile(r"LANGUAGE|PRECISION_CHANGED|DEFAULT_CHANGED|checkstyle|ulog|/idl|test_idl")
"""Files in the examples that do not exist, because a contributor would add them."""
INPUTS = {"dds_topics.yaml", "metadata.yaml"}
"""Files that msggen reads, of a firmware or a recording."""


@pytest.mark.parametrize("page", ["CONTRIBUTING.md", "SECURITY.md", "docs/library.md"])
def test_the_files_that_a_page_names_are_there(page: str) -> None:
    text = re.sub(r"```.*?```", "", (ROOT / page).read_text(encoding="utf-8"), flags=re.DOTALL)
    folders = r"(?:msggen|templates|tests|docs|generated|benchmarks|examples|\.ci|\.github)"
    named = set(re.findall(rf"`({folders}/[\w./-]*)`", text)) | set(
        re.findall(r"`(\.?[\w-]+\.(?:md|toml|yaml))`", text)
    )
    named = {path for path in named if not PLACEHOLDERS.search(path) and path not in INPUTS}
    links = re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", text)
    assert len(named) + len(links) > 0
    missing = {path for path in named if not (ROOT / path).exists()}
    missing |= {link for link in links if not ((ROOT / page).parent / link).exists()}
    assert missing == set()


# --- Python versions and URLs


def test_the_versions_of_python_agree() -> None:
    assert PROJECT["requires-python"] == f">={PYTHONS[0]}"
    assert load(GITHUB / "workflows" / "ci.yml")["jobs"]["test"]["strategy"]["matrix"]["python"] == PYTHONS
    assert VERSIONS == PYTHONS
    assert f"Python {PYTHONS[0]} to {PYTHONS[-1]}." in (ROOT / "README.md").read_text(encoding="utf-8")


def test_readme_lists_the_extras() -> None:
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    table = readme.partition("| extra | for |")[2].partition("\n\n")[0]
    listed = re.findall(r"^\| `(\w+)` ", table, re.MULTILINE)
    assert {*listed, "site", "test"} == PROJECT["optional-dependencies"].keys()


def test_every_url_of_the_repository_is_the_same() -> None:
    repository = PROJECT["urls"]["Repository"]
    files = [*ROOT.glob("*.md"), ROOT / "docs" / "ci.md", *GITHUB.rglob("*.*")]
    texts = [path.read_text(encoding="utf-8") for path in files if path.is_file()]
    found = [
        url for text in (*texts, *PROJECT["urls"].values()) for url in re.findall(r"https://github\.com/[\w/-]+", text)
    ]
    assert len(found) > len(PROJECT["urls"])
    assert [url for url in found if not url.startswith(repository)] == []


# --- workflows

SCHEMAS = {
    "workflows/*.yml": "vendor.github-workflows",
    "ISSUE_TEMPLATE/[!c]*.yml": "vendor.github-issue-forms",
    "ISSUE_TEMPLATE/config.yml": "vendor.github-issue-config",
    "dependabot.yml": "vendor.dependabot",
}


@pytest.mark.slow
@pytest.mark.parametrize("pattern", SCHEMAS)
def test_the_files_for_github_keep_to_their_schemas(pattern: str) -> None:
    pytest.importorskip("check_jsonschema")
    files = [str(path) for path in GITHUB.glob(pattern)]
    command = [sys.executable, "-m", "check_jsonschema", "--builtin-schema", SCHEMAS[pattern], *files]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def test_every_file_for_github_has_a_schema() -> None:
    known = {path for pattern in SCHEMAS for path in GITHUB.glob(pattern)}
    assert {*GITHUB.rglob("*.yml")} == known


@pytest.mark.parametrize("path", sorted((GITHUB / "workflows").iterdir()), ids=lambda path: path.name)
def test_workflows_may_do_no_more_than_they_need(path: Path) -> None:
    workflow = load(path)
    assert workflow["permissions"] == {"contents": "read"}
    allowed = {
        "attest": {"id-token": "write", "attestations": "write"},
        "publish": {"id-token": "write"},
        "release": {"contents": "write"},
        "pages": {"pages": "write", "id-token": "write"},
    }
    for name, job in workflow["jobs"].items():
        assert job.get("permissions") == allowed.get(name)
        for step in job.get("steps", ()):
            if "uses" in step:
                assert re.fullmatch(r"[\w-]+/[\w-]+@(?:v\d+|release/v\d+)", step["uses"])
            assert "${{" not in step.get("run", ""), "an expression in a script is code"


def test_ci_runs_the_command_for_ci() -> None:
    runs = [step.get("run") for step in load(GITHUB / "workflows" / "ci.yml")["jobs"]["test"]["steps"]]
    assert ".ci/run $OPTIONS" in runs


def test_ci_builds_the_site_and_a_release_publishes_it() -> None:
    steps = load(GITHUB / "workflows" / "ci.yml")["jobs"]["site"]["steps"]
    (build,) = (step["run"] for step in steps if "build_site.py" in step.get("run", ""))
    (kept,) = (step["with"]["path"] for step in steps if "upload-pages-artifact" in step.get("uses", ""))
    assert build.endswith(f"python docs/product/build_site.py -o {kept}\n")
    release = load(GITHUB / "workflows" / "release.yml")["jobs"]
    assert any("deploy-pages" in step["uses"] for step in release["pages"]["steps"])
    assert release["pages"]["needs"] == "publish", "a page shows what is on PyPI"
    assert "publish" in needed_by(release, "pages")
    assert "test" in needed_by(release, "pages"), "the job whose artifact is published"


def needed_by(jobs: dict[str, Any], job: str) -> set[str]:
    """Return the jobs that have to pass before this one starts."""
    needs = jobs[job].get("needs", [])
    direct = {needs} if isinstance(needs, str) else {*needs}
    return direct.union(*(needed_by(jobs, each) for each in direct))


def test_a_release_is_built_once_tested_and_attested_before_it_is_published() -> None:
    jobs = load(GITHUB / "workflows" / "release.yml")["jobs"]
    assert needed_by(jobs, "publish") == {"test", "build", "wheel", "image", "attest"}
    assert {"test", "wheel", "image"} <= needed_by(jobs, "attest")
    built = [name for name, job in jobs.items() for step in job.get("steps", ()) if "-m build" in step.get("run", "")]
    assert built == ["build"]
    (kept,) = (step["with"]["path"] for step in jobs["build"]["steps"] if "upload-artifact" in step.get("uses", ""))
    for name in ("wheel", "image", "attest", "publish", "release"):
        (taken,) = (step["with"] for step in jobs[name]["steps"] if "download-artifact" in step.get("uses", ""))
        assert taken == {"name": "release", "path": kept}
    (attested,) = (step["with"] for step in jobs["attest"]["steps"] if "/attest-" in step["uses"])
    (published,) = (step["with"] for step in jobs["publish"]["steps"] if "pypi-publish" in step["uses"])
    assert attested["subject-path"] == f"{published['packages-dir']}/*" == f"{kept}/dist/*"
    assert published["attestations"] is True


def test_a_release_tries_the_wheel_where_ci_tests() -> None:
    release, ci = (load(GITHUB / "workflows" / name)["jobs"] for name in ("release.yml", "ci.yml"))
    assert release["wheel"]["strategy"]["matrix"] == ci["test"]["strategy"]["matrix"]


@pytest.mark.parametrize("workflow", ["nightly", "release"])
def test_the_night_and_a_release_run_all_tests(workflow: str) -> None:
    job = load(GITHUB / "workflows" / f"{workflow}.yml")["jobs"]["test"]
    assert job == {"uses": "./.github/workflows/ci.yml", "with": {"options": "--all"}}


@pytest.mark.skipif(sys.platform == "win32", reason="the campaigns need fork and limits of resources")
@pytest.mark.parametrize("given", ["", "7"], ids=["by the date", "by hand"])
def test_the_nightly_run_takes_the_date_as_seed_and_keeps_what_fails(given: str, tmp_path: Path) -> None:
    from fuzz.__main__ import _parser

    job = load(GITHUB / "workflows" / "nightly.yml")["jobs"]["fuzz"]
    (script,) = (step["run"] for step in job["steps"] if "SEED" in step.get("env", ()))
    (kept,) = (step["with"]["path"] for step in job["steps"] if step.get("if") == "failure()")
    (tmp_path / "python").write_text('#!/bin/sh\nprintf "%s\\n" "$@"\n', encoding="utf-8")
    (tmp_path / "python").chmod(0o755)
    environment = {"PATH": os.pathsep.join([str(tmp_path), os.environ["PATH"]]), "SEED": given}
    days = [f"{datetime.now(timezone.utc):%Y%m%d}"]
    words = subprocess.check_output(["bash", "-e", "-c", script], env=environment, text=True).split()
    days.append(f"{datetime.now(timezone.utc):%Y%m%d}")
    assert words[:2] == ["-m", "tests.fuzz"]
    options = _parser().parse_args(words[2:])
    assert str(options.seed) in ([given] if given else days)
    assert (options.campaigns, str(options.output)) == ([], kept)
    assert options.minutes + 10 < job["timeout-minutes"]


@pytest.mark.parametrize("script", ["run", "portable"])
def test_the_scripts_of_ci_are_bash_and_can_be_run(script: str) -> None:
    path = ROOT / ".ci" / script
    assert os.access(path, os.X_OK)
    assert subprocess.run(["bash", "-n", str(path)], check=False).returncode == 0


CHANGELOG = """# Changelog

## [{section}] - {date}

### Added

- A thing.

## [0.0.1] - 2026-01-01

- An older thing.
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("tag", "version", "section", "date", "code"),
    [
        ("v2.0.0", "2.0.0", "2.0.0", "2026-12-01", 0),
        ("v2.0.0rc1", "2.0.0rc1", "2.0.0", "unreleased", 0),
        ("v2.0.0rc1", "2.0.0rc1", "2.0.0", "2026-12-01", 0),
        ("v2.0.01", "2.0.0", "2.0.0", "2026-12-01", 1),
        ("v2.0.0", "2.0.0rc1", "2.0.0", "2026-12-01", 1),
        ("2.0.0", "2.0.0", "2.0.0", "2026-12-01", 1),
        ("v2.0.0", "2.0.0", "2.0.0", "unreleased", 1),
        ("v2.0.0", "2.0.0", "9.9.9", "2026-12-01", 1),
        ("v2.0.0rc1", "2.0.0rc1", "9.9.9", "unreleased", 1),
    ],
    ids=[
        *("right", "a candidate", "a candidate, with a date", "another version", "a version that is a candidate"),
        *("without v", "without a date", "not in the changelog", "a candidate that is not in the changelog"),
    ],
)
def test_a_release_needs_its_tag_its_version_and_its_changes(  # noqa: PLR0913, PLR0917
    tag: str, version: str, section: str, date: str, code: int, tmp_path: Path
) -> None:
    steps = load(GITHUB / "workflows" / "release.yml")["jobs"]["build"]["steps"]
    (script,) = (step["run"] for step in steps if step.get("name", "").startswith("Compare the tag"))
    (tmp_path / "CHANGELOG.md").write_text(CHANGELOG.format(section=section, date=date), encoding="utf-8")
    (tmp_path / "msggen.py").write_text(f"__version__ = {version!r}\n", encoding="utf-8")
    (tmp_path / "python").symlink_to(sys.executable)
    path = os.pathsep.join([str(tmp_path), os.environ["PATH"]])
    done = subprocess.run(
        ["bash", "-eo", "pipefail", "-c", script],
        cwd=tmp_path,
        env={"PATH": path, "GITHUB_REF_NAME": tag},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == code, done.stdout + done.stderr
    assert done.stdout.startswith("::error::") == bool(code)
    if not code:
        notes = (tmp_path / "build" / "release" / "notes.md").read_text(encoding="utf-8")
        assert notes.strip() == "### Added\n\n- A thing."


VERSION = re.compile(
    r"(?:^(?:\*\*)?msggen |msggen(?:\.git)?[-@#]v?|`@v|rev: v|git (?:tag|checkout -q) v)(\d+\.\d+\.\d+(?:rc\d+)?)",
    re.MULTILINE,
)
"""The version of msggen, as pages have it: in tags, the names of files, and what `msggen --version` prints."""


def test_the_version_is_the_same_wherever_it_is_written() -> None:
    release = re.fullmatch(r"(\d+\.\d+\.\d+)(?:rc\d+)?", __version__)
    assert release, "action.yml and release.yml read no other versions"
    changelog = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert re.search(r"^## \[(.*?)\]", changelog, re.MULTILINE)[1] == release[1]  # type: ignore[index]
    texts = [path.read_text(encoding="utf-8") for path in (ROOT / "CONTRIBUTING.md", *(ROOT / "docs").glob("*.md"))]
    used = {version for text in texts for version in VERSION.findall(text)}
    assert used == {__version__}


# --- the image


def test_the_image_is_built_from_what_is_there() -> None:
    text = re.sub(r"^#.*\n", "", (ROOT / "Dockerfile").read_text(encoding="utf-8"), flags=re.MULTILINE)
    lines = text.replace("\\\n", " ").split("\n")
    words = [line.partition(" ")[::2] for line in lines if line.strip()]
    assert [word for word, _ in words] == ["FROM", "RUN", "ARG", "RUN", "USER", "WORKDIR", "ENTRYPOINT"]
    values = dict(words)
    assert re.fullmatch(rf"python:({'|'.join(PYTHONS)})-slim".replace(".", r"\."), values["FROM"])
    assert values["ARG"] == "PACKAGE=."
    assert "useradd --create-home --uid 1000 msggen" in words[1][1]
    assert values["USER"] == "msggen"
    assert values["ENTRYPOINT"] == '["msggen"]'
    assert "msggen" in PROJECT["scripts"]
    assert "--no-cache-dir" in values["RUN"]
    assert "rm -rf /var/lib/apt/lists/*" in words[1][1]
    (mounted,) = re.findall(r"--mount=type=bind,target=(\S+)", values["RUN"])
    assert values["RUN"].endswith(f'"{mounted}/$PACKAGE"')


def test_nothing_that_is_built_is_hidden_from_the_image() -> None:
    hatch = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["hatch"]["build"]["targets"]
    built = [*hatch["wheel"]["packages"], *hatch["wheel"]["force-include"], "pyproject.toml", PROJECT["readme"]]
    hidden = (ROOT / ".dockerignore").read_text(encoding="utf-8").split()
    names = {path.name for each in built for path in (ROOT / each, *(ROOT / each).rglob("*"))} | {"build", "dist"}
    found = {name for name in names for pattern in hidden if fnmatch(name, pattern.removeprefix("**/"))}
    assert found <= {"__pycache__", *(name for name in names if name.endswith("_cache"))}
    release = load(GITHUB / "workflows" / "release.yml")["jobs"]
    (script,) = (step["run"] for step in release["image"]["steps"] if "run" in step)
    assert 'docker build --tag msggen --build-arg PACKAGE="$(echo build/release/dist/*.whl)" .' in script


def test_pre_commit_accepts_our_own_hooks() -> None:
    command = [sys.executable, "-m", "pre_commit", "validate-config", ".pre-commit-config.yaml"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
