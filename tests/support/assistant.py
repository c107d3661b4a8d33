"""An assistant: a client of the Model Context Protocol, of the protocol's own SDK."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Sequence
from typing import Any

from mcp import Client
from mcp_types import CallToolResult, ImageContent, TextContent

from msggen.cli.commands.log.info import object_of
from msggen.mcp.server import Commands, Server, make_server


def no_vehicle(topics: Sequence[str], seconds: float) -> dict[str, Any]:
    """Return what was asked, instead of watching a link."""
    return {"topics": [*topics], "seconds": seconds}


def server(*places: str) -> Server:
    """Return a server for what is below some folders."""
    return make_server(places, "", Commands(object_of, no_vehicle))


def call(server: Any, tool: str, /, **arguments: Any) -> CallToolResult:
    """Call a tool of a server in this process, or of what a transport leads to."""

    async def called() -> CallToolResult:
        async with Client(server) as client:
            return await client.call_tool(tool, arguments)

    return asyncio.run(called())


def text(result: CallToolResult) -> str:
    """Return the text of an answer or an error."""
    (content,) = result.content
    assert isinstance(content, TextContent)
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


def image(result: CallToolResult) -> ImageContent:
    """Return the picture of an answer."""
    (content,) = result.content
    assert isinstance(content, ImageContent)
    return content
