"""A catalog in the form that the firmware's own tools use for its identities."""

from __future__ import annotations

from typing import Any

from msggen.definitions.identity import endpoints, message_hash, type_hash, uorb_topics
from msggen.definitions.layout import lay_out, struct_size
from msggen.definitions.model import Catalog, Direction


def uorb_of(catalog: Catalog) -> dict[str, Any]:
    ids = {topic.name: topic.orb_id for topic in uorb_topics(catalog)}
    messages = {
        message.name: {
            "cdr_size": lay_out(catalog, message).size,
            "message_hash": message_hash(catalog, message),
            "orb_ids": {topic: ids[topic] for topic in sorted(message.topic_names)},
            "queue_length": message.queue_length,
            "struct_size_no_padding": struct_size(catalog, message),
            "topics": list(message.topic_names),
        }
        for message in catalog.messages.values()
    }
    return {"messages": messages, "orb_ids": ids}


def dds_of(catalog: Catalog) -> list[dict[str, Any]]:
    return [
        {
            "direction": endpoint.entry.direction.value,
            "yaml_topic": endpoint.entry.topic,
            "type": endpoint.message.name,
            "dds_topic": endpoint.dds_name,
            "dds_type": endpoint.message.dds_type,
            "message_version": endpoint.message.message_version,
            "object_id": endpoint.object_id,
            "cdr_size": lay_out(catalog, endpoint.message).size,
            "rate_limit_hz": endpoint.entry.rate_limit_hz,
            "publish_interval_ms": endpoint.publish_interval_ms,
            "instance": endpoint.entry.instance,
            "orb_topic": endpoint.entry.uorb_topic,
            "queue_depth": endpoint.reader_qos.depth if endpoint.entry.direction is Direction.IN else None,
            "multi": endpoint.entry.multi,
            "route_field": endpoint.entry.route_field,
            "max_instances": endpoint.entry.max_instances,
        }
        for endpoint in endpoints(catalog)
    ]


def rihs01_of(catalog: Catalog) -> dict[str, str]:
    return {message.name: type_hash(catalog, message) for message in catalog.messages.values()}


UNCHECKED = {"orb_id", "object_id_unconditional"}
"""Columns computed by the firmware that do not describe an endpoint."""


def assert_same_endpoints(found: list[dict[str, Any]], expected: list[dict[str, Any]]) -> None:
    """Compare with the results of the firmware, which have more columns in newer releases."""
    columns = expected[0].keys() - UNCHECKED
    assert columns <= found[0].keys()
    assert [{key: entry[key] for key in columns} for entry in found] == [
        {key: entry[key] for key in columns} for entry in expected
    ]
