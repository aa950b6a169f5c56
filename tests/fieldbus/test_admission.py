"""Who gets a place at a server, and how long a request waits: in given times, without a socket."""

from collections.abc import Mapping
from ipaddress import ip_network

import pytest

from config.daemon_file import DaemonFile
from config.errors import InputError
from config.loading import validate
from fieldbus.modbus.admission import (
    BURST_S,
    HANDSHAKES_PER_HOST,
    MOST_HANDSHAKES,
    NOT_ALLOWED,
    UNUSED_S,
    Allowance,
    Places,
    ServerLimits,
)

DCS, PLANT, STRANGER = "10.0.0.5", "10.0.0.7", "10.0.0.9"


def filled(limits: ServerLimits, hosts: list[str]) -> Places:
    """Return places taken a second apart, by `host:number`."""
    places = Places(limits)
    for number, host in enumerate(hosts):
        assert places.take(f"{host}:{number}", host, float(number)).refusal is None
    return places


def test_a_host_has_no_more_places_than_are_one_hosts() -> None:
    places = filled(ServerLimits(most_clients=8, clients_per_host=3), [STRANGER] * 3)
    refused = places.take(f"{STRANGER}:9", STRANGER, 30.0)
    assert refused.refusal == "3 clients of its host are connected already"
    assert places.take(f"{PLANT}:9", PLANT, 30.0).refusal is None
    places.leave(f"{STRANGER}:1")
    assert places.take(f"{STRANGER}:9", STRANGER, 30.0).refusal is None


def test_who_calls_from_elsewhere_than_allowed_gets_neither_a_place_nor_a_handshake() -> None:
    places = Places(ServerLimits(allowed_networks=(ip_network(f"{DCS}/32"), ip_network("fd00::/8"))))
    for host in (STRANGER, f"::ffff:{STRANGER}", "fe80::1%eth0"):
        assert places.take(f"{host}:1", host, 0.0).refusal == NOT_ALLOWED
        assert places.knock(f"{host}:1", host) == NOT_ALLOWED
    for host in (DCS, f"::ffff:{DCS}", "fd00::7"):
        assert places.knock(f"{host}:1", host) is None
        assert places.take(f"{host}:1", host, 0.0).refusal is None


def test_the_file_names_addresses_and_networks_and_nothing_else() -> None:
    table = {"valve": {"stroke_m": 0.1}, "supervisory": {"allowed_networks": ["10.0.0.5", "10.1.0.0/16"]}}
    allowed = validate(DaemonFile, table, "d.toml").supervisory.allowed_networks
    assert ServerLimits(allowed_networks=allowed).allow("10.1.2.3")
    assert not ServerLimits(allowed_networks=allowed).allow("10.0.0.6")
    with pytest.raises(InputError, match="allowed_networks"):
        validate(DaemonFile, table | {"supervisory": {"allowed_networks": ["dcs.plant"]}}, "d.toml")


def test_when_all_are_taken_the_one_unused_for_longest_gives_way_if_for_long_enough() -> None:
    places = filled(ServerLimits(most_clients=3), [PLANT, STRANGER, PLANT])
    places.use(f"{PLANT}:0", 3.0)
    assert places.take("x:1", "x", 0.5 + UNUSED_S).refusal == "3 clients are connected already"
    assert places.take("x:1", "x", 1.0 + UNUSED_S).gone == f"{STRANGER}:1"


def test_a_reserved_host_gets_a_place_of_the_others_however_busy_they_are() -> None:
    limits = ServerLimits(most_clients=3, reserved_hosts=frozenset((DCS,)))
    places = filled(limits, [DCS, STRANGER, STRANGER])
    for busy in (1, 2):
        places.use(f"{STRANGER}:{busy}", 10.0 + busy)
    assert places.take(f"{DCS}:7", DCS, 13.0).gone == f"{STRANGER}:1"
    assert places.take(f"{STRANGER}:8", STRANGER, 13.0).refusal == "3 clients are connected already"
    assert places.take(f"{DCS}:8", DCS, 13.0).gone == f"{STRANGER}:2"
    assert places.take(f"{DCS}:9", DCS, 13.0).refusal, "and of its own none"


def test_handshakes_take_nobodys_place() -> None:
    places = filled(ServerLimits(most_clients=2), [PLANT, PLANT])
    for number in range(HANDSHAKES_PER_HOST):
        assert places.knock(f"{STRANGER}:{number}", STRANGER) is None
    assert places.knock(f"{STRANGER}:99", STRANGER) is not None, "a host has only so many at once"
    assert places.knock(f"{DCS}:0", DCS) is None
    others = (f"h{number}" for number in range(MOST_HANDSHAKES))
    refused = [places.knock(f"{host}:0", host) for host in others]
    assert sum(each is not None for each in refused) == HANDSHAKES_PER_HOST + 1
    places.leave(f"{STRANGER}:0")
    assert places.knock(f"{STRANGER}:99", STRANGER) is None
    assert places.take(f"{PLANT}:0", PLANT, 0.0).refusal is not None, "and none gave way"


def test_requests_of_a_host_wait_once_its_burst_is_spent_and_no_others() -> None:
    places = filled(ServerLimits(requests_per_s=100.0), [STRANGER, STRANGER, PLANT])
    waits = [places.use(f"{STRANGER}:{number % 2}", 10.0) for number in range(120)]
    assert waits[:10] == [0.0] * 10
    assert waits[-1] == pytest.approx(110 / 50.0), "the other host has half"
    assert places.use(f"{PLANT}:2", 10.0) == 0.0
    assert places.use(f"{STRANGER}:0", 12.5) == 0.0, "after a while it may ask again"


def test_however_many_hosts_ask_without_end_they_share_what_one_may_and_a_reserved_one_has_its_own() -> None:
    strangers = [f"10.0.1.{number}" for number in range(20)]
    limits = ServerLimits(requests_per_s=100.0, reserved_hosts=frozenset((DCS,)))
    places = filled(limits, [*strangers, DCS])

    def answered_in_10_s(hosts: Mapping[int, str], from_s: float) -> int:
        count = 0
        for number, host in hosts.items():
            at_s = from_s
            while at_s < from_s + 10.0:
                at_s += places.use(f"{host}:{number}", at_s)
                count += 1
        return count

    assert answered_in_10_s(dict(enumerate(strangers)), 100.0) == pytest.approx(1000.0 + BURST_S * 100.0, rel=0.05)
    assert answered_in_10_s({len(strangers): DCS}, 100.0) == pytest.approx(1000.0 + BURST_S * 100.0, rel=0.05)
    for number, host in enumerate(strangers[1:], 1):
        places.leave(f"{host}:{number}")
    assert answered_in_10_s({0: strangers[0]}, 200.0) > 1000, "alone it has all of it"


def test_without_a_limit_nobody_waits() -> None:
    places = filled(ServerLimits(), [STRANGER])
    assert {places.use(f"{STRANGER}:0", 0.0) for _ in range(10_000)} == {0.0}


def test_a_clock_that_is_set_back_grants_nothing() -> None:
    allowance = Allowance(per_s=1.0, burst=2.0)
    assert [allowance.may(now_s) for now_s in (100.0, 50.0, 60.0, 100.5, 101.1)] == [True, True, False, False, True]
