"""A site: its pages, their paths, and the names that their templates use."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

from msggen.check.finding import Finding
from msggen.definitions.enumeration import enumerations
from msggen.definitions.identity import endpoints
from msggen.definitions.model import BridgeEntry, Catalog, Constant, Message
from msggen.definitions.parse.parameters import Parameter, commands, description, parameters
from msggen.generate.render.views import ConstantView, EndpointView, FieldView, MessageView, ServiceView, Views
from msggen.generate.site.changes import Changed, Changes, Group, grouped
from msggen.generate.site.drawing import Graph, Row, draw, inner_of, rows_of
from msggen.generate.site.prose import Document, Prose, render_documents
from msggen.generate.text.words import paragraphs

FORMATS = {"html": ".html", "markdown": ".md"}
"""The suffix of the pages in each format. The first page in Markdown is README.md, which repositories show."""


@dataclass(frozen=True)
class Page:
    """A page: its path without suffix, its title, and its kind, by which its template is found.

    `thing` is the view that it is about. `summary` and `anchors` are for the search.
    """

    stem: str
    title: str
    kind: str
    thing: object = None
    summary: str = ""
    anchors: tuple[str, ...] = ()


@dataclass(frozen=True)
class Project:
    """The Markdown pages of a project, in its folder."""

    folder: str
    documents: tuple[Document, ...]


@dataclass(frozen=True)
class Site:
    """A site about a catalog, and what its templates use.

    `title` names the definitions. `changes` are those since a previous release, and `project` has further pages.
    `home` is the URL of a page that the header links to, from the folder of the site.
    """

    catalog: Catalog
    title: str
    format: str = "html"
    changes: Changes | None = None
    project: Project | None = None
    home: str = ""
    views: Views = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "views", Views(self.catalog))

    @cached_property
    def messages(self) -> tuple[MessageView, ...]:
        """The messages of all packages, those of uORB first."""
        messages = self.views.catalog.messages
        return tuple(sorted(messages, key=lambda message: message.package != self.catalog.package))

    @property
    def services(self) -> tuple[ServiceView, ...]:
        """The services."""
        return self.views.catalog.services

    @cached_property
    def endpoints(self) -> tuple[EndpointView, ...]:
        """The bridged topics, those out of PX4 first, sorted by name."""
        return tuple(sorted(self.views.catalog.endpoints, key=lambda topic: (topic.direction == "in", topic.ros_name)))

    @cached_property
    def enums(self) -> tuple[Enum, ...]:
        """The enums of all messages."""
        return tuple(enum for each in self._definitions for enum in enums_of(each, self.views.message(each)))

    @cached_property
    def graph(self) -> Graph:
        """The graph of messages that nest others."""
        return draw(self.messages)

    @cached_property
    def guide(self) -> tuple[Page, ...]:
        """The pages of the project."""
        return tuple(page for page in self.pages if page.kind == "guide")

    @cached_property
    def prose(self) -> Mapping[str, Prose]:
        """The HTML of the project's pages, by path in the project."""
        if self.project is None:
            return {}
        documents = {self.file(page): page.thing for page in self.guide if isinstance(page.thing, Document)}
        return render_documents(self.project.folder, documents, self.names, "../")

    @cached_property
    def pages(self) -> tuple[Page, ...]:
        """All pages; no two have the same path, even where upper and lower case are the same."""
        taken: set[str] = set()
        found = []
        for page in self._pages():
            stem = re.sub(r"[^\w./-]", "_", page.stem, flags=re.ASCII)
            while stem.casefold() in taken:
                stem += "_"
            taken.add(stem.casefold())
            found.append(replace(page, stem=stem))
        return tuple(found)

    @cached_property
    def names(self) -> dict[str, str]:
        """The URLs of messages and topics by the names that comments use."""
        found = {endpoint.ros_name: self.url(endpoint) for endpoint in self.endpoints}
        return found | {
            message.name: self.url(message) for message in self.messages if message.package == self.catalog.package
        }

    def file(self, page: Page) -> str:
        """Return the path of a page."""
        return f"{page.stem}{FORMATS[self.format]}"

    def url(self, thing: object) -> str:
        """Return the path of the page about a view, from the folder of the site."""
        return self._urls[thing]

    def home_from(self, root: str) -> str:
        """Return the URL of `home` on a page from which `root` leads to the folder of the site."""
        is_absolute = re.match(r"[a-z]+:|/", self.home, re.IGNORECASE)
        return self.home if is_absolute else root + self.home

    def users_of(self, message: MessageView) -> tuple[MessageView, ...]:
        """Return the messages with a field that holds `message`."""
        return tuple(self._users.get(message, ()))

    def topics_of(self, message: MessageView) -> tuple[EndpointView, ...]:
        """Return the bridged topics that carry `message`."""
        return tuple(endpoint for endpoint in self.endpoints if endpoint.message is message)

    def enums_of(self, message: MessageView) -> tuple[Enum, ...]:
        """Return the enums of `message`."""
        return tuple(enum for enum in self.enums if enum.message is message)

    def enum_of(self, value: FieldView) -> Enum | None:
        """Return the enum whose members are the values of a field, or None."""
        return self._enum_of_field.get(value)

    def enum_named(self, message: MessageView, tag: str) -> Enum | None:
        """Return the enum of `message` that the content of a tag names, or None."""
        return next((enum for enum in self.enums_of(message) if enum.tag == tag), None)

    def parameters_of(self, constant: ConstantView) -> tuple[Parameter, ...]:
        """Return the parameters that the comment of a command describes; none for other constants."""
        command = self._commands.get(constant)
        return parameters(command) if command else ()

    def description_of(self, constant: ConstantView) -> str:
        """Return the comment of a constant, without the parameters if it is a command."""
        command = self._commands.get(constant)
        return description(command) if command else constant.comment

    def others_of(self, message: MessageView) -> tuple[ConstantView, ...]:
        """Return the constants of `message` that are in no enum."""
        members = {member.constant for enum in self.enums_of(message) for member in enum.members}
        return tuple(constant for constant in message.constants if constant not in members)

    def rows_of(self, message: MessageView) -> tuple[Row, ...]:
        """Return the bytes of `message` in rows; none if its samples vary."""
        return rows_of(message.leaves)

    def inner_of(self, message: MessageView) -> tuple[MessageView, ...]:
        """Return the messages that `message` nests."""
        return inner_of(message)

    def prefix_of(self, message: MessageView) -> str:
        """Return the prefix of the anchors of `message`: the page of a service has those of both halves."""
        return self._prefixes.get(message, "")

    def changes_of(self, thing: MessageView | ServiceView | EndpointView) -> tuple[Finding, ...]:
        """Return what changed in a definition or a topic since the previous release."""
        if self.changes is None:
            return ()
        return tuple(found for subject in self._subjects(thing) for found in self.changes.of(subject))

    def is_new(self, thing: MessageView) -> bool:
        """Whether the previous release does not have a message."""
        return self.changes is not None and thing.name in self.changes.added

    @cached_property
    def changed(self) -> tuple[Changed, ...]:
        """The subjects that changed since the previous release."""
        if self.changes is None:
            return ()
        things: list[MessageView | ServiceView | EndpointView] = [*self.endpoints, *self.services, *self.messages]
        urls = {subject: self.url(thing) for thing in things for subject in self._subjects(thing)}
        return tuple(Changed(each, urls.get(each, ""), found) for each, found in self.changes.by_subject.items())

    @property
    def groups(self) -> tuple[Group, ...]:
        """The subjects that changed, the gravest first."""
        return grouped(self.changed)

    def _subjects(self, thing: MessageView | ServiceView | EndpointView) -> tuple[str, ...]:
        """Return the names under which the changes of a definition or a topic are reported."""
        if isinstance(thing, ServiceView):
            return thing.name, thing.request.name, thing.response.name
        return (self._entries[thing].topic if isinstance(thing, EndpointView) else thing.name,)

    @cached_property
    def _definitions(self) -> tuple[Message, ...]:
        """The messages of all packages, those of uORB first, and the halves of services."""
        halves = [half for service in self.catalog.services for half in (service.request, service.response)]
        messages = sorted(self.catalog.messages.values(), key=lambda message: message.package != self.catalog.package)
        return (*messages, *halves)

    @cached_property
    def _commands(self) -> dict[ConstantView, Constant]:
        found: dict[ConstantView, Constant] = {}
        for message in self._definitions:
            by_name = {constant.name: constant for constant in commands(message)}
            views = self.views.message(message).constants if by_name else ()
            found |= {view: by_name[view.name] for view in views if view.name in by_name}
        return found

    @cached_property
    def _prefixes(self) -> dict[MessageView, str]:
        halves = ((service.request, service.response) for service in self.services)
        return {half: f"{name}." for both in halves for half, name in zip(both, ("request", "response"), strict=True)}

    @cached_property
    def _entries(self) -> dict[EndpointView, BridgeEntry]:
        entries = (endpoint.entry for endpoint in endpoints(self.catalog))
        return dict(zip(self.views.catalog.endpoints, entries, strict=True))

    @cached_property
    def _urls(self) -> dict[object, str]:
        urls = {page.thing: self.file(page) for page in self.pages}
        for service in self.services:
            urls |= dict.fromkeys((service.request, service.response), urls[service])
        return urls

    @cached_property
    def _users(self) -> dict[MessageView, list[MessageView]]:
        users: dict[MessageView, list[MessageView]] = {}
        for message in map(self.views.message, self._definitions):
            for inner in inner_of(message):
                users.setdefault(inner, []).append(message)
        return users

    @cached_property
    def _enum_of_field(self) -> dict[FieldView, Enum]:
        return {value: enum for enum in self.enums for value in enum.fields}

    def _pages(self) -> Iterator[Page]:
        yield Page("index" if self.format == "html" else "README", self.title, "index")
        yield Page("messages", "Messages", "messages")
        yield Page("topics", "Topics of the bridge", "topics")
        yield Page("enums", "Enums", "enums")
        yield Page("nesting", "Nesting", "nesting")
        if self.changes is not None:
            yield Page("changes", f"Changes since {self.changes.previous}", "changes")
        for document in self.project.documents if self.project else ():
            yield Page(f"guide/{document.name}", document.title, "guide", document)
        for message in self.messages:
            yield self._page_about(message, "msg", "message", (message,))
        for service in self.services:
            yield self._page_about(service, "srv", "service", (service.request, service.response))
        for endpoint in self.endpoints:
            stable = endpoint.ros_name.removesuffix(f"_v{endpoint.message.message_version}")
            stem = re.sub(r"\W+", ".", stable.strip("/"), flags=re.ASCII)
            yield Page(f"topic/{stem}", endpoint.ros_name, "topic", endpoint, endpoint.message.name)
        for enum in self.enums:
            fields = ", ".join(value.name for value in enum.fields) or "a parameter"
            yield Page(f"enum/{enum.full_name}", enum.full_name, "enum", enum, f"values of {fields}")

    def _page_about(
        self, thing: MessageView | ServiceView, folder: str, kind: str, messages: tuple[MessageView, ...]
    ) -> Page:
        """Return the page about a definition, with anchors for the fields and constants of its `messages`."""
        package = "" if thing.package == self.catalog.package else f"{thing.package}."
        anchors = tuple(
            f"{self.prefix_of(message)}{each.name}"
            for message in messages
            for each in (*message.fields, *message.constants)
        )
        return Page(f"{folder}/{package}{thing.name}", thing.name, kind, thing, summary(thing.comment), anchors)


