"""Tests of what tokens and samples tell of vehicles, without Zenoh."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from msggen.link import age
from msggen.link.link import (
    Connected,
    Disconnected,
    Event,
    Identified,
    LinkError,
    Lost,
    Opened,
    Remote,
    Route,
    Sample,
    StaleError,
    Warned,
)
from msggen.link.rmw_zenoh.names import NO_HASH, Attachment, Key, Token, beat_of, gid_of
from msggen.link.rmw_zenoh.vehicle import CARRIED_STILL_NS, STILL_NS
from msggen.link.rmw_zenoh.vehicles import (
    ANEW_NS,
    EVERYTHING,
    GRACE_NS,
    MAX_ENDPOINTS,
    MAX_NODES,
    MAX_VEHICLES,
    NO_BEAT,
    QUIET_NS,
    SILENCE_NS,
    Vehicles,
)
from support.zenoh_space import COMMAND, GUID, OTHER, STATUS, ZID, definition, token_of


class Space:
    """Vehicles, and what they have told."""

    def __init__(self) -> None:
        self.events: list[Event] = []
        self.vehicles = Vehicles(self.events.append)
        self.now = 10**9
        self.sequences: dict[tuple[str, bytes], int] = {}

    def token(self, key: Key | None, guid: bytes = GUID, zid: str = ZID, *, is_alive: bool = True) -> None:
        self.vehicles.token(token_of(key, guid, zid), self.now, is_alive=is_alive)

    def sample(
        self, key: Key | str = STATUS, payload: bytes = b"", guid: bytes = GUID, sequence: int | None = None
    ) -> None:
        number = self.sequences.get((str(key), guid), 0) + 1 if sequence is None else sequence
        self.sequences[str(key), guid] = number
        self.vehicles.sample(str(key), payload, Attachment(number, 5, guid).pack(), 77, self.now)

    def all(self, kind: Any) -> list[Any]:
        return [event for event in self.events if type(event) is kind]

    @property
    def remote(self) -> Remote:
        remote: Remote = self.all(Connected)[-1].remote
        return remote


@pytest.fixture
def space() -> Iterator[Space]:
    found = Space()
    yield found
    found.vehicles.close("the end")
    assert len(found.all(Connected)) == len(found.all(Disconnected))


def test_tokens_tell_the_topics_with_the_versions_that_the_hashes_stand_for(space: Space) -> None:
    space.token(None)
    space.token(COMMAND)
    assert not space.events  # it may be a program that listens to what others publish
    space.token(STATUS)
    assert space.remote == Remote(1, GUID.hex(), 0, "", continued=False, guid=GUID.hex())
    status, command = definition(STATUS), definition(COMMAND)
    assert [event.route for event in space.all(Opened)] == [
        Route("/fmu/in/vehicle_command", COMMAND.ros_type, "in", -1, COMMAND.type_hash, command.message_hash),
        Route("/fmu/out/vehicle_status_v4", STATUS.ros_type, "out", -1, STATUS.type_hash, status.message_hash),
    ]


def test_surplus_bytes_are_left_out(space: Space) -> None:
    space.token(STATUS)
    payload = b"\0\1\0\0" + b"x" * definition(STATUS).size
    space.sample(payload=payload + b"left-over stack memory")
    assert space.all(Sample)[0].payload == payload
    assert space.all(Sample)[0].time == 77


def test_the_sizes_of_unknown_definitions_are_not_known(space: Space) -> None:
    key = STATUS._replace(type_hash="RIHS01_" + "ab" * 32)
    space.token(key)
    space.sample(key, b"\0\1\0\0something and surplus")
    route = space.all(Sample)[0].route
    assert (route.name, route.message_hash, route.has_surplus) == ("/fmu/out/vehicle_status", 0, True)
    assert space.all(Sample)[0].payload == b"\0\1\0\0something and surplus"


def test_a_hash_of_another_message_is_no_definition(space: Space) -> None:
    space.token(STATUS._replace(type_hash=COMMAND.type_hash))
    assert space.all(Opened)[0].route.message_hash == 0


def test_gaps_of_a_topic_are_lost_samples(space: Space) -> None:
    other = STATUS._replace(name="/fmu/out/other")
    space.token(STATUS)
    space.token(other)
    for sequence in (7, 8, 11, 12):
        space.sample(sequence=sequence)
        space.sample(other, sequence=sequence * 100 if sequence == 7 else 693 + sequence)
    assert space.all(Lost) == [Lost(space.remote, 2), Lost(space.remote, 2)]
    assert space.vehicles.lost == 4


def test_a_vehicle_that_counts_from_one_again_has_lost_nothing(space: Space) -> None:
    space.token(STATUS)
    for sequence in (100, 1, 2):
        space.sample(sequence=sequence)
    assert not space.all(Lost)


def test_a_restart_without_tokens_is_no_second_vehicle(space: Space) -> None:
    keys = [STATUS._replace(name=f"/fmu/out/topic_{number}") for number in range(20)]
    for key in keys:
        space.token(key)
    for sequence in (1000, 1, 2):
        for key in keys:
            space.sample(key, sequence=sequence)
    assert not space.all(Lost) + space.all(Warned)


def test_a_listener_to_inputs_is_no_vehicle(space: Space) -> None:
    space.vehicles.token(str(Token(0, ZID, "MS", "rosbag", COMMAND)), space.now, is_alive=True)
    space.sample()
    space.now += GRACE_NS
    space.sample()
    assert space.remote.guid == GUID.hex()


def test_routes_of_a_firmware_before_an_update_go_with_its_session(space: Space) -> None:
    """Both sessions have tokens for a minute, and a program that joins does not know which one is the later."""
    old = STATUS._replace(type_hash=NO_HASH)
    space.token(old)
    space.token(STATUS, zid="0b" * 16)
    space.token(old._replace(name="/fmu/out/old"))
    space.token(old, is_alive=False)
    space.token(old._replace(name="/fmu/out/old"), is_alive=False)
    assert [route.name for route in space.vehicles.routes(space.remote)] == ["/fmu/out/vehicle_status_v4"]


def test_several_vehicles_are_told_by_their_guids(space: Space) -> None:
    for guid in (GUID, OTHER):
        space.token(STATUS, guid, zid=guid.hex())
    for guid in (GUID, OTHER, GUID):
        space.sample(guid=guid)
    assert [event.remote.guid for event in space.all(Sample)] == [GUID.hex(), OTHER.hex(), GUID.hex()]
    assert not space.all(Lost)


def test_several_vehicles_are_told_by_their_namespaces(space: Space) -> None:
    first, second = (STATUS._replace(name=f"/uav_{number}/fmu/out/vehicle_status") for number in (1, 2))
    for key in (first, second):
        space.token(key)
        space.sample(key)
    assert [event.remote.namespace for event in space.all(Sample)] == ["uav_1", "uav_2"]


def test_nothing_is_sent_to_two_vehicles_at_once(space: Space) -> None:
    for guid in (GUID, OTHER):
        space.token(COMMAND, guid, zid=guid.hex())
        space.token(STATUS, guid, zid=guid.hex())
    with pytest.raises(LinkError, match=r"2 vehicles read /fmu/in/vehicle_command.*PX4_UXRCE_DDS_NS"):
        space.vehicles.key_to(space.remote, space.all(Opened)[0].route, space.now)
    space.token(STATUS, OTHER, zid=OTHER.hex(), is_alive=False)
    remote = space.all(Connected)[0].remote
    assert space.vehicles.key_to(remote, space.all(Opened)[0].route, space.now) == str(COMMAND)


def test_two_vehicles_of_one_guid_are_told_to_the_user(space: Space) -> None:
    """SITL and boards without a unique id have all the same one."""
    space.token(STATUS)
    for sequence in range(100, 110):
        space.sample(sequence=sequence)
        space.sample(sequence=sequence - 90)
    assert "cannot be told apart" in space.all(Warned)[0].text
    assert len(space.all(Warned)) == 1


def test_a_vehicle_ends_with_its_tokens(space: Space) -> None:
    space.token(STATUS)
    space.token(COMMAND)
    space.token(COMMAND, is_alive=False)
    assert not space.all(Disconnected)
    space.token(STATUS, is_alive=False)
    assert space.all(Disconnected) == [
        Disconnected(space.remote, "its tokens are gone: PX4, or its module zenoh, has ended")
    ]


def test_a_vehicle_without_power_ends_with_its_silence_and_comes_back(space: Space) -> None:
    space.token(STATUS)
    space.sample()
    space.now += SILENCE_NS - 1
    space.vehicles.tick(space.now)
    assert not space.all(Disconnected)
    space.now += 1
    space.vehicles.tick(space.now)
    assert space.all(Disconnected)[0].reason == "nothing has arrived from it for 5 s"
    assert not space.vehicles.routes(space.remote)
    space.sample()
    assert [event.remote.number for event in space.all(Connected)] == [1, 2]
    assert space.all(Sample)[-1].remote.number == 2


def test_tokens_of_a_vehicle_that_never_sends_are_no_vehicle_for_long(space: Space) -> None:
    space.token(STATUS)
    space.now += SILENCE_NS
    space.vehicles.tick(space.now)
    assert len(space.all(Disconnected)) == 1


def test_a_vehicle_that_has_restarted_leaves_tokens_behind(space: Space) -> None:
    space.token(STATUS)
    space.token(STATUS, zid="0b" * 16)
    space.token(COMMAND, zid="0b" * 16)
    assert space.all(Disconnected)[0].reason == "it has begun another session"
    assert len(space.vehicles.routes(space.remote)) == 2
    space.token(STATUS, is_alive=False)  # those of the first session, a minute later
    assert len(space.all(Disconnected)) == 1


def test_nothing_is_sent_to_a_vehicle_that_is_silent(space: Space) -> None:
    space.token(COMMAND)
    space.token(STATUS)
    route = space.all(Opened)[0].route
    space.now += STILL_NS + 1
    with pytest.raises(StaleError, match=r"nothing has arrived from the vehicle for more than 0\.5 s"):
        space.vehicles.key_to(space.remote, route, space.now)


def test_what_a_vehicle_does_not_read_has_no_key(space: Space) -> None:
    space.token(STATUS)
    with pytest.raises(LinkError, match="does not subscribe to /fmu/out/vehicle_status_v4"):
        space.vehicles.key_to(space.remote, space.all(Opened)[0].route, space.now)
    with pytest.raises(LinkError, match="is no longer connected"):
        space.vehicles.key_to(space.remote._replace(number=9), space.all(Opened)[0].route, space.now)


def test_a_firmware_without_tokens_has_the_topics_that_it_publishes(space: Space) -> None:
    space.sample()
    assert not space.events  # its tokens may be on their way
    space.now += GRACE_NS
    space.sample()
    assert [type(event) for event in space.events] == [Warned, Connected, Opened, Sample]
    assert "CONFIG_ZENOH_RMW_LIVELINESS=y" in space.all(Warned)[0].text
    assert space.all(Opened)[0].route.name == "/fmu/out/vehicle_status_v4"
    space.now += GRACE_NS // 2
    space.sample(STATUS._replace(name="/fmu/out/further"))  # at once: it is known that no tokens come
    assert len(space.all(Sample)) == 2
    space.now += GRACE_NS
    space.vehicles.tick(space.now)
    assert not space.all(Identified)
    space.now += 1
    space.vehicles.tick(space.now)
    assert space.all(Identified) == [Identified(space.remote, {}, is_complete=True)]


def test_a_firmware_without_hashes_is_told(space: Space) -> None:
    space.token(STATUS._replace(type_hash=NO_HASH))
    assert "CONFIG_ZENOH_KEY_TYPE_HASH=y" in space.all(Warned)[0].text


@pytest.mark.parametrize("key", ["fmu/out/vehicle_status", "rt/fmu/out/vehicle_status", "uav_1/fmu/out/wind"])
def test_releases_before_v1_17_are_refused_with_the_reason(space: Space, key: str) -> None:
    for _ in range(2):
        space.vehicles.sample(key, b"\0\1\0\0", None, 0, space.now)
    assert f"'{key}' is published in the form of PX4 v1.16" in space.all(Warned)[0].text
    assert len(space.events) == 1
    assert space.vehicles.refused == {"samples of PX4 before v1.17": 2}


def test_other_programs_are_no_vehicles(space: Space) -> None:
    listener, writer = Token(0, ZID, "MS", "rosbag", STATUS), Token(0, ZID, "MP", "pilot", COMMAND)
    chatter = Token(0, ZID, "MP", "talker", STATUS._replace(name="/chatter"))
    for token in (listener, writer, chatter):
        space.vehicles.token(str(token), space.now, is_alive=True)
    assert not space.events


def test_a_program_that_carries_a_vehicle_is_a_vehicle(space: Space) -> None:
    """Its topics have gids of their own, as with rmw_zenoh."""
    space.vehicles.token(str(Token(0, ZID, "MP", "bridge", STATUS)), space.now, is_alive=True)
    space.sample(guid=OTHER)
    assert (space.remote.address, space.remote.guid) == ("bridge", "")
    assert len(space.all(Sample)) == 1


def test_samples_of_strangers_are_refused(space: Space) -> None:
    space.token(STATUS)
    space.sample(guid=OTHER)
    space.vehicles.sample(str(STATUS), b"", None, 0, space.now)
    space.vehicles.sample("rubbish", b"", None, 0, space.now)
    space.vehicles.token("@ros2_lv/rubbish", space.now, is_alive=True)
    assert not space.all(Sample)
    assert sum(space.vehicles.refused.values()) == 4


def test_tokens_of_this_program_are_not_those_of_a_vehicle() -> None:
    events: list[Event] = []
    Vehicles(events.append, lambda zid: zid == ZID).token(token_of(STATUS), 0, is_alive=True)
    assert not events


def test_the_numbers_of_vehicles_and_endpoints_are_limited(space: Space) -> None:
    for number in range(MAX_ENDPOINTS + 5):
        space.token(STATUS._replace(name=f"/fmu/out/topic_{number}"))
    assert len(space.vehicles.routes(space.remote)) == MAX_ENDPOINTS
    for number in range(MAX_VEHICLES + 5):
        space.token(STATUS._replace(name=f"/uav_{number}/fmu/out/x"))
    assert len(space.all(Connected)) == MAX_VEHICLES
    assert sum(space.vehicles.refused.values()) == 5 + 6


def test_nodes_that_only_listen_take_no_place_of_vehicles(space: Space) -> None:
    for number in range(MAX_NODES - 1):
        space.vehicles.token(str(Token(0, ZID, "MS", f"node_{number}", COMMAND)), space.now, is_alive=True)
    space.token(COMMAND)
    space.token(STATUS)
    assert space.remote.guid == GUID.hex()
    assert len(space.vehicles.routes(space.remote)) == 2
    space.token(STATUS, OTHER)
    assert space.vehicles.refused[f"nodes above {MAX_NODES}"] == 1
    space.vehicles.token(str(Token(0, ZID, "MS", "node_0", COMMAND)), space.now, is_alive=False)
    space.now += ANEW_NS + 1
    assert space.vehicles.wants_tokens(space.now)


def test_tokens_are_told_anew_once_places_of_vehicles_get_free(space: Space) -> None:
    strangers = [STATUS._replace(name=f"/uav_{number}/fmu/out/x") for number in range(MAX_VEHICLES)]
    for key in strangers:
        space.token(key, OTHER)
    space.now += ANEW_NS + 1
    for key in (COMMAND, STATUS):  # as carried vehicles have them: what is read comes first
        space.token(key)
    space.sample()
    assert GUID.hex() not in {each.remote.guid for each in space.all(Connected)}
    assert not space.vehicles.wants_tokens(space.now)
    space.token(strangers[0], OTHER, is_alive=False)
    assert space.vehicles.wants_tokens(space.now)
    assert not space.vehicles.wants_tokens(space.now)
    for key in (COMMAND, STATUS):
        space.token(key)
    assert space.remote.guid == GUID.hex()
    assert len(space.vehicles.routes(space.remote)) == 2


CARRIED = STATUS._replace(name="/uav_1/fmu/out/vehicle_status_v4")
READ = COMMAND._replace(name="/uav_1/fmu/in/vehicle_command")
SPACE = "0/fmu/out/**"


def tokens_of(zid: str, node: str) -> list[str]:
    """Return the tokens of a node that carries a vehicle."""
    return [str(Token(0, zid, "MS", node, READ)), str(Token(0, zid, "MP", node, CARRIED))]


class Carrier:
    """A process of msggen that carries a vehicle with the key 7."""

    def __init__(self, space: Space, zid: str = ZID) -> None:
        self.space, self.zid = space, zid
        self.tokens = tokens_of(zid, "msggen_7")
        for text in self.tokens:
            space.vehicles.token(text, space.now, is_alive=True)

    def beat(self, time: int = 5) -> None:
        self.space.vehicles.beat(beat_of(self.zid, 0, "uav_1"), Attachment(1, time, GUID).pack(), self.space.now)

    def sample(self, sequence: int = 1, gid: bytes = b"") -> None:
        self.space.sample(CARRIED, guid=gid or gid_of(self.tokens[1]), sequence=sequence)


def test_a_carried_vehicle_has_its_key_and_names_with_versions(space: Space) -> None:
    Carrier(space)
    assert space.remote == Remote(1, "msggen_7", 7, "uav_1", continued=False)
    assert [event.route.name for event in space.all(Opened)] == [READ.name, CARRIED.name]


def test_of_a_carried_vehicle_only_what_is_followed_is_subscribed_to(space: Space) -> None:
    carrier = Carrier(space)
    beat = beat_of(ZID, 0, "uav_1")
    assert space.vehicles.wanted == {beat}
    status = space.all(Opened)[1].route
    space.vehicles.follow(space.remote, status, is_followed=True)
    assert space.vehicles.wanted == {beat, str(CARRIED)}
    carrier.sample(1)
    space.vehicles.follow(space.remote, status, is_followed=False)
    assert space.vehicles.wanted == {beat}
    space.vehicles.follow(space.remote, status, is_followed=True)
    carrier.sample(100)  # others have followed it meanwhile
    assert not space.all(Lost)
    space.vehicles.follow(space.remote, space.all(Opened)[0].route, is_followed=True)
    assert str(READ) not in space.vehicles.wanted
    space.token(STATUS)  # beside it, PX4's own module
    assert space.vehicles.wanted == {beat, str(CARRIED), SPACE}


def test_a_firmware_without_tokens_is_looked_for_only_where_no_vehicle_has_some(space: Space) -> None:
    assert space.vehicles.wanted == {EVERYTHING}
    space.token(STATUS)
    assert space.vehicles.wanted == {SPACE}
    space.token(STATUS, is_alive=False)
    assert space.vehicles.wanted == {EVERYTHING}


def test_a_node_that_listens_to_inputs_lets_nothing_more_cross(space: Space) -> None:
    Carrier(space)
    listener = str(Token(0, ZID, "MS", "rosbag", COMMAND))
    space.vehicles.token(listener, space.now, is_alive=True)
    assert space.vehicles.wanted == {beat_of(ZID, 0, "uav_1")}
    space.vehicles.token(listener, space.now, is_alive=False)
    assert space.vehicles.wanted == {beat_of(ZID, 0, "uav_1")}


def test_a_carried_vehicle_whose_beats_are_denied_is_a_warning_with_the_cure(space: Space) -> None:
    carrier = Carrier(space)
    space.now += CARRIED_STILL_NS
    space.vehicles.tick(space.now)
    assert not space.all(Warned)
    for _ in range(3):
        space.now += 1
        space.vehicles.tick(space.now)
    (warned,) = space.all(Warned)
    assert NO_BEAT in warned.text
    assert "allow the keys @msggen/** in the access control of the router" in warned.text
    other = Space()
    carrier = Carrier(other)
    carrier.beat()
    other.now += CARRIED_STILL_NS + 1
    other.vehicles.tick(other.now)
    assert not other.all(Warned)


def test_a_carried_vehicle_is_complete_when_its_beat_is_heard_and_no_token_follows(space: Space) -> None:
    carrier = Carrier(space)
    space.now += QUIET_NS + 1
    space.vehicles.tick(space.now)
    assert not space.all(Identified)
    carrier.beat()
    space.vehicles.tick(space.now)
    assert space.all(Identified) == [Identified(space.remote, {}, is_complete=True)]


def test_nothing_is_sent_to_a_carried_vehicle_without_a_beat(space: Space) -> None:
    carrier = Carrier(space)
    command = space.all(Opened)[0].route
    with pytest.raises(StaleError):
        space.vehicles.key_to(space.remote, command, space.now)
    carrier.beat()
    assert space.vehicles.key_to(space.remote, command, space.now) == str(READ)
    space.now += CARRIED_STILL_NS + 1
    with pytest.raises(StaleError):
        space.vehicles.key_to(space.remote, command, space.now)
    space.now += SILENCE_NS
    space.vehicles.tick(space.now)
    assert space.all(Disconnected)
    carrier.beat()
    assert len(space.all(Connected)) == 2


@pytest.mark.parametrize("told", [10**18, 2**63 - 1])
def test_a_beat_with_a_time_that_none_can_have_is_none(space: Space, told: int) -> None:
    carrier = Carrier(space)
    carrier.beat(told)
    vehicle = space.vehicles.carried(space.remote)
    assert vehicle is not None
    assert vehicle.clock is None
    assert space.vehicles.refused == {"beats that are not of the form": 1}


def test_a_forged_beat_counts_for_a_second_at_most(space: Space, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whether it is the first one or a later one, ahead or replayed."""
    own, theirs = 10**13, 7 * 10**13
    monkeypatch.setattr(age, "now", lambda: own)
    carrier = Carrier(space)
    carrier.beat(theirs + 10**17)
    for number in range(100):
        own, theirs = own + 10**8, theirs + 10**8
        carrier.beat(theirs)
        if number % 10 == 5:
            carrier.beat(theirs + number * 10**15)
            carrier.beat(theirs - 10**12)
        vehicle = space.vehicles.carried(space.remote)
        assert vehicle is not None
        assert vehicle.clock is not None
        assert number < 12 or vehicle.clock.of(own) == theirs


