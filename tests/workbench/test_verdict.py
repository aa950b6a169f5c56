"""The verdict of a diagnosis, its sentence and its JSON, from steps made by hand: no fit is needed for what follows."""

from dataclasses import replace

import numpy as np
import pytest

from config.recording import Column, Recording
from tests.workbench.hand_made import AT_FLOOR, FLOOR_M, LIBRARY, errors_of, model_of
from tests.workbench.valves import SEED
from workbench.data.held_out import Split, split
from workbench.diagnosis.diagnosis import Diagnosis
from workbench.diagnosis.diagnosis_json import as_json
from workbench.diagnosis.doubt import Case
from workbench.diagnosis.error_before_fit import AsGiven
from workbench.diagnosis.extension import extension_of
from workbench.diagnosis.judged_landings import JudgedLandings
from workbench.diagnosis.verdict import verdict
from workbench.diagnosis.verdict_sentence import BREAKS_ELSEWHERE, REPEAT, rivals_sentence, verdict_sentence
from workbench.fit.fit_result import Term
from workbench.fit.parameter_estimate import Fitted
from workbench.model.simulation_regime import Motion, Sampling
from workbench.select.effect_candidates import EffectStep, EvaluatedModel, judged_step
from workbench.select.effect_search import model_after

POOR = model_of(cost=20.0 * AT_FLOOR, error_m=20.0 * FLOOR_M)
EXPLAINED = model_of(cost=1.2 * AT_FLOOR, error_m=1.2 * FLOOR_M)


@pytest.fixture(scope="module")
def parts() -> Split:
    """Swings over 60 mm, whose noise is the floor; no command repeats itself."""
    time_s: Column = np.asarray(0.01 * np.arange(1200), np.float64)
    position_m = 0.05 + 0.03 * np.sin(1.3 * time_s) + FLOOR_M * np.random.default_rng(1).standard_normal(1200)
    return split([Recording({"time_s": time_s, "command_pa": 8e5 * position_m, "position_m": position_m})])


def step(before: EvaluatedModel, number: int = 1, **models: EvaluatedModel) -> EffectStep:
    return judged_step(before, models, number, LIBRARY)


def diagnosed(parts: Split, *steps: EffectStep, given_m: float = FLOOR_M) -> Diagnosis:
    best = model_after(steps[-1])
    case = Case(
        verdict=verdict(best, steps, parts.motion_std_m, parts.floor_m),
        best=best,
        steps=steps,
        valve=best.fit.valve,
        library=LIBRARY,
        parts=parts,
        given=AsGiven(errors_of(given_m), FLOOR_M),
        workers=1,
        progress=lambda _what, _done: None,
    )
    return Diagnosis(
        steps=steps,
        verdict=case.verdict,
        base=steps[0].before,
        best=best,
        preview=(),
        experiment=None,
        split=parts,
        given=case.given,
        sentence=verdict_sentence(case),
    )


def test_what_is_bad_in_a_recording_is_said_once(parts: Split) -> None:
    """Of the fitted two thirds and of the whole it was said in two numbers, one beneath the other."""
    columns = dict(parts.test.recording.columns)
    columns["position_m"] = np.where(np.arange(1200) % 100 == 50, np.nan, columns["position_m"])
    halves = (
        Recording({name: each[rows] for name, each in columns.items()}) for rows in (slice(600), slice(500, None))
    )
    step_of = step(POOR, ip_lag=model_of("ip_lag"))
    for split_of, counts in ((split([Recording(columns)]), [12]), (split([next(halves)], next(halves)), [6, 7])):
        said = [each for each in diagnosed(split_of, step_of).blocks() if "position_m is not a number" in str(each)]
        assert said == [
            f"recording: position_m is not a number in {count} samples, the first 51: left out of the error"
            for count in counts
        ]


def test_what_explains_all_is_missing(parts: Split) -> None:
    found = diagnosed(parts, step(POOR, ip_lag=model_of("ip_lag"), sensor_lag=POOR))
    assert (found.verdict, found.missing, found.indistinguishable) == ("missing", ("ip_lag",), ())
    assert found.sentence == (
        "Missing: ip_lag; the held-out error falls from 1 to 0.05 mm, and nothing is left to explain."
    )


