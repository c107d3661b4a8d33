"""The list of what can happen on a link."""

from __future__ import annotations

from typing import get_type_hints

import pytest

from msggen.link.link import METHODS, Event, Listener


@pytest.mark.parametrize("event", METHODS)
def test_a_listener_has_a_method_with_the_fields_of_each_event(event: type[Event]) -> None:
    fields = get_type_hints(event)
    assert list(get_type_hints(getattr(Listener, METHODS[event])).items()) == [*fields.items(), ("return", type(None))]


def test_a_listener_has_no_other_method() -> None:
    assert [name for name in vars(Listener) if not name.startswith("_")] == list(METHODS.values())
