"""Definitions as objects of JSON: messages and services with what their fields mean, and a search in them."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from typing import Any

from msggen.base.diagnostics import input_error, suggestion
from msggen.definitions.enumeration import enumerations
from msggen.definitions.identity import Endpoint, endpoints, message_hash, type_hash
from msggen.definitions.layout import is_static, lay_out
from msggen.definitions.model import SPECIAL, Catalog, Message, Service
from msggen.sources.catalog import read_catalog
from msggen.sources.embedded import EMBEDDED, unknown_release
from msggen.sources.finding import find_sources
from msggen.sources.inferred import with_inferred
from msggen.sources.released import embedded


class Definitions:
    """The definitions of a firmware, and of the embedded releases. `px4` names the firmware, "" the newest release."""

    def __init__(self, px4: str = "") -> None:
        self._own = px4 or EMBEDDED[0]

    def definition(self, name: str, release: str) -> dict[str, Any]:
        """Return a message or a service, also by one of its topics. Raises InputError for an unknown name."""
        catalog = self._catalog(release)
        known: dict[str, Message | Service] = {each.name: each for each in catalog.services}
        for each in catalog.uorb_messages:
            known |= dict.fromkeys((each.name, each.ros_type, *each.topic_names), each)
        known |= {each.ros_name: each.message for each in endpoints(catalog)}
        if name not in known:
            hint = suggestion(name, known) or ": the tool `search` finds names by words"
            raise input_error("definition", "C104", f"nothing is called '{name}' in {release or self._own}{hint}", 0)
        chosen = known[name]
        return _message(catalog, chosen) if isinstance(chosen, Message) else _service(chosen)

    def search(self, words: str, release: str) -> Iterator[dict[str, str]]:
        """Yield messages, fields and constants whose names or comments have all words. Raises InputError."""
        wanted = words.lower().split()
        for message in self._catalog(release).uorb_messages:
            rows = [("", message.comment)]
            rows += [(f".{each.name}", each.comment.text) for each in message.fields]
            rows += [(f".{each.name}", each.comment.text) for each in message.constants]
            for name, comment in rows:
                own, whole = f"{name} {comment}".lower(), f"{message.name}{name} {comment}".lower()
                if all(word in whole for word in wanted) and any(word in (own if name else whole) for word in wanted):
                    yield {"name": f"{message.name}{name}", "comment": comment}

    def _catalog(self, release: str) -> Catalog:
        if release and (problem := unknown_release(release)):
            raise input_error(release, "S105", problem, 0)
        return _catalog_of(release or self._own)


@lru_cache(len(EMBEDDED) + 1)
def _catalog_of(source: str) -> Catalog:
    sources = find_sources(source)
    return with_inferred(read_catalog(sources), sources)


def _message(catalog: Catalog, message: Message) -> dict[str, Any]:
    versions = {each: found.message.message_version for each in EMBEDDED if (found := embedded(each, message.name))}
    own = [each for each in endpoints(catalog) if each.message is message]
    return {
        "message": message.name,
        "type": message.ros_type,
        "comment": message.comment,
        "version": message.message_version,
        "versions": versions,
        "size": lay_out(catalog, message).size if is_static(catalog, message) else None,
        "message_hash": f"{message_hash(catalog, message):#010x}",
        "type_hash": type_hash(catalog, message),
        "topics": list(message.topic_names),
        "endpoints": list(map(_endpoint, own)),
        **_contents(message),
    }


def _service(service: Service) -> dict[str, Any]:
    halves = {"request": _contents(service.request), "response": _contents(service.response)}
    return {"service": service.name, "comment": service.comment, **halves}


def _endpoint(endpoint: Endpoint) -> dict[str, Any]:
    return {
        "name": endpoint.ros_name,
        "topic": endpoint.entry.uorb_topic,
        "direction": endpoint.entry.direction.value,
        "publish_interval_ms": endpoint.publish_interval_ms,
    }


def _contents(message: Message) -> dict[str, Any]:
    """Return the fields with units, ranges and frames, the enums, and the constants of none."""
    enums = enumerations(message)
    named = {member.constant.name for each in enums for member in each.members}
    return {
        "fields": [
            {
                "name": each.name,
                "type": str(each.type),
                **dict(each.comment.attributes),
                "comment": each.comment.text,
                "enums": [enum.name for enum in enums if each.name in enum.fields],
            }
            for each in message.fields
        ],
        "enums": {
            each.name: {"flags": each.is_flags, "values": {member.name: member.value for member in each.members}}
            for each in enums
        },
        "constants": {each.name: each.value for each in message.constants if each.name not in (*SPECIAL, *named)},
    }
