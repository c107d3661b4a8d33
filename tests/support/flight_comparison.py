"""What the captured commander answered and showed in a flight, compared with the simulated one in its place."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from itertools import groupby, pairwise
from typing import Any, NamedTuple, Protocol

from msggen.messages import nav_states
from msggen.sim.commander.requirements import OF_PX4
from msggen.sim.commander.setpoint_types import ALL
from support.flight_captures import Captured, Sample
from support.flight_replay import OF_TYPES, Answer, Seen, Values, text_of

FAR = 300_000
"""How far apart in us times may be."""
_BRIEF = 210_000
"""The time for which a value must last to be seen: VehicleStatus is sent at most each 0.2 s, and PX4 looks at what
modes require each 0.1 s."""
_LATE = 20_000
"""The time that an answer takes."""
_SLACK = 50_000
"""How near to a message of the capture one of our values may end and not be shown by it."""
_ACK = "vehicle_command_ack"
_IN_A_ROW = 150_000
"""ModeCompleted is sent each 50 ms: the time within which one belongs to those before it."""
_OF_OTHERS = {420, 3000}
"""The commands that others answer: INJECT_FAILURE switches a sensor of the simulator off, DO_VTOL_TRANSITION is for
the controller of a VTOL."""


# Answers


class Compared(Protocol):
    """What is compared with a capture: a `Replay`, or a whole vehicle."""

    captured: Captured

    @property
    def answers(self) -> Sequence[Answer]:
        """What it answered."""

    @property
    def seen(self) -> Mapping[str, Sequence[Seen]]:
        """Each value that changed, by its name."""


def different_answers(replay: Compared, far: int = FAR, others: Collection[int] = _OF_OTHERS) -> list[str]:
    """Return how our answers differ from the captured ones, or are further apart than `far` us.

    Those in a cut are left out, and those to the commands of `others`.
    """
    answers = (each for each in replay.answers if not (each.topic == _ACK and each.values[0] in others))
    ours = first_of_each_row(each for each in answers if not _is_cut(each, replay.captured))
    theirs = first_of_each_row(answers_of(replay.captured.samples, others))
    _order(ours, theirs)
    found = [
        f"{one}, captured {two}"
        for one, two in zip(ours, theirs, strict=False)
        if one[1:] != two[1:] or abs(one.time - two.time) > far
    ]
    found += [f"only ours: {each}" for each in ours[len(theirs) :] if each.time < replay.captured.end - _LATE]
    return found + [f"only captured: {each}" for each in theirs[len(ours) :]]


def _order(ours: list[Answer], theirs: list[Answer]) -> None:
    """Order the answers that the captured commander gave in one datagram: a datagram has the order of topics."""
    place = 0
    for _, found in groupby([*theirs], lambda each: each.time):
        end = place + len([*found])
        for each in (ours, theirs):
            each[place:end] = sorted(each[place:end], key=lambda one: one.topic)
        place = end


def _is_cut(answer: Answer, captured: Captured) -> bool:
    return any(begin - _LATE < answer.time < end for begin, end in captured.cuts)


def first_of_each_row(answers: Iterator[Answer]) -> list[Answer]:
    """Return answers, and of ModeCompleted in a row the first one."""
    last: dict[Values, int] = {}
    found = []
    for each in answers:
        is_repeated = each.topic == "mode_completed" and each.time < last.get(each.values, -_IN_A_ROW) + _IN_A_ROW
        last[each.values] = each.time
        if not is_repeated:
            found.append(each)
    return found


def answers_of(samples: Iterable[Sample], others: Collection[int] = _OF_OTHERS) -> Iterator[Answer]:
    """Yield the answers among samples, but not those to the commands of `others`."""
    for sample in samples:
        values = _ANSWERS[sample.topic](sample.message) if sample.topic in _ANSWERS else None
        if values and not (sample.topic == _ACK and sample.message.command in others):
            yield Answer(sample.time, sample.topic, values)


_ANSWERS: Mapping[str, Callable[[Any], Values | None]] = {
    "register_ext_component_reply": lambda one: (
        *(text_of(one.name), one.px4_ros2_api_version, one.success),
        *(one.arming_check_id, one.mode_id, one.mode_executor_id),
    ),
    "setpoint_config_reply": lambda one: (
        *(one.type, one.source_id, one.result),
        *(getattr(one, f"mode_req_{each}") for each in OF_TYPES),
    ),
    "config_overrides_confirm": lambda one: (
        *(one.source_type, one.source_id),
        *(one.disable_auto_disarm, one.defer_failsafes, one.defer_failsafes_timeout_s),
    ),
    _ACK: lambda one: (one.command, one.result, one.target_component),
    "mode_completed": lambda one: None if one.nav_state in nav_states.EXTERNAL else (one.nav_state,),
}
"""The values of each answer that are compared, None if it is not one of the commander."""


# Values that change


class Shown(NamedTuple):
    """A value that a message shows, and the time of the message before."""

    after: int
    time: int
    value: Values


class Source(NamedTuple):
    """What shows a value."""

    topic: str
    value_of: Callable[[Any], Values]
    is_exact: bool = False
    """Whether each value is shown, however short it is."""
    is_sent: bool = False
    """Whether PX4 sends a message because the value has changed. Else, those that it sends anyway show it."""


def _status_of(one: Any) -> Values:
    return (
        *(one.nav_state, one.nav_state_user_intention, one.executor_in_charge, one.nav_state_display),
        *(one.arming_state, one.failsafe, one.failsafe_and_user_took_over, one.failsafe_defer_state),
        *(one.latest_arming_reason, one.latest_disarming_reason),
    )


def _vehicle_of(one: Any) -> Values:
    return one.vehicle_type, one.is_vtol, one.in_transition_mode, one.in_transition_to_fw


def _controls_of(one: Any) -> Values:
    """Return what is controlled in the mode of a program. All others of the captured modes are automatic."""
    found = frozenset(each for each in ALL if getattr(one, f"flag_control_{each}_enabled"))
    return (not one.flag_control_auto_enabled and found,)


def _mask_of(name: str) -> Callable[[Any], Values]:
    return lambda one: (getattr(one, f"mode_req_{name}"),)


SOURCES: Mapping[str, Source] = {
    "status": Source("vehicle_status", _status_of, is_exact=True, is_sent=True),
    "vehicle": Source("vehicle_status", _vehicle_of, is_exact=True, is_sent=True),
    "ready": Source("vehicle_status", lambda one: (one.pre_flight_checks_pass,), is_sent=True),
    "selectable": Source("vehicle_status", lambda one: (one.can_set_nav_states_mask,)),
    "registrations": Source("arming_check_request", lambda one: (one.valid_registrations_mask,)),
    "controls": Source("vehicle_control_mode", _controls_of),
    **{name: Source("failsafe_flags", _mask_of(name)) for name in OF_PX4},
}
"""What shows each value of `Replay.seen`."""


def different_values(replay: Compared, sources: Mapping[str, Source] = SOURCES, far: int = FAR) -> list[str]:
    """Return how the changes of our values differ from the captured ones, or are further apart than `far` us."""
    return [
        f"{name}: {each}"
        for name, source in sources.items()
        for each in _Comparison(source, replay.captured, far).differences(replay.seen[name])
    ]


def shown(source: Source, captured: Captured) -> list[Shown]:
    """Return the values that a capture shows, each once until another one."""
    found: list[Shown] = []
    before = captured.samples[0].time
    for each in captured.of(source.topic):
        value = source.value_of(each.message)
        if not found or found[-1].value != value:
            found.append(Shown(before, each.time, value))
        before = each.time
    return found


class _Comparison:
    """The comparison of a value with a capture."""

    def __init__(self, source: Source, captured: Captured, far: int) -> None:
        self._far = far
        self._source = source
        self._captured = captured
        self._shown = shown(source, captured)
        self._messages = [each.time for each in captured.of(source.topic)]

    def differences(self, ours: Sequence[Seen]) -> Iterator[str]:
        """Yield what differs. Of our values, those may be left out that no message could have shown."""
        end = self._captured.end
        left = [(one, two.time) for one, two in pairwise([*ours, Seen(end, ())]) if one.value]
        last: Values = ()
        for place, theirs in enumerate(self._shown):
            rest = left
            while rest and not self._matches(rest[0][0], theirs) and self._may_skip(*rest[0], last):
                rest = rest[1:]
            if rest and self._matches(rest[0][0], theirs):
                left, last = rest[1:], theirs.value
            elif theirs.value != last and not self._may_miss(place):
                yield f"captured {theirs}, ours {rest[0][0] if rest else None}"
                return
        yield from (f"only ours: {one}" for one, until in left if not self._may_skip(one, until, last))

    def _matches(self, own: Seen, theirs: Shown) -> bool:
        """Return whether one of our values has the time at which a message could have shown it."""
        cuts = [begin for begin, end in self._captured.cuts if begin < theirs.time < end + self._far]
        return (
            own.value == theirs.value and min([theirs.after, *cuts]) - self._far <= own.time <= theirs.time + self._far
        )

    def _may_miss(self, place: int) -> bool:
        """Return whether a captured value is at the end, or so short that another phase does not show it."""
        times = [each.time for each in self._shown[place:]]
        is_brief = len(times) > 1 and times[1] - times[0] <= _BRIEF
        return (is_brief and not self._source.is_exact) or times[0] > self._captured.end - self._far

    def _may_skip(self, own: Seen, until: int, last: Values) -> bool:
        """Return whether one of our values is the last one again, or so short that no message shows it."""
        captured = self._captured
        is_shown = self._source.is_sent or any(own.time + _SLACK < time < until - _SLACK for time in self._messages)
        is_blind = any(one - self._far <= own.time and until <= two + self._far for one, two in captured.blind)
        is_brief = until - own.time <= _BRIEF or own.time > captured.end - self._far
        return own.value == last or is_brief or is_blind or not is_shown