def test_two_that_explain_all_one_after_the_other_are_both_missing(parts: Split) -> None:
    half = model_of("ip_lag", cost=5.0 * AT_FLOOR, error_m=5.0 * FLOOR_M)
    found = diagnosed(parts, step(POOR, ip_lag=half), step(half, 2, backlash=model_of("ip_lag", "backlash")))
    assert (found.verdict, found.missing) == ("missing", ("ip_lag", "backlash"))
    assert found.sentence.startswith("Missing: ip_lag and backlash; the held-out error falls from 1 to 0.05 mm")


def test_what_another_does_as_well_is_one_of_them_and_what_would_tell_is_said(parts: Split) -> None:
    found = diagnosed(parts, step(POOR, dead_time=model_of("dead_time"), sensor_lag=model_of("sensor_lag")))
    assert found.verdict == "one_of"
    assert found.indistinguishable == (("dead_time", "sensor_lag"),)
    assert " To tell dead_time from sensor_lag, look at the shape of a slip: the dead time leaves it" in found.sentence


def test_of_what_no_record_tells_apart_it_is_said_so(parts: Split) -> None:
    found = diagnosed(parts, step(POOR, sensor_offset=model_of("sensor_offset"), preload=model_of("preload")))
    assert (found.verdict, found.missing) == ("one_of", ("preload",))
    assert " No record of pressure and position tells preload from sensor_offset." in found.sentence


def test_a_valve_that_explains_all_is_adequate(parts: Split) -> None:
    found = diagnosed(parts, step(EXPLAINED, ip_lag=EXPLAINED))
    assert (found.verdict, found.missing, found.suspected) == ("adequate", (), ())
    assert found.best is found.base
    assert " 0.06 mm" in found.sentence


def test_a_valve_whose_parameters_alone_were_off_is_said_to_be_off_and_is_refitted(parts: Split) -> None:
    found = diagnosed(parts, step(EXPLAINED, ip_lag=EXPLAINED), given_m=98.0 * FLOOR_M)
    assert (found.verdict, found.choices, found.sure) == ("adequate", ((),), True)
    assert found.parameters_off
    assert " from 4.9 to 0.06 mm" in found.sentence
    assert extension_of(found).stages == {
        "as given": (98.0 * FLOOR_M,) * 2,
        "refitted, nothing added": (1.2 * FLOOR_M,) * 2,
    }


def test_of_static_friction_at_its_least_a_slow_recording_says_that_it_may_be_more(parts: Split) -> None:
    """By the pressure at 1 s: 502 of 620 N, trusted, in a narrow interval."""
    least = Fitted(SEED.valve.coulomb_n, 1.0, SEED.valve.coulomb_n, SEED.valve.coulomb_n + 2.0, True, True)
    more = replace(least, value=1.2 * least.value, at_bound=False)
    said = []
    for static, motion in ((least, Motion.QUASI_STATIC), (more, Motion.QUASI_STATIC), (least, Motion.DYNAMIC)):
        found = replace(EXPLAINED.fit, parameters={"static_n": static}, by=Sampling(motion, ""))
        best = replace(EXPLAINED, fit=found)
        said.append("static_n came out at coulomb_n, the least" in diagnosed(parts, step(best, ip_lag=best)).sentence)
    assert said == [True, False, False]


def test_of_an_adequate_valve_what_is_suspected_is_said(parts: Split) -> None:
    suspect = model_of("spring_hardening", cost=0.8 * AT_FLOOR, error_m=1.199 * FLOOR_M)
    found = diagnosed(parts, step(EXPLAINED, spring_hardening=suspect))
    assert (found.verdict, found.missing, found.suspected) == ("adequate", (), ("spring_hardening",))
    (candidate,) = found.candidates
    said = f" Suspected, not proved: spring_hardening; of spring_hardening, {candidate.rejection_reason}. A longer"
    assert said in found.sentence
    assert candidate.gain is not None
    assert 0.0 < candidate.gain.held_out_evidence < 1.0


def test_of_what_is_left_unexplained_what_is_suspected_is_said(parts: Split) -> None:
    """At the floor, yet the residual hangs on the state."""
    before = model_of(cost=1.2 * AT_FLOOR, error_m=1.2 * FLOOR_M, structure=1.0, agreement=1)
    suspect = model_of("preload", cost=0.8 * AT_FLOOR, error_m=1.199 * FLOOR_M)
    found = diagnosed(parts, step(before, preload=suspect))
    assert (found.verdict, found.missing, found.suspected) == ("untrusted", (), ("preload",))


