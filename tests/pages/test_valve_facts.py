"""What the operator's page says, without a browser: figures in a person's units, words, rights, passwords."""

import json
import math
import re
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from config.codes import Fault, Mode, Ne107Cause, Ne107Status, State
from config.daemon_file import DaemonFile
from config.errors import InputError
from config.law_names import law_names
from config.passwords import MOST_WRONG, SignIn
from config.registers import BY_NAME
from config.role_passwords import read_passwords, set_password
from config.roles import Role
from northbound.observer.freshness import Freshness
from northbound.observer.trends import thin_columns
from northbound.observer.valve_events import Happened
from northbound.observer.valve_view import ValvePicture
from northbound.observer.waiting_reference import Writer
from northbound.operator_page import valve_facts
from northbound.operator_page.moves_ahead import BY_LAW, NOBODY_KNOWS, UNKNOWN_FILE, Ahead
from webpage.units import LENGTHS, Units

STROKE_M = 0.1
VALUES = dict.fromkeys(BY_NAME, 0.0) | {
    "position_deg": math.nan,
    "mode": Mode.AUTOMATIC,
    "state": State.S1_UP,
    "position_m": 0.05,
    "pressure": 44126.0,
    "reference_in_force": 0.5,
}
PICTURE = ValvePicture("FV-101", 0.0, Freshness(), VALUES, 0, ())


def with_values(**values: float) -> ValvePicture:
    return replace(PICTURE, values=VALUES | values)


def test_figures_are_in_the_units_chosen() -> None:
    units = Units()
    assert valve_facts.figures(PICTURE, STROKE_M, units) == {
        "reference": "50.00 %",
        "position": "50.00 %",
        "pressure": "0.441 bar",
        "command": "0.000 bar",
    }
    units.position = "in"
    units.choose_pressure("psi")
    told = valve_facts.figures(PICTURE, STROKE_M, units)
    assert (told["position"], told["pressure"]) == ("1.969 in", "6.40 psi")


def test_nothing_is_not_below_nothing() -> None:
    told = valve_facts.figures(with_values(position_m=-3e-6, pressure=-20.0, command=-60.0), STROKE_M, Units())
    assert (told["position"], told["pressure"], told["command"]) == ("0.00 %", "0.000 bar", "-0.001 bar")


def test_when_something_has_happened_is_told_with_its_zone(monkeypatch: pytest.MonkeyPatch) -> None:
    """The page may be read in another zone than the gateway's, and `positioner events` says UTC."""
    monkeypatch.setenv("TZ", "XYZ-3")
    time.tzset()
    try:
        (line,) = valve_facts.list_events([Happened(0.0, "the daemon started")])
    finally:
        monkeypatch.undo()
        time.tzset()
    assert line == "1970-01-01 03:00:00 XYZ the daemon started"


def test_of_a_valve_whose_stroke_nobody_said_positions_are_lengths() -> None:
    assert Units().position_unit(math.nan) == LENGTHS["mm"]


def test_an_old_measurement_is_no_figure_while_what_is_commanded_is() -> None:
    old = replace(PICTURE, freshness=Freshness(measurement="the last good measurement is 3.0 s old"))
    told = valve_facts.figures(old, STROKE_M, Units())
    assert (told["position"], told["pressure"], told["reference"]) == ("– %", "– bar", "50.00 %")
    assert "the last good measurement is 3.0 s old" in [each.text for each in valve_facts.status(old)]


@pytest.mark.parametrize(("code", "lines"), [(0, []), (math.nan, []), (0x2310, ["0x2310: current"])])
def test_an_emergency_has_a_line_where_there_is_one(code: float, lines: list[str]) -> None:
    """A Modbus device had a line of CANopen."""
    told = valve_facts.status(with_values(emergency=code))
    assert [each.text for each in told if "CANopen" in each.label] == lines


def test_ne107_has_a_letter_its_words_and_the_deciding_cause_first() -> None:
    causes = (Ne107Cause.NOT_AUTOMATIC, Ne107Cause.FRICTION_HIGH)
    bits = sum(1 << (cause - 1) for cause in causes)
    seen = with_values(ne107=Ne107Status.MAINTENANCE_REQUIRED, ne107_cause=Ne107Cause.FRICTION_HIGH, ne107_causes=bits)
    assert valve_facts.condition(seen) == (
        "M",
        "M maintenance",
        ["friction high: packing tight", "not automatic"],
    )
    assert valve_facts.condition(PICTURE) == ("", "good", [])
    assert valve_facts.condition(replace(PICTURE, values={}))[:2] == ("?", "unknown")


