"""Which topics PX4 publishes because something has changed, beside those that it publishes at a rate."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from msggen.sim.world import World

_TOPICS = (
    "vehicle_status",
    "vehicle_control_mode",
    "failsafe_flags",
    "vehicle_land_detected",
    "estimator_status_flags",
    "home_position",
    "position_setpoint_triplet",
    "manual_control_setpoint",
    "vtol_vehicle_status",
)
_FLAGS = 14
"""The number of `Senses` that FailsafeFlags tells."""


class Changes:
    """Compares a world with what it was at the last look."""

    def __init__(self) -> None:
        self._states: Sequence[object] = (None,) * len(_TOPICS)

    def take(self, world: World) -> Iterator[str]:
        """Yield the topics whose state has changed, named as in uORB."""
        before, after = self._states, _states(world)
        if before != after:
            self._states = after
            yield from (topic for topic, old, new in zip(_TOPICS, before, after, strict=True) if old != new)


def _states(world: World) -> Sequence[object]:
    """Return what PX4 publishes each of the topics for, when it changes."""
    commander, landing, external = world.commander, world.landing, world.external
    failsafe = commander.failsafe
    state = world.vtol_state
    mode, is_armed, landed = commander.mode, commander.is_armed, landing.landed
    return (
        (
            *(is_armed, mode, commander.intention, commander.executor_in_charge),
            *(failsafe.is_active, failsafe.defer_state, commander.is_ready, commander.vtol_state),
        ),
        (is_armed, mode, commander.controls, commander.vehicle_type),
        (commander.senses[:_FLAGS], commander.requirements.masks),
        (landing.ground_contact, landing.maybe_landed, landed, is_armed),
        (
            *(landed, is_armed, world.has_position, state, commander.vehicle_type, world.uses_range),
            world.is_compass_disturbed,
            *(external.fused, external.is_aided, external.is_yaw_aligned, external.rejects_yaw),
        ),
        (world.has_home, world.home_changes, world.origin),
        (mode, landed),
        world.has_sticks,
        (state, world.wings_failed),
    )