def test_what_is_suspected_is_nothing_that_the_library_does_not_have(parts: Split) -> None:
    """A play in a record of once a second was: the sentence said both."""
    before = model_of(cost=1.2 * AT_FLOOR, error_m=1.2 * FLOOR_M, structure=1.0)
    suspect = model_of("preload", cost=0.8 * AT_FLOOR, error_m=1.199 * FLOOR_M)
    found = diagnosed(parts, step(before, preload=suspect))
    assert (found.verdict, found.suspected) == ("unexplained", ("preload",))
    assert found.sentence.startswith("Something is missing that no effect here is proved to explain. The held-out ")


def test_of_what_is_left_beside_what_is_missing_what_is_suspected_is_no_explanation(parts: Split) -> None:
    found_first = model_of("sensor_lag", cost=1.4 * AT_FLOOR, error_m=1.4 * FLOOR_M)
    suspect = model_of("sensor_lag", "preload", cost=1.0 * AT_FLOOR, error_m=1.399 * FLOOR_M)
    found = diagnosed(parts, step(POOR, sensor_lag=found_first), step(found_first, 2, preload=suspect))
    assert (found.verdict, found.missing, found.suspected) == ("missing", ("sensor_lag",), ("preload",))
    assert " 1.4 times the floor " in found.sentence


def test_beside_rivals_what_is_suspected_is_said_too(parts: Split) -> None:
    found_first = model_of("preload", cost=1.4 * AT_FLOOR, error_m=1.4 * FLOOR_M)
    rival = model_of("sensor_offset", cost=1.4 * AT_FLOOR, error_m=1.4 * FLOOR_M)
    suspect = model_of("preload", "backlash", cost=1.0 * AT_FLOOR, error_m=1.399 * FLOOR_M)
    steps = step(POOR, preload=found_first, sensor_offset=rival), step(found_first, 2, backlash=suspect)
    found = diagnosed(parts, *steps)
    assert (found.verdict, found.suspected) == ("one_of", ("backlash",))


def test_a_parameter_that_was_kept_and_is_off_is_said(parts: Split) -> None:
    found = diagnosed(parts, step(EXPLAINED, sensor_gain=model_of("sensor_gain", cost=0.5 * AT_FLOOR, error_m=3e-5)))
    assert (found.verdict, found.missing) == ("adequate", ())
    assert all(each in found.sentence for each in ("sensor_gain", " from 0.06 to 0.03 mm", "mass_kg"))


def test_a_parameter_that_is_off_beside_what_is_missing_is_said(parts: Split) -> None:
    half = model_of("sensor_lag", cost=5.0 * AT_FLOOR, error_m=5.0 * FLOOR_M)
    named_otherwise = model_of("sensor_lag", "sensor_gain")
    found = diagnosed(parts, step(POOR, sensor_lag=half), step(half, 2, sensor_gain=named_otherwise))
    assert (found.verdict, found.missing) == ("missing", ("sensor_lag",))
    said = ("sensor_lag", " from 1 to 0.25 mm", "sensor_gain", " from 0.25 to 0.05 mm", "mass_kg")
    assert all(each in found.sentence for each in said)


def test_the_bare_valve_by_another_name_that_leaves_something_explains_nothing(parts: Split) -> None:
    part = model_of("sensor_gain", cost=5.0 * AT_FLOOR, error_m=5.0 * FLOOR_M)
    found = diagnosed(parts, step(POOR, sensor_gain=part))
    assert (found.verdict, found.missing) == ("unexplained", ())


def test_what_the_library_lacks_is_left_unexplained(parts: Split) -> None:
    found = diagnosed(parts, step(POOR, ip_lag=POOR))
    assert (found.verdict, found.missing) == ("unexplained", ())
    assert " 1 mm." in found.sentence
    assert REPEAT in found.sentence