def summary(comment: str) -> str:
    """Return the first sentence of a comment."""
    first = next((line for line in paragraphs(comment.splitlines()) if line), "")
    return re.split(r"(?<=\.) (?=[A-Z])", first, maxsplit=1)[0]


@dataclass(frozen=True)
class Member:
    """A member. `value` is not that of the constant if the constant is the number of a bit.

    `is_first` is false if an earlier enum of the message has the constant too.
    """

    name: str
    value: int
    constant: ConstantView
    is_first: bool


@dataclass(frozen=True, eq=False)
class Enum:
    """An enum of `message`, and the fields whose values it names; none if it is of a parameter of a command.

    `tag` is the content of the tag that it has in comments.
    """

    message: MessageView
    name: str
    tag: str
    is_flags: bool
    members: tuple[Member, ...]
    fields: tuple[FieldView, ...]

    @property
    def full_name(self) -> str:
        """The name with that of the message: `VehicleStatus.NavigationState`."""
        return f"{self.message.name}.{self.name}"


def enums_of(message: Message, view: MessageView) -> tuple[Enum, ...]:
    """Return the enums of `message`, whose view is `view`."""
    fields = {field.name: field for field in view.fields}
    constants = {constant.name: constant for constant in view.constants}
    found: list[Enum] = []
    for each in enumerations(message):
        known = {member.constant.name for enum in found for member in enum.members}
        members = (
            Member(one.name, one.value, constants[one.constant.name], one.constant.name not in known)
            for one in each.members
        )
        used = tuple(fields[name] for name in each.fields)
        found.append(Enum(view, each.name, each.tag, each.is_flags, tuple(members), used))
    return tuple(found)