def test_a_fault_that_is_not_known_counts_as_one() -> None:
    assert not valve_facts.is_faulty(PICTURE)
    assert valve_facts.is_faulty(with_values(fault=Fault.STALE))
    assert valve_facts.is_faulty(replace(PICTURE, values={}))


def test_nothing_is_left_out_where_nothing_is_known() -> None:
    known, unknown = PICTURE, replace(PICTURE, values={})
    for said in (valve_facts.status, valve_facts.cycle, lambda picture: valve_facts.wear(picture, Units())):
        assert [each.label for each in said(known)] == [each.label for each in said(unknown)]
    assert "–" in valve_facts.wear(unknown, Units())[0].text


def test_estimates_begin_with_pressures_and_end_with_what_is_refused_each_reason_once() -> None:
    seen = with_values(
        a_e=-100.0, a_std=1.0, a_valid=1.0,
        b_over_c_e=-814542.6, b_over_c_std=1000.0, b_over_c_valid=1.0,
        b_reason=11.0, c_reason=11.0, k_reason=3.0,
    )  # fmt: skip
    told = valve_facts.estimates(seen, STROKE_M, Units())
    assert [(each.label, each.text) for each in told[:2]] == [
        ("b_over_c", "-0.8145 ± 0.002 bar over the stroke"),
        ("a", "-100 ± 2 1/s"),
    ]
    refused = {each.label: each.text for each in told[2:]}
    assert refused["refused: b, c"] == "a came out positive: viscous friction would drive the stem"
    assert len(set(refused.values())) == len(refused)


def ahead(*, law: str = "seed", file: bool = True, **values: float) -> Ahead:
    """What is known of a valve at 20 %, 0.1 m of stroke, for whom a reference of 70 % waits."""
    tables = {"valve": {"stroke_m": STROKE_M}, "control": {"law": law}}
    settings = DaemonFile.model_validate(tables) if file else None
    asked = {"mode": Mode.HOLD, "position": 0.2, "reference": 0.7, "reference_in_force": 0.2, "omega": 1.0}
    asked["reference_opening"] = 0.7
    asked |= {"beta": 13238.0, "b_over_c_applied": math.nan, "command": 24000.0}
    writer = Writer("10.0.0.7:4001", "", "", 0.0)
    return Ahead(with_values(**(asked | values)), STROKE_M, Units(), settings, writer)


def figures(line: str) -> list[str]:
    """Return the numbers of a sentence, with their units."""
    return re.findall(r"[+±]?\d[\d.]* ?(?:%|mm|bar|s\b)", line)


def test_before_automatic_it_is_said_how_far_by_what_and_who_wrote_the_reference() -> None:
    stands, way, how, _ = ahead().automatic()
    assert figures(stands) == ["20.00 %", "70.00 %"]
    assert "10.0.0.7:4001, 1970-01-01" in stands
    assert figures(way) == ["+50.0%", "50.00 mm"]
    assert BY_LAW["seed"] in how
    unknown = replace(ahead(file=False), writer=None)
    assert NOBODY_KNOWS in unknown.automatic()[0]
    assert UNKNOWN_FILE in unknown.automatic()[2]
    (nothing,) = ahead(reference_opening=0.2).automatic()
    assert figures(nothing) == ["20.00 %"]


def test_every_law_of_ours_says_how_it_moves() -> None:
    assert set(BY_LAW) == set(law_names())


def test_before_an_identification_it_is_said_how_far_and_how_long() -> None:
    swings, far, long, _ = ahead().identification()
    assert [figures(each) for each in (swings, far, long)] == [["±0.132 bar", "6.28 s"], [], ["10 s"]]
    within = ahead(b_over_c_applied=-8e5, offset_applied=0.0).identification()[1]
    assert figures(within) == ["±16.5%", "16.55 mm", "20.00 %"]
    about = ahead(b_over_c_applied=-8e5, offset_applied=0.0, alpha=44e3).identification()[1]
    assert figures(about) == ["20.00 %", "38.45 %", "71.55 %"]
    window, _, limit, _ = ahead(law="slides").identification()
    assert [figures(window), figures(limit)] == [["20.00 %", "10.00 %", "90.00 %"], ["600 s"]]


