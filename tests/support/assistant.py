"""An assistant: a client of the Model Context Protocol, of the protocol's own SDK."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from msggen.cli.commands.log.info import object_of
from support.lazy import Lazy

if TYPE_CHECKING:
    import mcp
    import mcp_types as types

    from msggen.mcp import server as made
else:
    mcp, types, made = Lazy("mcp"), Lazy("mcp_types"), Lazy("msggen.mcp.server")


def no_vehicle(topics: Sequence[str], seconds: float) -> dict[str, Any]:
    """Return what was asked, instead of watching a link."""
    return {"topics": [*topics], "seconds": seconds}


def server(*places: str) -> made.Server:
    """Return a server for what is below some folders."""
    return made.make_server(places, "", made.Commands(object_of, no_vehicle))


def call(server: Any, tool: str, /, **arguments: Any) -> types.CallToolResult:
    """Call a tool of a server in this process, or of what a transport leads to."""

    async def called() -> types.CallToolResult:
        async with mcp.Client(server) as client:
            return await client.call_tool(tool, arguments)

    return asyncio.run(called())


def text(result: types.CallToolResult) -> str:
    """Return the text of an answer or an error."""
    (content,) = result.content
    assert isinstance(content, types.TextContent)
    return content.text


def told(server: Any, tool: str, /, **arguments: Any) -> Any:
    """Return the JSON of an answer."""
    result = call(server, tool, **arguments)
    assert not result.is_error, text(result)
    return json.loads(text(result))


def error(server: Any, tool: str, /, **arguments: Any) -> str:
    """Return the error of a call."""
    result = call(server, tool, **arguments)
    assert result.is_error, result
    return text(result)


def image(result: types.CallToolResult) -> types.ImageContent:
    """Return the picture of an answer."""
    (content,) = result.content
    assert isinstance(content, types.ImageContent)
    return content
