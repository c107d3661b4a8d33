"""Clients of stores, with the credentials that the tools of each store use, and of servers."""

from __future__ import annotations

import os
from datetime import datetime, timedelta, timezone
from typing import TYPE_CHECKING, Any, cast
from urllib.parse import unquote, urlsplit

from msggen.base.disk.urls import scheme_of
from msggen.base.missing import installed_by
from msggen.recordings.stores import limits
from msggen.recordings.stores.errors import store_error
from msggen.recordings.stores.server import Server

if TYPE_CHECKING:
    from collections.abc import Callable

    from obstore.store import BackoffConfig, ClientConfig, ObjectStore, RetryConfig, S3Credential

_LIFE = timedelta(minutes=10)
"""How long credentials are used before botocore is asked again, which renews them in time."""
_NO_CREDENTIALS = (
    "there are no credentials: set AWS_PROFILE, or AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY; "
    "AWS_SKIP_SIGNATURE=true reads public buckets"
)


def split(address: str) -> tuple[str, str]:
    """Return what a client is made for, and the name of an object there.

    Those of `s3://bucket/logs/a.mcap` are `s3://bucket` and `logs/a.mcap`. Raises StoreError.
    """
    scheme = scheme_of(address)
    if scheme in ("http", "https"):
        try:
            parts = urlsplit(address)
            host, _ = parts.hostname, parts.port
        except ValueError as error:
            raise store_error(address, f"this is no URL: {error}") from None
        if not host:
            raise store_error(address, f"expected {scheme}://SERVER/FILE")
        query = f"/?{parts.query}" if parts.query else ""
        return f"{scheme}://{parts.netloc}{query}", unquote(parts.path).lstrip("/")
    bucket, _, key = address[len(scheme) + len("://") :].partition("/")
    if not bucket:
        raise store_error(address, f"expected {scheme}://BUCKET/KEY")
    return f"{scheme}://{bucket}", key


def client_for(place: str, address: str) -> ObjectStore | Server:
    """Return a client for what `split` returns of an address.

    Raises StoreError, and ModuleNotFoundError without the extra.
    """
    with installed_by("stores"):
        import botocore.session  # noqa: F401
        from obstore.exceptions import BaseError
        from obstore.store import from_url
    scheme = scheme_of(place)
    if scheme in ("http", "https"):
        return Server()
    try:
        if scheme == "s3":
            return _s3(place, address)
        return from_url(place, client_options=_options(), retry_config=_retries())
    except (BaseError, ValueError) as error:
        raise store_error(address, str(error).partition("\n")[0]) from None


def _s3(place: str, address: str) -> ObjectStore:
    """Return a client for a bucket, as the configuration and the environment of AWS's own tools say."""
    from botocore.exceptions import BotoCoreError
    from botocore.session import Session
    from obstore.store import S3Store

    try:
        session = Session()
        found: dict[str, Any] = {"region": session.get_config_variable("region") or "us-east-1"}
        endpoint = _endpoint(session)
        if os.environ.get("AWS_SKIP_SIGNATURE", "").lower() in ("1", "true"):
            found["skip_signature"] = True
        else:
            found["credential_provider"] = _provider(session.get_credentials(), address)
    except BotoCoreError as error:
        raise store_error(address, str(error).rstrip(".")) from None
    if endpoint:
        found["endpoint"] = endpoint
    is_plain = endpoint.startswith("http://")
    options: ClientConfig = {**_options(), "allow_http": is_plain}
    return S3Store(place.partition("://")[2], client_options=options, retry_config=_retries(), **found)


def _options() -> ClientConfig:
    """Return the limits of a request, as obstore has them."""
    own = limits.LIMITS
    times = {"connect_timeout": own.connect, "read_timeout": own.read, "timeout": own.total}
    return cast("ClientConfig", {name: f"{round(1000 * seconds)}ms" for name, seconds in times.items()})


def _retries() -> RetryConfig:
    own = limits.LIMITS
    backoff: BackoffConfig = {"init_backoff": timedelta(seconds=own.backoff)}
    return {"max_retries": own.retries, "retry_timeout": timedelta(seconds=own.retry), "backoff": backoff}


def _endpoint(session: Any) -> str:
    """Return the URL of a service that is compatible with S3, "" for AWS: AWS_ENDPOINT_URL_S3, or of a profile."""
    from botocore.configprovider import ConfiguredEndpointProvider

    provider = ConfiguredEndpointProvider(
        full_config=session.full_config, scoped_config=session.get_scoped_config(), client_name="s3"
    )
    return str(provider.provide() or "")


def _provider(credentials: Any, address: str) -> Callable[[], S3Credential]:
    """Return what gives the credentials of botocore: of the environment, a profile, SSO, a role, or the machine."""

    def provide() -> S3Credential:
        found = credentials.get_frozen_credentials()
        return {
            "access_key_id": found.access_key,
            "secret_access_key": found.secret_key,
            "token": found.token,
            "expires_at": datetime.now(timezone.utc) + _LIFE,
        }

    if credentials is None:
        raise store_error(address, _NO_CREDENTIALS)
    provide()  # errors have their own texts here
    return provide
