"""What the nodes show: of now or nothing, and why."""

import math

import pytest

from config.codes import Ne107Status, Refusal
from config.registers import BY_NAME, REGISTERS
from northbound.observer import ValvePicture
from northbound.observer.freshness import Freshness
from northbound.opcua.valve_nodes import (
    ESTIMATES,
    HEALTH,
    NUMBERS,
    SETPOINT,
    SIGNAL,
    STATES,
    Shown,
    Why,
    show_picture,
    show_refusals,
)

VALUES = {each.name: 1.0 for each in REGISTERS} | {"position": 0.4, "reference": 0.5, "friction_baseline": math.nan}


NOW = Freshness()


def picture(freshness: Freshness = NOW, **values: float) -> ValvePicture:
    return ValvePicture("FV-101", 0.0, freshness, VALUES | values, 0, ())


def by_node(seen: ValvePicture) -> dict[str, Shown]:
    found = list(show_picture(seen)) + list(show_refusals(seen))
    nodes = {each.node: each for each in found}
    assert len(nodes) == len(found), "a node twice"
    return nodes


def test_positions_are_percent_and_health_is_dis() -> None:
    nodes = by_node(picture(ne107=float(Ne107Status.FAILURE)))
    assert nodes[SIGNAL].value == pytest.approx(40.0)
    assert nodes[SETPOINT].value == pytest.approx(50.0)
    assert nodes[HEALTH].value == 1


def test_what_nobody_knows_is_no_value() -> None:
    nodes = by_node(picture(k_over_c_valid=0.0, k_over_c_reason=float(Refusal.NOISE_DOMINATES)))
    assert nodes["Wear.FrictionBaseline"] == Shown("Wear.FrictionBaseline", None, Why.NOT_KNOWN)
    assert nodes["Estimates.KOverC"].why is Why.NOT_KNOWN
    assert nodes["Estimates.KOverC.StandardDeviation"].why is Why.NOT_KNOWN
    assert nodes["Estimates.KOverC.Refusal"].value == Refusal.NOISE_DOMINATES.text
    assert nodes["Estimates.BOverC"] == Shown("Estimates.BOverC", 1.0, Why.GOOD)


def test_an_old_measurement_takes_position_and_pressure_and_leaves_the_rest() -> None:
    nodes = by_node(picture(Freshness(measurement="the last good measurement is 9 s old")))
    gone = {name for name, each in nodes.items() if each.why is Why.NO_MEASUREMENT}
    assert gone == {SIGNAL, "SignalSet.Pressure.AnalogSignal"}
    assert nodes[SETPOINT].why is Why.GOOD


def test_without_the_daemon_nothing_old_is_passed_on() -> None:
    nodes = by_node(picture(Freshness("no connection for 3 s")))
    connection = nodes.pop("Status.Connection")
    assert connection.value == "no connection for 3 s"
    assert {(each.value, each.why) for each in nodes.values()} == {(None, Why.NO_DAEMON)}


def test_every_node_has_its_register() -> None:
    registers = [*STATES.values(), *(each for names in NUMBERS.values() for each in names.values())]
    assert not [name for name in registers if name not in BY_NAME]
    assert not [name for name in ESTIMATES if f"{name}_e" not in BY_NAME]
