"""What differs between the firmware's releases (FACTS 4): one table, and how a release is recognised."""

from __future__ import annotations

from collections.abc import Collection

from msggen.model import Conventions, Message

CONVENTIONS = {
    convention.release: convention
    for convention in (
        Conventions("v1.14", first_subscription_id=1000, full_topic_path=False, version_suffix=False),
        Conventions("v1.15", first_subscription_id=2048, full_topic_path=True, version_suffix=False),
        Conventions("v1.16", first_subscription_id=2048, full_topic_path=True, version_suffix=True),
        Conventions("v1.17", first_subscription_id=2048, full_topic_path=True, version_suffix=True),
        Conventions("main", first_subscription_id=2048, full_topic_path=True, version_suffix=True),
    )
}
"""By release. Newer releases follow the newest one known."""


def recognise(messages: Collection[Message], *, has_versions: bool, has_instances: bool) -> Conventions:
    """Return the conventions of the firmware whose own `messages` these are.

    v1.16 brought versions of messages; v1.15 the registration of external modes; `instance:` in the YAML came on
    main in 2026. Between v1.16 and v1.17 the conventions did not change. What is not the firmware's set, as a
    folder of one's own messages, follows the newest.
    """
    names = {message.name for message in messages}
    if has_instances or "VehicleStatus" not in names:
        return CONVENTIONS["main"]
    if has_versions:
        return CONVENTIONS["v1.16"]
    return CONVENTIONS["v1.15" if "RegisterExtComponentRequest" in names else "v1.14"]
