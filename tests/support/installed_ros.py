"""A fixture with a ROS that has px4_msgs."""

from __future__ import annotations

from pathlib import Path

import pytest

from support.installed import install_release


@pytest.fixture
def ros(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """A folder in the place of /opt/ros, with px4_msgs."""
    monkeypatch.delenv("AMENT_PREFIX_PATH", raising=False)
    monkeypatch.setattr("msggen.sources.installed._SYSTEM", str(tmp_path))
    install_release(tmp_path / "kilted/share", "v1.18")
    return str(tmp_path)