def test_before_manual_it_is_said_where_the_pressure_takes_the_stem() -> None:
    commanded, far = ahead(b_over_c_applied=-8e5, offset_applied=0.0).manual(40e3)
    assert [figures(each) for each in (commanded, far)] == [["0.240 bar", "0.400 bar"], ["50.00 %"]]
    assert not figures(ahead().manual(40e3)[1])


def test_a_reference_that_waits_is_shown_and_one_that_is_followed_is_not() -> None:
    waiting = ahead().picture
    assert valve_facts.waiting(waiting, STROKE_M, Units()) == "waits: 70.00 %, followed in automatic"
    followed = replace(waiting, values={**waiting.values, "mode": Mode.AUTOMATIC})
    assert valve_facts.waiting(followed, STROKE_M, Units()) == ""


def test_a_window_keeps_its_extremes_and_its_gaps() -> None:
    time_s = np.arange(0.0, 600.0, 0.05)
    position_m = np.full(time_s.size, 0.05)
    position_m[7777], position_m[3333], position_m[5000:5003] = 0.09, 0.01, np.nan
    kept = thin_columns({"time_s": time_s, "position_m": position_m}, 1.5)
    assert len(kept["time_s"]) <= 3 * 400
    assert (np.nanmax(kept["position_m"]), np.nanmin(kept["position_m"])) == (0.09, 0.01)
    assert np.isnan(kept["position_m"]).any()
    assert (np.diff(kept["time_s"]) > 0).all()
    assert len(thin_columns({"time_s": time_s[:0], "position_m": position_m[:0]}, 1.5)["time_s"]) == 0


def test_a_role_ends_by_itself() -> None:
    from northbound.operator_page.signed_in import SIGNED_IN_S, SignedIn  # the page's library, with it

    signed = SignedIn()
    assert signed.at(0.0) is Role.OBSERVER
    signed.begin(Role.ENGINEER, 10.0)
    assert signed.at(10.0 + SIGNED_IN_S - 1) is Role.ENGINEER
    assert signed.at(10.0 + SIGNED_IN_S) is Role.OBSERVER
    assert signed.at(11.0) is Role.OBSERVER, "it does not come back"


def test_passwords_are_kept_as_scrypt_leaves_them_and_for_their_role_alone(tmp_path: Path) -> None:
    file = tmp_path / "roles.json"
    set_password(file, "operator", "first-password")
    set_password(file, "engineer", "other-password")
    set_password(file, "operator", "valves-and-more")
    assert "valves" not in file.read_text()
    assert file.stat().st_mode & 0o077 == 0
    now_s = 0.0
    sign_in = SignIn(read_passwords(file), clock=lambda: now_s)
    assert sign_in.refused("operator", "valves-and-more") == ""
    assert sign_in.refused("engineer", "other-password") == ""
    assert sign_in.refused("observer", "valves-and-more") == "wrong password"
    for _ in range(MOST_WRONG - 1):
        assert sign_in.refused("engineer", "valves-and-more") == "wrong password"
    assert sign_in.refused("engineer", "other-password").startswith("too many wrong passwords")


def test_passwords_that_are_too_short_or_none_are_refused_by_name(tmp_path: Path) -> None:
    file = tmp_path / "roles.json"
    with pytest.raises(InputError, match="must have 8 characters at least, got 5"):
        set_password(file, "operator", "short")
    assert not file.exists()
    for text, said in (
        ("{", "is no file of passwords"),
        ("[]", "is no file of passwords"),
        (json.dumps({"operator": {"salt": "00"}}), "is no file of passwords"),
        (
            json.dumps({"admin": {"salt": "00", "digest": "00"}}),
            "role: allowed are observer, operator, .*got admin",
        ),
    ):
        file.write_text(text)
        with pytest.raises(InputError, match=said):
            read_passwords(file)
    with pytest.raises(InputError, match="cannot be read"):
        read_passwords(tmp_path / "nowhere.json")
