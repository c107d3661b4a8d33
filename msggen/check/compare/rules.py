"""The table of the rules about changes, and the function that applies them."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import replace
from functools import partial

from msggen.check.compare import semantic, source_code, topic, version, wire
from msggen.check.compare.comparison import Comparison, depth
from msggen.check.finding import Category, Finding, Report, Rule, Severity
from msggen.definitions.tags import COMPARED

_WIRE, _HASH, _SOURCE, _SEMANTIC = Category.WIRE, Category.HASH, Category.SOURCE, Category.SEMANTIC
_TOPIC, _VERSION, _DRIFT = Category.TOPIC, Category.VERSION, Category.DRIFT

_SYNC = "Update packages with `msggen sync`."
_RELEASE = (
    "For a versioned message, run `msggen bump NAME`, so that PX4's translation node serves applications built with "
    "the old version. For another message that crosses the bridge, update px4_msgs with `msggen sync`, and rebuild all "
    "nodes that use its topics. For a message that does not cross the bridge, nothing outside the firmware changes."
)
_NESTED = "Do the following for each message that nests the changed one. " + _RELEASE
_RETAG = (
    "If the values changed, adapt all code that uses the field, and give a versioned message its next version with "
    "`msggen bump NAME`. If only the comment changed, correct the wrong one. " + _SYNC
)
"""Texts about fixes that several rules have."""

RULES = (
    Rule("FIELD_ADDED", "a field was added", _WIRE, wire.find_added, fix=_RELEASE),
    Rule(
        "FIELD_REMOVED",
        "a field was removed",
        _WIRE,
        wire.find_removed,
        fix="Keep the field if applications still need it. " + _RELEASE,
    ),
    Rule(
        "FIELD_MOVED",
        "the order of fields changed",
        _WIRE,
        wire.find_moved,
        fix="Restore the order if nothing needs the new one. " + _RELEASE,
    ),
    Rule(
        "FIELD_RETYPED",
        "the type of a field changed",
        _WIRE,
        wire.find_retyped,
        fix="Restore the type if nothing needs the new one. " + _RELEASE,
    ),
    Rule("ARRAY_LENGTH_CHANGED", "the length of an array changed", _WIRE, wire.find_other_length, fix=_RELEASE),
    Rule(
        "NESTED_LAYOUT_CHANGED",
        "the layout of a nested message changed, at any depth",
        _WIRE,
        wire.find_nested,
        fix=_NESTED,
    ),
    Rule(
        "FIELD_RENAMED",
        "a field was renamed; its bytes are the same",
        _HASH,
        wire.find_renamed,
        fix="Use the new name in all code that uses the field. " + _RELEASE,
    ),
    Rule(
        "TYPE_RENAMED",
        "the type of a field was renamed; its bytes and values are the same",
        _HASH,
        wire.find_renamed_type,
        fix="Use the new name in all code that uses the type. " + _RELEASE,
    ),
    Rule(
        "NESTED_NAME_CHANGED",
        "a name in a nested message changed, at any depth",
        _HASH,
        wire.find_nested_names,
        fix=_NESTED,
    ),
    Rule(
        "MESSAGE_REMOVED",
        "a message was removed",
        _SOURCE,
        source_code.find_removed_messages,
        fix=(
            "Keep the message if applications use it. Otherwise, remove its topics from dds_topics.yaml, and the code "
            "that uses the message. " + _SYNC
        ),
    ),
    Rule(
        "MESSAGE_RENAMED",
        "a message was renamed; its definition is the same",
        _SOURCE,
        source_code.find_renamed_messages,
        fix="Use the new name in dds_topics.yaml and in all code that uses the message. " + _SYNC,
    ),
    Rule(
        "SERVICE_REMOVED",
        "a service was removed",
        _SOURCE,
        source_code.find_removed_services,
        fix="Keep the service if applications use it. Otherwise, remove the code that uses it. " + _SYNC,
    ),
    Rule(
        "CONSTANT_REMOVED",
        "a constant was removed",
        _SOURCE,
        source_code.find_removed_constants,
        fix=(
            "Keep the constant if applications use it. Otherwise, remove it from their code, or use its new name. "
            + _SYNC
        ),
    ),
    Rule(
        "CONSTANT_VALUE_CHANGED",
        "the value of a constant changed",
        _SOURCE,
        source_code.find_other_values,
        fix=(
            "Restore the value, and add another constant for the new meaning. Otherwise, give a versioned message its "
            "next version with `msggen bump NAME`, and rebuild all code that uses the constant. " + _SYNC
        ),
    ),
    Rule(
        "CONSTANT_TYPE_CHANGED",
        "the type of a constant changed",
        _SOURCE,
        source_code.find_other_types,
        fix="Restore the type. Otherwise, rebuild all code that uses the constant, and check its conversions. " + _SYNC,
    ),
    *(
        Rule(f"{tag.name.upper()}_CHANGED", tag.purpose, _SEMANTIC, partial(semantic.find_changed, tag), fix=_RETAG)
        for tag in COMPARED
    ),
    Rule(
        "TOPIC_REMOVED",
        "a topic is no longer bridged",
        _TOPIC,
        topic.find_removed,
        fix="Restore the topic in dds_topics.yaml. Otherwise, remove it from all applications.",
    ),
    Rule(
        "TOPIC_RETYPED",
        "the message of a topic changed",
        _TOPIC,
        topic.find_retyped,
        fix=(
            "Restore the type in dds_topics.yaml, or bridge the other message as a new topic. Otherwise, use the new "
            "message in all applications."
        ),
    ),
    Rule(
        "TOPIC_MOVED",
        "a topic is bridged under another name or in the other direction",
        _TOPIC,
        topic.find_moved,
        fix="Restore the topic in dds_topics.yaml. Otherwise, use the new name or direction in all applications.",
    ),
    Rule(
        "TOPIC_RENAMED",
        "the ROS 2 name of a topic changed, for example its version suffix",
        _TOPIC,
        topic.find_renamed,
        fix=(
            "If the suffix of the version changed, give the message a complete new version with `msggen bump NAME`: "
            "PX4's translation node then also serves the old name. Otherwise, use the new name in all applications."
        ),
    ),
    Rule(
        "RATE_LIMIT_CHANGED",
        "the rate limit of a topic changed",
        _TOPIC,
        topic.find_other_rate,
        fix="Restore `rate_limit` in dds_topics.yaml, or check that all applications work with the new rate.",
        severity=Severity.WARNING,
    ),
    Rule(
        "ROUTE_CHANGED",
        "samples of a topic reach other or fewer uORB instances",
        _TOPIC,
        topic.find_other_route,
        fix=(
            "Restore the topic in dds_topics.yaml, or check that the samples of all applications reach the right uORB "
            "instance."
        ),
    ),
    Rule(
        "OPTIONS_CHANGED",
        "the options of a topic for Zenoh's client changed",
        _TOPIC,
        topic.find_other_options,
        fix=(
            "Restore `options` in dds_topics.yaml, or check that the applications that use Zenoh work with the new "
            "options."
        ),
        severity=Severity.WARNING,
    ),
    Rule(
        "VERSION_NOT_RAISED",
        "a versioned message changed, but its version was not raised step by step",
        _VERSION,
        version.find_not_raised,
        fix=(
            "Run `msggen bump NAME`. If the version skips a number, lower MESSAGE_VERSION first: each version between "
            "two releases needs its own archived definition and header."
        ),
    ),
    Rule(
        "VERSION_NEEDLESS",
        "the version of a message changed, but the message did not",
        _VERSION,
        version.find_needless,
        fix=(
            "Take the version back, because a new version renames the topics of the message. Restore the previous "
            "MESSAGE_VERSION. In msg/px4_msgs_old/msg, delete the archived versions that the change added. In "
            "msg/translation_node/translations, delete the header that the change added, and its line in "
            "all_translations.h, and restore the earlier headers: they translate to px4_msgs again, not to "
            "px4_msgs_old. Then run `msggen breaking` again: it reports the remains."
        ),
    ),
    Rule(
        "VERSION_REMOVED",
        "a message is no longer versioned, or an archived version was removed",
        _VERSION,
        version.find_removed,
        fix=(
            "Restore MESSAGE_VERSION, the file in msg/versioned or the archived version. If support for the old "
            "version ends on purpose, rebuild all applications that use the message, and add this rule to "
            "`per-message-ignores`."
        ),
    ),
    Rule(
        "VERSION_NOT_ARCHIVED",
        "the previous version is not archived in px4_msgs_old",
        _VERSION,
        version.find_not_archived,
        fix=(
            "Run `msggen bump NAME`, which archives the previous definition. If the archived version has other fields, "
            "replace them with those of the previous definition."
        ),
    ),
    Rule(
        "TRANSLATION_MISSING",
        "no header translates from the previous version",
        _VERSION,
        version.find_not_translated,
        fix="Run `msggen bump NAME`, which writes the header, and complete its lines with TODO.",
    ),
    Rule(
        "TRANSLATION_INVALID",
        "a translation header or an archived version does not fit its message",
        _VERSION,
        version.find_invalid_translations,
        fix=(
            "If the header names a field that its version of the message does not have, remove the field from the "
            "header, or add it to the definition. If the header was written for another definition, delete it and run "
            "`msggen bump NAME` again. If the message never gets this version, take the version back, as "
            "`msggen explain VERSION_NEEDLESS` describes."
        ),
    ),
    Rule(
        "TRANSLATION_UNFINISHED",
        "a translation header leaves out a field or its value, or has a TODO",
        _VERSION,
        version.find_unfinished_translations,
        fix="In both functions of the header, assign the missing fields, complete the lines with TODO, and set fields "
        "from those of the other version instead of to a constant.",
        severity=Severity.WARNING,
    ),
    Rule(
        "DEFINITION_ADDED",
        "a message or service is only on the current side",
        _DRIFT,
        source_code.find_added_definitions,
        fix=(
            "Move your own definitions to a package of your own, or add them to the firmware. `msggen sync` removes "
            "definitions of the firmware that it no longer has."
        ),
    ),
    Rule(
        "CONSTANT_ADDED",
        "a constant is only on the current side",
        _DRIFT,
        source_code.find_added_constants,
        fix="Add the constant to the firmware. Otherwise, run `msggen sync`, which removes it from the package.",
    ),
    Rule(
        "VERSION_DIFFERS",
        "the version of a message differs",
        _DRIFT,
        source_code.find_other_versions,
        fix=(
            "Run `msggen sync` with the firmware of the vehicle, and rebuild all nodes that use the message, because "
            "the version is part of the ROS 2 name of its topics."
        ),
    ),
)
"""The rules about changes, in the order in which they are listed and applied."""

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


_HANDLED = (_WIRE, _HASH, _SOURCE, _SEMANTIC)
"""The categories of findings that a complete new version of the message handles."""
_BUMPED = ("VERSION_NOT_RAISED", "VERSION_NOT_ARCHIVED", "TRANSLATION_MISSING")
"""The rules of other categories whose findings `msggen bump` mends."""


def with_remedies(report: Report, command: Callable[[Finding], str]) -> Report:
    """Return `report` with the `command` of each finding as its remedy."""
    return replace(report, findings=tuple(replace(each, remedy=command(each)) for each in report.findings))


def is_synced(finding: Finding, owned: Collection[str]) -> bool:
    """Whether `msggen sync` mends a finding in a package, which has no dds_topics.yaml of its own.

    `owned` has the names of the definitions that it may remove.
    """
    if finding.rule.id == "DEFINITION_ADDED":
        return "/".join(finding.change.location.path.replace(os.sep, "/").split("/")[-2:]) in owned
    return finding.rule.category not in (_TOPIC, _VERSION)


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
            is_service = rule.id.startswith("SERVICE_")  # it may be called as a message
            if subject in ranks and not is_service and (rule.category in _HANDLED or rule.id in _BUMPED):
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