def test_what_the_fitted_part_alone_speaks_for_may_be_what_is_missing(parts: Split) -> None:
    """A bowed sensor, with an evidence of 13, was no better held out; the library has it."""
    seeming = model_of("ip_lag", cost=0.95 * POOR.fit.cost, error_m=POOR.errors.test_rmse_m)
    found = diagnosed(parts, step(POOR, ip_lag=seeming))
    assert (found.verdict, found.missing) == ("unexplained", ())
    assert found.sentence.startswith("Something is missing that no effect here is proved to explain.")


def test_what_explains_a_part_is_named_though_something_is_left(parts: Split) -> None:
    part = model_of("ip_lag", cost=5.0 * AT_FLOOR, error_m=5.0 * FLOOR_M)
    found = diagnosed(parts, step(POOR, ip_lag=part), step(part, 2, backlash=part))
    assert (found.verdict, found.missing) == ("unexplained", ("ip_lag",))
    assert " ip_lag explains a part: the held-out error falls from 1 to 0.25 mm." in found.sentence
    both = model_of("ip_lag", "backlash", cost=2.0 * AT_FLOOR, error_m=2.5 * FLOOR_M)
    found = diagnosed(parts, step(POOR, ip_lag=part), step(part, 2, backlash=both), step(both, 3, stribeck=both))
    assert " ip_lag and backlash explain a part: the held-out error falls from 1 to 0.125 mm." in found.sentence


def test_a_residual_that_hangs_on_the_state_is_not_explained_by_reaching_the_floor(parts: Split) -> None:
    structured = model_of(structure=0.9)
    assert structured.at_floor
    assert diagnosed(parts, step(structured, ip_lag=structured)).verdict == "unexplained"


def test_a_valve_that_breaks_loose_at_other_loads_is_not_explained_by_where_it_lands(parts: Split) -> None:
    terms = replace(EXPLAINED.fit.terms, break_aways=Term(40.0, 9.0))
    elsewhere = replace(EXPLAINED, fit=replace(EXPLAINED.fit, terms=terms))
    found = diagnosed(parts, step(elsewhere, ip_lag=elsewhere))
    assert found.verdict == "unexplained"
    assert BREAKS_ELSEWHERE in found.sentence


def test_searches_that_disagree_and_explain_nothing_are_not_trusted(parts: Split) -> None:
    lone = model_of(cost=20.0 * AT_FLOOR, error_m=20.0 * FLOOR_M, agreement=1)
    assert not lone.fit.trusted
    found = diagnosed(parts, step(lone, ip_lag=lone))
    assert found.verdict == "untrusted"
    explained = replace(lone, fit=replace(lone.fit, terms=EXPLAINED.fit.terms), errors=EXPLAINED.errors)
    assert diagnosed(parts, step(explained, ip_lag=explained)).verdict == "adequate", "it explains all"


def test_a_valve_pushed_at_random_is_not_called_adequate(parts: Split) -> None:
    """It repeats itself to 6 mm, so that the bare valve is as good as any model: a quarter of the motion is left."""
    scatters = replace(parts, floor_m=6e-3)
    errors = model_of(error_m=6e-3).errors
    assert not errors.follows(parts.motion_std_m)
    as_good_as_any = EvaluatedModel(EXPLAINED.fit, errors, scatters.floor_m)
    assert as_good_as_any.explained
    found = diagnosed(scatters, step(as_good_as_any, stribeck=as_good_as_any))
    assert (found.verdict, found.missing) == ("unexplained", ())
    assert " 6 mm" in found.sentence


def test_a_model_that_leaves_a_tenth_of_the_motion_explains_nothing() -> None:
    steps = [step(EXPLAINED, ip_lag=EXPLAINED)]
    left_m = EXPLAINED.errors.test_block_m
    assert [verdict(EXPLAINED, steps, factor * left_m, FLOOR_M) for factor in (10.1, 9.9)] == [
        "adequate",
        "unexplained",
    ]


def test_an_adequate_valve_that_scatters_is_told_so_and_one_that_does_not_is_not(parts: Split) -> None:
    found = [diagnosed(replace(parts, floor_m=floor_m), step(EXPLAINED, ip_lag=EXPLAINED)) for floor_m in (1e-3, 1e-4)]
    assert [each.verdict for each in found] == ["adequate", "adequate"]
    assert ["scatters" in each.sentence for each in found] == [True, False]


