"""A server of Foxglove's websocket: samples with their definitions, unchanged, and the vehicle in 3D."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import foxglove
from foxglove import channels, messages

from msggen.show.view.scene import Location, Pose

if TYPE_CHECKING:
    from typing_extensions import Self

WORLD, BODY = "map", "base_link"
"""The frames of ROS (REP 105) in which the vehicle is drawn: ENU, and FLU fixed to the vehicle."""

_TF, _POSE, _LOCATION, _MODEL = "/tf", "/pose", "/location", "/vehicle"
_GREY, _RED = (0.35, 0.38, 0.42, 1.0), (0.85, 0.2, 0.15, 1.0)


class Channel(NamedTuple):
    """A topic: its name and type in ROS 2, and its definition with all it nests, as MCAP stores it (`ros2msg`)."""

    topic: str
    ros_type: str
    definition: str


class Server:
    """A server, from `__init__` until `close`. `sample` and `draw` can be called by any thread.

    Raises OSError if the port is in use. `listener` gets the requests of Foxglove's playback controls, whose times are
    in `span`.
    """

    def __init__(
        self, name: str, host: str, port: int, span: tuple[int, int] | None = None, listener: Any = None
    ) -> None:
        self._context = foxglove.Context()
        try:
            self._server = foxglove.start_server(
                name=name,
                host=host,
                port=port,
                context=self._context,
                server_listener=listener,
                playback_time_range=span,
            )
        except RuntimeError as error:
            raise OSError(str(error)) from None
        self._channels: dict[str, foxglove.Channel] = {}
        self._tf = channels.FrameTransformChannel(_TF, context=self._context)
        self._pose = channels.PoseInFrameChannel(_POSE, context=self._context)
        self._location = channels.LocationFixChannel(_LOCATION, context=self._context)
        self._model = channels.SceneUpdateChannel(_MODEL, context=self._context)

    @property
    def port(self) -> int:
        """The port, also if 0 was asked for."""
        return self._server.port

    @property
    def app_url(self) -> str:
        """The address of Foxglove's application with this server as its source."""
        return self._server.app_url() or ""

    def add(self, channel: Channel) -> None:
        """Add a topic. A second one with the same name replaces the first."""
        self.remove(channel.topic)
        schema = foxglove.Schema(name=channel.ros_type, encoding="ros2msg", data=channel.definition.encode())
        self._channels[channel.topic] = foxglove.Channel(
            channel.topic, schema=schema, message_encoding="cdr", context=self._context
        )

    def remove(self, topic: str) -> None:
        """Remove a topic, if it is there."""
        found = self._channels.pop(topic, None)
        if found is not None:
            found.close()

    def sample(self, topic: str, payload: bytes, time: int) -> bool:
        """Send a sample to all clients. Return whether its topic was added. `time` is in ns since 1970."""
        found = self._channels.get(topic)
        if found is None:
            return False
        found.log(payload, log_time=time)
        return True

    def draw(self, found: Pose | Location, time: int) -> None:
        """Send where the vehicle is, in the types of Foxglove: a transform and a pose, or a location."""
        stamp = messages.Timestamp(*divmod(time, 1_000_000_000))
        if isinstance(found, Location):
            fix = messages.LocationFix(timestamp=stamp, frame_id=BODY, **found._asdict())
            self._location.log(fix, log_time=time)
            return
        position = messages.Vector3(**_axes(found.position))
        w, x, y, z = found.orientation
        rotation = messages.Quaternion(x=x, y=y, z=z, w=w)
        transform = messages.FrameTransform(
            timestamp=stamp, parent_frame_id=WORLD, child_frame_id=BODY, translation=position, rotation=rotation
        )
        self._tf.log(transform, log_time=time)
        pose = messages.Pose(position=position, orientation=rotation)
        self._pose.log(messages.PoseInFrame(timestamp=stamp, frame_id=WORLD, pose=pose), log_time=time)

    def draw_model(self, time: int) -> None:
        """Send the shape of a quadrotor. A client that connects later has not got it, so send it once a second."""
        stamp = messages.Timestamp(*divmod(time, 1_000_000_000))
        entity = messages.SceneEntity(
            timestamp=stamp, frame_id=BODY, id="vehicle", frame_locked=True, cubes=[_BODY], cylinders=_ROTORS
        )
        self._model.log(messages.SceneUpdate(entities=[entity]), log_time=time)

    def tell(self, text: str) -> None:
        """Show a warning in Foxglove, once if it is repeated. A client that connects later has not got it."""
        self._server.publish_status(text, foxglove.StatusLevel.Warning, id=text)

    def set_playback(self, state: foxglove.websocket.PlaybackState) -> None:
        """Tell Foxglove's playback controls where the playback is."""
        self._server.broadcast_playback_state(state)

    def close(self) -> None:
        """Disconnect all clients. Can be repeated."""
        self._server.stop()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _axes(vector: tuple[float, float, float]) -> Mapping[str, float]:
    return dict(zip("xyz", vector, strict=True))


def _place(*position: float) -> messages.Pose:
    x, y, z = position
    return messages.Pose(position=messages.Vector3(x=x, y=y, z=z), orientation=messages.Quaternion(w=1.0))


def _colour(values: tuple[float, float, float, float]) -> messages.Color:
    r, g, b, a = values
    return messages.Color(r=r, g=g, b=b, a=a)


_BODY = messages.CubePrimitive(
    pose=_place(0.0, 0.0, 0.0), size=messages.Vector3(x=0.3, y=0.12, z=0.08), color=_colour(_GREY)
)
_ROTORS = [
    messages.CylinderPrimitive(
        pose=_place(x, y, 0.05),
        size=messages.Vector3(x=0.25, y=0.25, z=0.02),
        bottom_scale=1.0,
        top_scale=1.0,
        color=_colour(_RED if x > 0 else _GREY),  # the front is red
    )
    for x in (0.18, -0.18)
    for y in (0.18, -0.18)
]
"""A quadrotor in FLU, sizes in m."""
