"""The routes with which a session without a record is continued."""

from __future__ import annotations

from msggen.link.xrce.continuation import joined

__all__ = ["joined"]
