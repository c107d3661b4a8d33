"""All rules, and how they are asked."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from functools import partial

from msggen.compare import drift, hash_names, semantic, source_code, topic, version, wire
from msggen.compare.comparison import Comparison
from msggen.compare.finding import Category, Finding, Rule, Severity
from msggen.tags import COMPARED

_WIRE, _HASH, _SOURCE, _SEMANTIC = Category.WIRE, Category.HASH, Category.SOURCE, Category.SEMANTIC
_TOPIC, _VERSION, _DRIFT = Category.TOPIC, Category.VERSION, Category.DRIFT

RULES = (
    Rule("FIELD_ADDED", "a field was added", _WIRE, wire.find_added),
    Rule("FIELD_REMOVED", "a field was removed", _WIRE, wire.find_removed),
    Rule("FIELD_MOVED", "a field changed places with others", _WIRE, wire.find_moved),
    Rule("FIELD_RETYPED", "a field has another type", _WIRE, wire.find_retyped),
    Rule("ARRAY_LENGTH_CHANGED", "an array has another length", _WIRE, wire.find_other_length),
    Rule("NESTED_LAYOUT_CHANGED", "values of a nested message, at any depth, lie elsewhere", _WIRE, wire.find_nested),
    Rule("FIELD_RENAMED", "a field has another name, in the same bytes", _HASH, hash_names.find_renamed),
    Rule(
        "TYPE_RENAMED",
        "a type has another name, and the same values in the same bytes",
        _HASH,
        hash_names.find_renamed_type,
    ),
    Rule("NESTED_NAME_CHANGED", "a name in a nested message, at any depth, is another", _HASH, hash_names.find_nested),
    Rule("MESSAGE_REMOVED", "a message is gone", _SOURCE, source_code.find_removed_messages),
    Rule(
        "MESSAGE_RENAMED",
        "a message has another name, and the same definition",
        _SOURCE,
        source_code.find_renamed_messages,
    ),
    Rule("SERVICE_REMOVED", "a service is gone", _SOURCE, source_code.find_removed_services),
    Rule("CONSTANT_REMOVED", "a constant is gone", _SOURCE, source_code.find_removed_constants),
    Rule("CONSTANT_VALUE_CHANGED", "a constant has another value", _SOURCE, source_code.find_other_values),
    Rule("CONSTANT_TYPE_CHANGED", "a constant has another type", _SOURCE, source_code.find_other_types),
    *(
        Rule(f"{tag.name.upper()}_CHANGED", tag.purpose, _SEMANTIC, partial(semantic.find_changed, tag))
        for tag in COMPARED
    ),
    Rule("TOPIC_REMOVED", "a topic is no longer bridged", _TOPIC, topic.find_removed),
    Rule("TOPIC_RETYPED", "a topic carries another message", _TOPIC, topic.find_retyped),
    Rule("TOPIC_MOVED", "a topic is bridged under another name", _TOPIC, topic.find_moved),
    Rule("TOPIC_RENAMED", "ROS 2 sees a topic under another name, as of another version", _TOPIC, topic.find_renamed),
    Rule(
        "RATE_LIMIT_CHANGED",
        "a topic is sent at another rate",
        _TOPIC,
        topic.find_other_rate,
        severity=Severity.WARNING,
    ),
    Rule("ROUTE_CHANGED", "samples reach other uORB instances, or fewer", _TOPIC, topic.find_other_route),
    Rule(
        "OPTIONS_CHANGED",
        "Zenoh's client publishes a topic with other options",
        _TOPIC,
        topic.find_other_options,
        severity=Severity.WARNING,
    ),
    Rule(
        "VERSION_NOT_RAISED",
        "a versioned message changed, its version not step by step",
        _VERSION,
        version.find_not_raised,
    ),
    Rule("VERSION_NEEDLESS", "a version changed, the message did not", _VERSION, version.find_needless),
    Rule(
        "VERSION_REMOVED",
        "a message is versioned no more, or an archived version is gone",
        _VERSION,
        version.find_removed,
    ),
    Rule("VERSION_NOT_ARCHIVED", "the old version is not in px4_msgs_old", _VERSION, version.find_not_archived),
    Rule("TRANSLATION_MISSING", "no header translates from the old version", _VERSION, version.find_not_translated),
    Rule(
        "TRANSLATION_UNFINISHED",
        "a header leaves out a field, or has a TODO",
        _VERSION,
        version.find_unfinished_translations,
        severity=Severity.WARNING,
    ),
    Rule("DEFINITION_ADDED", "a message or service that the other side lacks", _DRIFT, drift.find_added_definitions),
    Rule("CONSTANT_ADDED", "a constant that the other side lacks", _DRIFT, drift.find_added_constants),
    Rule("VERSION_DIFFERS", "a message of another version", _DRIFT, drift.find_other_versions),
)
"""In the order in which they are listed and asked."""

CHECKED = tuple(
    replace(rule, severity=Severity.WARNING) if rule.category is _SEMANTIC else rule
    for rule in RULES
    if rule.category is not _VERSION
)
"""What `check` asks: do two sides mean the same? It only warns of comments. Topics count where both have a bridge."""

BREAKING = tuple(rule for rule in RULES if rule.category is not _DRIFT)
"""What `breaking` asks: whom does a change hurt?"""


def named(name: str) -> tuple[Rule, ...]:
    """Return the rules of a category, the rule of an ID, or nothing where there is neither."""
    return tuple(rule for rule in RULES if name in (rule.id, rule.category.name))


def find(comparison: Comparison, rules: Sequence[Rule]) -> Iterator[Finding]:
    """Ask `rules`, in their order, and mark what is silent or handled."""
    handled = version.handled(comparison)
    silent = {pair.name: pair.misread_by for pair in comparison.changed}
    topics = _topics_of(comparison, handled)
    for rule in rules:
        for change in rule.find(comparison):
            finding = Finding(rule, change)
            if rule.category is Category.WIRE:
                finding = replace(finding, silent_for=silent.get(change.subject, ()))
            if rule.category in (Category.WIRE, Category.HASH, Category.SOURCE):
                finding = replace(finding, is_handled=change.subject in handled)
            if rule.id == "TOPIC_RENAMED":
                finding = replace(finding, is_handled=change.subject in topics)
            yield finding


def _topics_of(comparison: Comparison, messages: Collection[str]) -> set[str]:
    """Return the topics that carry `messages`: a new version renames them, and the translation serves the old name."""
    return {entry.topic for entry in comparison.current.catalog.bridge if entry.message_name in messages}
