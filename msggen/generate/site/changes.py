"""The changes of definitions since a previous release, by the message, service or topic that changed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from msggen.check.compare.comparison import Comparison, Extra, Side
from msggen.check.compare.rules import RULES, find
from msggen.check.finding import Category, Finding
from msggen.definitions.model import Catalog
from msggen.sources.catalog import COMPARABLE, read_catalog
from msggen.sources.finding import Sources
from msggen.sources.inferred import Inference

SHOWN = tuple(rule for rule in RULES if rule.category is not Category.VERSION)
"""The rules about definitions. Those about versions are about the firmware's own procedures."""


_TITLES = {
    Category.WIRE: "Bytes",
    Category.HASH: "Hashes",
    Category.SOURCE: "Source code",
    Category.SEMANTIC: "Meaning",
    Category.TOPIC: "Topics of the bridge",
    Category.DRIFT: "Additions",
}
"""The titles of the groups of changes, the gravest first."""


class Changed(NamedTuple):
    """A subject that changed, the URL of its page, "" if it is gone, and its changes."""

    subject: str
    url: str
    findings: tuple[Finding, ...]

    @property
    def is_added(self) -> bool:
        """Whether the previous release does not have it."""
        return any(finding.rule.id == "DEFINITION_ADDED" for finding in self.findings)

    @property
    def category(self) -> Category:
        """The category of its gravest change."""
        order = [*_TITLES]
        return min((finding.rule.category for finding in self.findings), key=order.index)

    @property
    def rules(self) -> Mapping[str, int]:
        """The number of changes by rule."""
        return Counter(finding.rule.id for finding in self.findings)


class Group(NamedTuple):
    """The subjects whose gravest change has the same effect, a sentence, in the order of their names."""

    title: str
    effect: str
    changed: tuple[Changed, ...]

    @property
    def anchor(self) -> str:
        """The anchor of its heading."""
        return f"section-{self.title.lower().replace(' ', '-')}"


def grouped(changed: Sequence[Changed]) -> tuple[Group, ...]:
    """Return the groups of the subjects in `changed`, the gravest first, and new definitions at the end."""
    groups = [
        Group(
            title,
            f"{category.value[0].upper()}{category.value[1:]}.",
            tuple(each for each in changed if each.category is category and not each.is_added),
        )
        for category, title in _TITLES.items()
    ]
    added = tuple(each for each in changed if each.is_added)
    groups.append(Group("New", "The previous release does not have these definitions.", added))
    return tuple(group for group in groups if group.changed)


@dataclass(frozen=True)
class Changes:
    """The changes since `previous`, by subject: a message, a half of a service, or a topic of `dds_topics.yaml`."""

    previous: str
    by_subject: Mapping[str, tuple[Finding, ...]]

    def of(self, subject: str) -> tuple[Finding, ...]:
        """Return the changes of a subject."""
        return self.by_subject.get(subject, ())

    @cached_property
    def added(self) -> frozenset[str]:
        """The messages and services that the previous release does not have."""
        return frozenset(
            subject
            for subject, findings in self.by_subject.items()
            if any(finding.rule.id == "DEFINITION_ADDED" for finding in findings)
        )


def changes_since(previous: Sources, label: str, sources: Sources, catalog: Catalog) -> Changes:
    """Return the changes from `previous`, called `label`, to `catalog`, which was read from `sources`.

    Raises InputError if `previous` cannot be read.
    """
    before = read_catalog(previous, tolerated=COMPARABLE)
    then = Side(label, label, before, has_bridge=_has_bridge(previous), inference=Inference(previous))
    now = Side(
        "",
        "",
        catalog,
        has_bridge=_has_bridge(sources),
        extra=tuple(_added(before, catalog)),
        inference=Inference(sources),
    )
    found: dict[str, list[Finding]] = {}
    for finding in find(Comparison(then, now), SHOWN):
        found.setdefault(finding.change.subject, []).append(finding)
    return Changes(label, {subject: tuple(found[subject]) for subject in sorted(found)})


def _has_bridge(sources: Sources) -> bool:
    return sources.is_tree or sources.bridge is not None


def _added(before: Catalog, after: Catalog) -> list[Extra]:
    messages = {message.name for message in before.uorb_messages}
    services = {service.name for service in before.own_services}
    return [
        *(Extra("message", each.name, each.location) for each in after.uorb_messages if each.name not in messages),
        *(Extra("service", each.name, each.location) for each in after.own_services if each.name not in services),
    ]
