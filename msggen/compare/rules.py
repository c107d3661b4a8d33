"""The table of all rules, and the function that applies them."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import replace
from functools import partial

from msggen.compare import drift, hash_names, semantic, source_code, topic, version, wire
from msggen.compare.comparison import Comparison, depth
from msggen.compare.finding import Category, Finding, Report, Rule, Severity
from msggen.tags import COMPARED

_WIRE, _HASH, _SOURCE, _SEMANTIC = Category.WIRE, Category.HASH, Category.SOURCE, Category.SEMANTIC
_TOPIC, _VERSION, _DRIFT = Category.TOPIC, Category.VERSION, Category.DRIFT

RULES = (
    Rule("FIELD_ADDED", "a field was added", _WIRE, wire.find_added),
    Rule("FIELD_REMOVED", "a field was removed", _WIRE, wire.find_removed),
    Rule("FIELD_MOVED", "the order of fields changed", _WIRE, wire.find_moved),
    Rule("FIELD_RETYPED", "the type of a field changed", _WIRE, wire.find_retyped),
    Rule("ARRAY_LENGTH_CHANGED", "the length of an array changed", _WIRE, wire.find_other_length),
    Rule("NESTED_LAYOUT_CHANGED", "the layout of a nested message changed, at any depth", _WIRE, wire.find_nested),
    Rule("FIELD_RENAMED", "a field was renamed; its bytes are the same", _HASH, hash_names.find_renamed),
    Rule(
        "TYPE_RENAMED",
        "the type of a field was renamed; its bytes and values are the same",
        _HASH,
        hash_names.find_renamed_type,
    ),
    Rule("NESTED_NAME_CHANGED", "a name in a nested message changed, at any depth", _HASH, hash_names.find_nested),
    Rule("MESSAGE_REMOVED", "a message was removed", _SOURCE, source_code.find_removed_messages),
    Rule(
        "MESSAGE_RENAMED",
        "a message was renamed; its definition is the same",
        _SOURCE,
        source_code.find_renamed_messages,
    ),
    Rule("SERVICE_REMOVED", "a service was removed", _SOURCE, source_code.find_removed_services),
    Rule("CONSTANT_REMOVED", "a constant was removed", _SOURCE, source_code.find_removed_constants),
    Rule("CONSTANT_VALUE_CHANGED", "the value of a constant changed", _SOURCE, source_code.find_other_values),
    Rule("CONSTANT_TYPE_CHANGED", "the type of a constant changed", _SOURCE, source_code.find_other_types),
    *(
        Rule(f"{tag.name.upper()}_CHANGED", tag.purpose, _SEMANTIC, partial(semantic.find_changed, tag))
        for tag in COMPARED
    ),
    Rule("TOPIC_REMOVED", "a topic is no longer bridged", _TOPIC, topic.find_removed),
    Rule("TOPIC_RETYPED", "the message of a topic changed", _TOPIC, topic.find_retyped),
    Rule("TOPIC_MOVED", "a topic is bridged under another name or in the other direction", _TOPIC, topic.find_moved),
    Rule(
        "TOPIC_RENAMED", "the ROS 2 name of a topic changed, for example its version suffix", _TOPIC, topic.find_renamed
    ),
    Rule(
        "RATE_LIMIT_CHANGED",
        "the rate limit of a topic changed",
        _TOPIC,
        topic.find_other_rate,
        severity=Severity.WARNING,
    ),
    Rule("ROUTE_CHANGED", "samples of a topic reach other or fewer uORB instances", _TOPIC, topic.find_other_route),
    Rule(
        "OPTIONS_CHANGED",
        "the options of a topic for Zenoh's client changed",
        _TOPIC,
        topic.find_other_options,
        severity=Severity.WARNING,
    ),
    Rule(
        "VERSION_NOT_RAISED",
        "a versioned message changed, but its version was not raised step by step",
        _VERSION,
        version.find_not_raised,
    ),
    Rule(
        "VERSION_NEEDLESS", "the version of a message changed, but the message did not", _VERSION, version.find_needless
    ),
    Rule(
        "VERSION_REMOVED",
        "a message is no longer versioned, or an archived version was removed",
        _VERSION,
        version.find_removed,
    ),
    Rule(
        "VERSION_NOT_ARCHIVED",
        "the previous version is not archived in px4_msgs_old",
        _VERSION,
        version.find_not_archived,
    ),
    Rule(
        "TRANSLATION_MISSING", "no header translates from the previous version", _VERSION, version.find_not_translated
    ),
    Rule(
        "TRANSLATION_INVALID",
        "a translation header names a field that its version of the message does not have",
        _VERSION,
        version.find_invalid_translations,
    ),
    Rule(
        "TRANSLATION_UNFINISHED",
        "a translation header leaves out a field or has a TODO",
        _VERSION,
        version.find_unfinished_translations,
        severity=Severity.WARNING,
    ),
    Rule("DEFINITION_ADDED", "a message or service is only on the current side", _DRIFT, drift.find_added_definitions),
    Rule("CONSTANT_ADDED", "a constant is only on the current side", _DRIFT, drift.find_added_constants),
    Rule("VERSION_DIFFERS", "the version of a message differs", _DRIFT, drift.find_other_versions),
)
"""All rules, in the order in which they are listed and applied."""

CHECKED = tuple(
    replace(rule, severity=Severity.WARNING) if rule.category is _SEMANTIC else rule
    for rule in RULES
    if rule.category is not _VERSION
)
"""The rules of `check`, which tests whether both sides mean the same.