def test_samples_and_beats_of_others_are_not_those_of_a_carried_vehicle(space: Space) -> None:
    carrier = Carrier(space)
    carrier.sample(gid=OTHER)
    space.vehicles.beat(beat_of(ZID, 0, "uav_2"), Attachment(1, 5, GUID).pack(), space.now)
    space.vehicles.beat(beat_of(ZID, 0, "uav_1"), b"", space.now)
    assert not space.all(Sample)
    assert sum(space.vehicles.refused.values()) == 3
    carrier.sample()
    assert space.all(Sample)[0].route.name == CARRIED.name


def test_two_carriers_of_one_namespace_get_no_message_meant_for_the_other(space: Space) -> None:
    Carrier(space).beat()
    for text in tokens_of("0b" * 16, "msggen_8"):
        space.vehicles.token(text, space.now, is_alive=True)
    with pytest.raises(LinkError, match="2 vehicles read /uav_1/fmu/in/vehicle_command"):
        space.vehicles.key_to(space.remote, space.all(Opened)[0].route, space.now)


def test_nothing_is_sent_while_two_processes_carry_a_vehicle_of_one_name(space: Space) -> None:
    """PX4's defaults, no namespace and the key 1, are enough: both would do one command."""
    first = Carrier(space)
    first.beat()
    command = space.all(Opened)[0].route
    assert space.vehicles.key_to(space.remote, command, space.now) == str(READ)
    second = Carrier(space, "0b" * 16)
    for _ in range(2):
        first.beat()  # also before the first beat of the second one
        with pytest.raises(LinkError, match=r"two vehicles with the key 7 .*'uav_1'.* start -n uav_1`"):
            space.vehicles.key_to(space.remote, command, space.now)
        space.now += CARRIED_STILL_NS
        second.beat()
    space.now += CARRIED_STILL_NS + 1  # the first one hangs, or was killed
    second.beat()
    assert space.vehicles.key_to(space.remote, command, space.now) == str(READ)
    first.beat()
    with pytest.raises(LinkError, match="two vehicles"):
        space.vehicles.key_to(space.remote, command, space.now)
    for text in first.tokens:
        space.vehicles.token(text, space.now, is_alive=False)
    second.beat()
    assert space.vehicles.key_to(space.remote, command, space.now) == str(READ)


def test_nothing_is_sent_to_two_vehicles_of_one_guid(space: Space) -> None:
    for zid in (ZID, "0b" * 16):
        space.token(COMMAND, zid=zid)
        space.token(STATUS, zid=zid)
    command = space.all(Opened)[0].route
    assert space.vehicles.key_to(space.remote, command, space.now) == str(COMMAND)  # one has left its tokens behind
    for sequence in range(100, 110):
        space.sample(sequence=sequence)
        space.sample(sequence=sequence - 90)
    with pytest.raises(LinkError, match=rf"guid {GUID.hex()}.*PX4_UXRCE_DDS_NS"):
        space.vehicles.key_to(space.remote, command, space.now)


def test_twins_that_are_carried_are_named_with_their_cure(space: Space) -> None:
    carriers = Carrier(space), Carrier(space, "0b" * 16)
    for sequence in range(1, 11):
        carriers[0].sample(sequence + 100)
        carriers[1].sample(sequence)
    (warned,) = space.all(Warned)
    assert "the key 7" in warned.text
    assert "guid" not in warned.text
    assert "`uxrce_dds_client start -n uav_1`" in warned.text
