"""What the values of a receiver of satellites mean."""

from __future__ import annotations

HAS_FIX = 3
"""The smallest `fix_type` with a position in three dimensions."""