Changed comments are warnings. Topics are compared if both sides have dds_topics.yaml.
"""

BREAKING = tuple(rule for rule in RULES if rule.category is not _DRIFT)
"""The rules of `breaking`, which tests whether a change breaks applications or the firmware's own rules."""


def named(name: str) -> tuple[Rule, ...]:
    """Return the rule with the ID `name`, or the rules in the category `name`; empty if neither exists."""
    return tuple(rule for rule in RULES if name in (rule.id, rule.category.name))


_HANDLED = (_WIRE, _HASH, _SOURCE, _SEMANTIC)
"""The categories of findings that a complete new version of the message handles."""
_BUMPED = ("VERSION_NOT_RAISED", "VERSION_NOT_ARCHIVED", "TRANSLATION_MISSING")
"""The rules of other categories whose findings `msggen bump` mends."""


def with_remedies(report: Report, command: Callable[[Finding], str]) -> Report:
    """Return `report` with the `command` of each finding as its remedy."""
    return replace(report, findings=tuple(replace(each, remedy=command(each)) for each in report.findings))


def is_synced(rule: Rule) -> bool:
    """Whether `msggen sync` mends a finding of `rule` in a package, which has no dds_topics.yaml of its own."""
    return rule.category not in (_TOPIC, _VERSION) and rule.id != "DEFINITION_ADDED"


def find(comparison: Comparison, rules: Sequence[Rule]) -> Iterator[Finding]:
    """Apply `rules` in their order, and yield their findings, marked as silent or handled."""
    handled = version.handled(comparison)
    silent = {pair.name: pair.misread_by for pair in comparison.changed}
    topics = _topics_of(comparison, handled)
    ranks = {pair.name: depth(comparison, pair) for pair in comparison.pairs if version.is_bumped(comparison, pair)}
    for rule in rules:
        for change in rule.find(comparison):
            subject = change.subject
            finding = Finding(rule, change)
            if rule.category is Category.WIRE:
                finding = replace(finding, silent_for=silent.get(subject, ()))
            if subject in handled:
                finding = replace(finding, is_handled=_is_handled(finding, handled[subject]))
            if subject in ranks and (rule.category in _HANDLED or rule.id in _BUMPED):
                finding = replace(finding, remedy=f"msggen bump {subject}", rank=ranks[subject])
            if rule.id == "TOPIC_RENAMED":
                finding = replace(finding, is_handled=subject in topics)
            yield finding


def _is_handled(finding: Finding, coverage: version.Coverage) -> bool:
    """Whether the new versions of the message translate the change.

    A field whose meaning changed must be computed. A field whose constants have other values must not be copied.
    """
    rule, names = finding.rule, frozenset(finding.change.names)
    if rule.category not in _HANDLED or names & coverage.open:
        return False
    if rule.category is _SEMANTIC:
        return bool(names & coverage.computed)
    return rule.id != "CONSTANT_VALUE_CHANGED" or not names & coverage.copied


def _topics_of(comparison: Comparison, messages: Collection[str]) -> set[str]:
    """Return the topics that carry `messages`.

    A new version renames these topics; PX4's translation node still publishes under the old names.
    """
    return {entry.topic for entry in comparison.current.catalog.bridge if entry.message_name in messages}