def test_rivals_are_told_with_what_would_tell_them_apart() -> None:
    assert rivals_sentence(["ip_lag"], LIBRARY) == ""
    assert "measured actuator pressure" in rivals_sentence(["ip_lag", "sensor_lag"], LIBRARY)
    assert "No record of pressure and position tells" in rivals_sentence(["preload", "sensor_offset"], LIBRARY)
    assert rivals_sentence(["stribeck", "area_variation"], LIBRARY) == " Equally good: stribeck, area_variation."


def test_the_json_has_the_verdict_and_every_candidate(parts: Split) -> None:
    rivals = step(POOR, dead_time=model_of("dead_time"), sensor_lag=model_of("sensor_lag"), backlash=POOR)
    broken = judged_step(POOR, {"stribeck": "the recording holds too little"}, 1, LIBRARY)
    said = as_json(diagnosed(parts, rivals))
    assert (said["verdict"], said["missing"]) == ("one_of", ["dead_time"])
    assert said["indistinguishable"] == [["dead_time", "sensor_lag"]]
    assert said["suspected"] == []
    doubted = {"pressure_scale", "by_command", "kept_mass", "by_pressure", "stand_in", "moved"}
    assert {key: said[key] for key in doubted} == {**dict.fromkeys(doubted), "moved": []}, (
        "none, and every key is there"
    )
    assert said["best"]["test_rmse_m"] == FLOOR_M
    assert said["base"]["test_rmse_m"] == 20.0 * FLOOR_M
    assert {each["name"]: each["accepted"] for each in said["candidates"]} == {
        "dead_time": True,
        "sensor_lag": True,
        "backlash": False,
    }
    (unfitted,) = as_json(diagnosed(parts, broken))["candidates"]
    assert (unfitted["why_not"], unfitted["test_rmse_m"]) == ("the recording holds too little", None)


def test_landings_that_are_too_few_prove_nothing() -> None:
    """More than two fitted and one held out a parameter; else nothing is named, nothing missing, nothing adequate."""
    found, left = step(POOR, ip_lag=model_of("ip_lag")), step(POOR, ip_lag=POOR)
    few = [JudgedLandings(6, 9, 3), JudgedLandings(9, 3, 3), JudgedLandings(0, 0, 3)]
    for best, steps in (
        (EXPLAINED, [step(EXPLAINED, ip_lag=EXPLAINED)]),
        (model_of("ip_lag"), [found]),
        (POOR, [left]),
    ):
        assert {verdict(best, steps, 1.0, FLOOR_M, each) for each in few} == {"unjudged"}
    assert "6 landings fitted and 9 held out are too few for 3 parameters, more than 6 and 3" in few[0].sentence


def test_what_landings_leave_is_no_proof_that_something_is_missing() -> None:
    """What the pressure did between samples is not known; but what explains them all is there."""
    many = JudgedLandings(40, 20, 3)
    assert verdict(POOR, [step(POOR, ip_lag=POOR)], 1.0, FLOOR_M) == "unexplained"
    assert verdict(POOR, [step(POOR, ip_lag=POOR)], 1.0, FLOOR_M, many) == "unjudged"
    assert verdict(EXPLAINED, [step(EXPLAINED, ip_lag=EXPLAINED)], 1.0, FLOOR_M, many) == "adequate"
    assert verdict(model_of("ip_lag"), [step(POOR, ip_lag=model_of("ip_lag"))], 1.0, FLOOR_M, many) == "missing"


def test_of_a_command_that_may_have_changed_between_samples_nothing_left_is_proof() -> None:
    doubted = replace(POOR, fit=replace(POOR.fit, by=Sampling(Motion.QUASI_STATIC, "", sure=False)))
    assert verdict(doubted, [step(doubted, ip_lag=doubted)], 1.0, FLOOR_M) == "unjudged"
    held = replace(POOR, fit=replace(POOR.fit, by=Sampling(Motion.QUASI_STATIC, "")))
    assert verdict(held, [step(held, ip_lag=held)], 1.0, FLOOR_M) == "unexplained"
    found = replace(EXPLAINED, fit=replace(EXPLAINED.fit, by=doubted.fit.by))
    assert verdict(found, [step(found, ip_lag=found)], 1.0, FLOOR_M) == "adequate", "what explains it has told"
