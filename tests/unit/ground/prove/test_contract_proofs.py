"""Proofs of contracts: last links, times, deferrals, reactions and observability."""

import re
from pathlib import Path

import pytest

from reference.sources import findings, found, mission, policy, program, skill
from rtshcua.adapters.vehicle import manoeuvre
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.ground.language.load import load
from rtshcua.ground.pipeline.program import check_program
from rtshcua.ground.prove import observability
from rtshcua.ground.prove.observability import COMMAND_MESSAGES
from rtshcua.mavlink import dialect
from rtshcua.onboard.runtime.dispatcher import CONSERVATIVE_US
from virtual.rows import rows

LAND = {"motion": "land", "fallback": "", "class": "tactical"}


def codes(*parts: str) -> list[str]:
    return [code for code, _ in found(program(*parts))]


def test_proof_constants_match_those_of_the_adapters() -> None:
    assert observability.DECIDE_US == CONSERVATIVE_US
    assert observability.ACTUATE_US == manoeuvre.RETRY_US
    assert dialect.load().messages.keys() >= COMMAND_MESSAGES


# ---------------------------------------------------------------- E0618


@rows(
    ("parts", "expected"),
    [
        ({}, []),
        ({"energy": "at most 15 %"}, []),
        ({"energy": "at most 16 %"}, ["E0618"]),
        ({"maintain": "height < 100 m"}, ["E0618"]),
        ({"maintain": "local time in 08:00 .. 18:00"}, []),  # known without any signal
    ],
)
@rows("place", ["contingency", "fallback"])
def test_last_link_works_without_signals_and_with_only_the_reserve(
    parts: dict[str, str], expected: list[str], place: str
) -> None:
    down = skill("come_down()", **{**LAND, **parts})
    chain = "return_home, come_down"
    if place == "contingency":
        assert codes(down, policy(contingency=chain)) == expected
    else:
        assert codes(down, skill("probe()", fallback=chain), policy()) == expected


def test_last_link_of_two_chains_is_reported_once() -> None:
    down = skill("come_down()", **{**LAND, "energy": "at most 20 %"})
    assert codes(down, skill("probe()", fallback="come_down"), policy(contingency="come_down")) == ["E0618"]


@pytest.mark.parametrize(("seconds", "expected"), [(68, []), (67, ["E0618"])])
def test_last_link_must_descend_from_the_highest_step_in_time(seconds: int, expected: list[str]) -> None:
    """50 m at 1.5 m/s and 10 m at 0.5 m/s, plus the time to stop, accelerate and switch off."""
    down = skill("come_down()", **{**LAND, "lasts": f"at most {seconds} s"})
    flight = mission("takeoff(altitude = 40 m)", "goto(47.39799 N, 8.54559 E, 60 m)", "return_home()")
    assert codes(down, policy(contingency="return_home, come_down"), flight) == expected


@rows(
    ("size", "part", "help"),
    [
        ("", {"lasts": "at most 60 s"}, "raise its `lasts at most`, or fly lower"),
        ("longest: duration in 10 s .. 3 min = 60 s", {"lasts": "at most longest"},
         "write `sizes come_down(longest = 68 s)`, or fly lower"),
        ("most: ratio in 1 % .. 15 % = 1 %", {"lasts": "at most 3 min", "energy": "at most most"},
         "write `sizes come_down(most = "),
    ],
)  # fmt: skip
def test_last_link_that_cannot_descend_is_told_what_to_set(size: str, part: dict[str, str], help: str) -> None:
    down = skill(f"come_down() sizes ({size})" if size else "come_down()", **{**LAND, **part})
    flight = mission("takeoff(altitude = 40 m)", "goto(47.39799 N, 8.54559 E, 60 m)", "return_home()")
    helps = [
        each.help or ""
        for each in findings(program(down, policy(contingency="return_home, come_down"), flight))
        if each.code.id == "E0618"
    ]
    assert [told[: len(help)] for told in helps] == [help]


# ---------------------------------------------------------------- E0806, E0807


@rows(
    ("parts", "expected"),
    [
        ({"deadline": "30 s", "valid": "for 30 s", "lasts": "at most 30 s"}, []),
        ({"deadline": "30 s", "valid": "for 29 s", "lasts": "at most 20 s"}, ["E0806"]),
        ({"lasts": "at most 41 min"}, ["E0806"]),
        ({"grace": "1 min"}, []),
        ({"grace": "61 s"}, ["E0806"]),
        ({"lasts": "at most 500 ms"}, []),
        ({"lasts": "at most 400 ms"}, ["E0806"]),  # the default grace is 500 ms
        ({"lasts": "at most 400 ms", "grace": "400 ms"}, []),
        ({"deadline": "31 s"}, ["E0807"]),
        ({"deadline": "31 s", "class": "semantic"}, []),
        ({"deadline": "200 ms", "class": "reflex"}, []),
        ({"deadline": "201 ms", "class": "reflex"}, ["E0807"]),
        ({"deadline": "5 m"}, ["E0310"]),  # no time at all
    ],
)
def test_times_of_a_contract_must_be_consistent(parts: dict[str, str], expected: list[str]) -> None:
    assert codes(skill("probe()", **parts)) == expected


@pytest.mark.parametrize(("within", "expected"), [(40, []), (41, ["E0806"])])
def test_approval_timeout_longer_than_the_validity_is_refused(within: int, expected: list[str]) -> None:
    rule = f"confirm probe by role supervisor within {within} min"
    assert codes(skill("probe()"), policy(rule)) == expected


@pytest.mark.parametrize(
    ("block", "expected"),
    [
        ("deadline 2 s valid for 10 min lasts at most 1 min", []),
        ("valid for 30 s", ["E0806"]),  # shorter than the skill
        ("lasts at most 400 ms", ["E0806"]),
    ],
)
def test_step_with_its_own_times_is_proved_again(block: str, expected: list[str]) -> None:
    flight = mission("takeoff(altitude = 20 m)", f"probe() {{ {block} }}", "return_home()")
    assert [code for code in codes(skill("probe()"), policy(), flight) if code != "E0801"] == expected


# ---------------------------------------------------------------- E0808

SLOW = "signal slow : speed = WIND.speed stale after {}\n"


@rows(
    ("stale", "lasts", "expected"),
    [
        ("10 s", "2020 ms", []),  # 1 s to the next report, 20 ms, 1 s
        ("10 s", "2019 ms", ["E0808"]),
        ("2 s", "1520 ms", []),  # comes every 500 ms
        ("2 s", "1519 ms", ["E0808"]),
        ("28480 ms", "10 s", []),  # 500 ms of grace: noticed within 30 s
        ("28481 ms", "10 s", ["E0808"]),
        ("58480 ms", "1 min", []),
        ("58481 ms", "1 min", ["E0808"]),
    ],
)
def test_violation_and_signal_loss_must_be_noticed_while_the_skill_runs(
    stale: str, lasts: str, expected: list[str]
) -> None:
    probe = skill("probe()", assume="slow < 9 m/s", lasts=f"at most {lasts}")
    assert codes(SLOW.format(stale), probe, policy()) == expected


def test_require_clauses_are_not_monitored() -> None:
    assert codes(SLOW.format("10 min"), skill("probe()", require="slow < 9 m/s"), policy()) == []


# ---------------------------------------------------------------- E0717


@rows(
    ("parts", "expected"),
    [
        ({"deadline": "50 ms", "require": "wind.speed < 9 m/s"}, []),  # requested as often as needed
        ({"deadline": "49 ms", "require": "wind.speed < 9 m/s"}, ["E0717"]),  # no message is sent more often
        ({"deadline": "49 ms", "assume": "wind.speed < 9 m/s"}, ["E0717"]),
        ({"deadline": "50 ms", "require": "gps.fix >= fix_3d and landed == on_ground and battery > 20 %"}, []),
        ({"deadline": "1 s", "require": "heard > 20 %"}, []),  # a radio reports once a second
        ({"deadline": "999 ms", "require": "heard > 20 %"}, ["E0717"]),
        ({"deadline": "999 ms", "require": "mode == 4"}, ["E0717"]),  # PX4's heartbeat comes once a second
        ({"deadline": "49 ms", "require": "wind.speed < 9 m/s", "class": "reflex"}, []),  # does not wait
        ({"require": "told < 9 m/s"}, ["E0717"]),
        ({"assume": "told < 9 m/s"}, ["E1201"]),
        ({"require": "told < 9 m/s", "maintain": "told < 9 m/s"}, ["E1201"]),
    ],
)
def test_deferral_must_be_able_to_end_before_the_deadline(parts: dict[str, str], expected: list[str]) -> None:
    told = (
        "signal told : count = COMMAND_LONG.command stale after 2 s\n"
        "signal heard : ratio = RADIO_STATUS.txbuf stale after 5 s\n"
        "signal mode : count = HEARTBEAT.custom_mode stale after 5 s\n"
    )
    clauses = {key: value.replace("told < 9 m/s", "told < 9") for key, value in parts.items()}
    assert codes(told, skill("probe()", **clauses), policy()) == expected


def test_deferral_by_a_forbid_counts_only_for_its_skills() -> None:
    heard, quick = "signal heard : ratio = RADIO_STATUS.txbuf stale after 5 s\n", skill("quick()", deadline="900 ms")
    assert codes(heard, quick, policy("forbid quick by any when heard < 9 %")) == ["E0717"]
    assert codes(heard, quick, policy("forbid takeoff by any when heard < 9 %")) == []


def test_deferral_by_a_degrade_counts_for_the_skills_that_it_may_replace() -> None:
    heard, quick = "signal heard : ratio = RADIO_STATUS.txbuf stale after 5 s\n", skill("quick()", deadline="900 ms")
    assert codes(heard, quick, policy("degrade quick when heard < 9 % to return_home")) == ["E0717"]
    assert codes(heard, quick, policy("degrade takeoff when heard < 9 % to return_home")) == []


@rows(
    ("signal", "deadline", "cures"),
    [
        # the deadline, the signal; every advice of the help that does not apply is absent
        ("RADIO_STATUS.txbuf stale after 5 s", "100 ms", [
            ("1 s", "RADIO_STATUS.txbuf stale after 5 s"),
            ("100 ms", "BATTERY_STATUS.battery_remaining stale after 5 s"),
            ("100 ms", "RADIO_STATUS.txbuf every 100 ms stale after 5 s"),
        ]),
        ("SYS_STATUS.battery_remaining every 3 s stale after 7 s", "2999 ms", [
            ("3 s", "SYS_STATUS.battery_remaining every 3 s stale after 7 s"),
            ("2999 ms", "BATTERY_STATUS.battery_remaining stale after 5 s"),
        ]),
        ("SYS_STATUS.battery_remaining every 10 ms stale after 5 s", "49 ms", [
            ("50 ms", "SYS_STATUS.battery_remaining every 10 ms stale after 5 s"),
        ]),
    ],
)  # fmt: skip
def test_each_advice_about_a_late_signal_removes_the_finding(
    signal: str, deadline: str, cures: list[tuple[str, str]]
) -> None:
    def found_for(deadline: str, signal: str) -> list[Diagnostic]:
        probe = skill("probe()", deadline=deadline, require="told > 20 %")
        return findings(program(f"signal told : ratio = {signal}\n", probe, policy()))

    (late,) = found_for(deadline, signal)
    assert late.code.id == "E0717"
    assert late.help is not None
    assert f"set the deadline to {cures[0][0]} or more" in late.help
    assert ("from another message" in late.help) == (len(cures) > 1)
    assert ("`every`" in late.help) == (len(cures) > 2)
    for cure in cures:
        assert not found_for(*cure)


@rows(
    ("every", "stale", "expected"),
    [
        ("1 s", "1100 ms", []),  # a report a second, as old as the position before it
        ("1 s", "1099 ms", ["E1201"]),
        ("100 ms", "200 ms", []),
        ("100 ms", "199 ms", ["E1201"]),
        ("0 s", "5 s", ["E0319"]),
        ("100 m", "5 s", ["E0310"]),
    ],
)
def test_signal_that_declares_its_interval_must_arrive_before_it_is_stale(
    every: str, stale: str, expected: list[str]
) -> None:
    heard = f"signal heard : ratio = RADIO_STATUS.txbuf every {every} stale after {stale}\n"
    assert codes(heard, skill("probe()", assume="heard > 20 %"), policy()) == expected


CHECKOUT = Path(__file__).resolve().parents[4]


@rows(
    ("name", "rate", "deadline", "expected"),
    [
        # no clause reads them, but every step or every flight does
        ("position", "every 1 s stale after 2 s", "1 s", []),
        ("position", "every 1 s stale after 2 s", "999 ms", ["E0717"]),
        ("battery", "every 3 s stale after 5 s", "2999 ms", ["E0717"]),
        ("velocity.north", "every 1 s stale after 2 s", "100 ms", []),  # read in flight only
        ("velocity.north", "every 1 s stale after 999 ms", "1 s", ["E1201"]),
        ("height", "every 1 s stale after 999 ms", "1 s", ["E1201"]),
    ],
)
def test_signals_that_every_flight_reads_are_proved_without_a_clause(
    name: str, rate: str, deadline: str, expected: list[str], tmp_path: Path
) -> None:
    for file in ("signals.rts", "policy.rts"):
        text = (CHECKOUT / "evaluation" / file).read_text(encoding="utf-8").replace("lib:evaluation/", "")
        (tmp_path / file).write_text(re.sub(rf"(?m)^(signal {name} .*?)stale.*$", rf"\1{rate}", text))
    site = (tmp_path / "policy.rts").read_text()
    rules = "policy rules version 1 {\n  permit down by any\n  contingency down\n}\n"
    (tmp_path / "policy.rts").write_text(site[: site.index("policy evaluation")] + rules)
    (tmp_path / "skills.rts").write_text(skill("down()", motion="land", fallback="", deadline=deadline))
    flight = 'mission m under rules@1 on testbed {\n  intent "Land."\n  proposed by operator ada for role operator\n'
    (tmp_path / "m.rts").write_text(f'import "policy.rts"\n{flight}  phase land {{ down() }}\n}}\n')
    found_here = check_program(load([str(tmp_path / "m.rts")], lambda path: Path(path).read_bytes()), dialect.load())
    assert [each.code.id for each in found_here if each.code.id in ("E0717", "E1201")] == expected


def test_confirm_rule_for_a_reflex_is_refused() -> None:
    rule = policy("confirm probe by role supervisor within 30 s")
    assert codes(skill("probe()", **{"class": "reflex", "deadline": "100 ms"}), rule) == ["E0717"]
    assert codes(skill("probe()"), rule) == []


@pytest.mark.parametrize(("window", "expected"), [("5 s", []), ("6 s", ["E0717"]), ("5 min", ["E0717"])])
def test_window_longer_than_the_flight_before_the_step_is_refused(window: str, expected: list[str]) -> None:
    probe = skill("probe()", require=f"battery > 20 % and (height < 90 m for the last {window})", motion="land",
                  fallback="")  # fmt: skip
    assert codes(probe, policy(), mission("probe()")) == expected
    late = mission("takeoff(altitude = 20 m)", "hover()", "probe()")
    assert codes(probe, policy(), late) == (expected if window == "5 min" else [])


@pytest.mark.parametrize(
    ("to", "message"),
    [
        ("45 m", []),
        ("45001 mm", ["`rise` lasts at most 37.5 s, but the step takes up to 1 ms longer"]),
        ("45600 mm", ["`rise` lasts at most 37.5 s, but the step takes up to 400 ms longer"]),
        ("50 m", ["the step takes up to 41 s, but `rise` lasts at most 37.5 s"]),
    ],
)
def test_message_states_by_how_much_a_step_is_too_long(to: str, message: list[str]) -> None:
    """At 1.5 m/s, with 1.5 s of acceleration and 6 s from the command to lift-off."""
    rise = skill("rise(to: altitude in 5 m .. 60 m)", motion="climb to to", lasts="at most 37500 ms")
    said = found(program(rise, policy(), mission(f"rise({to})", "return_home()")))
    assert [words for code, words in said if code == "E0804"] == message


LONG = "battery > 20 % for the last {}"
RARE = "battery > 20 % within the last {}"


@rows(
    ("permits", "expected"),
    [
        ([LONG.format("1 ms")], ["E0717"]),  # no step waits for a permit, so the first is denied at once
        ([LONG.format("11 s")], ["E0717"]),
        ([LONG.format("6 min")], ["E0717"]),
        ([f"altitude < 30 m and ({LONG.format('6 min')} or {LONG.format('7 min')})"], ["E0717"]),
        ([f"{LONG.format('6 min')} or battery > 90 %"], []),
        ([RARE.format("6 min")], []),
        ([f"not ({RARE.format('6 min')})"], ["E0717"]),
        ([f"not ({LONG.format('6 min')} and {RARE.format('7 min')})"], []),
        ([LONG.format("6 min"), LONG.format("7 min")], ["E0717"]),
        ([LONG.format("6 min"), f"altitude < 10 m or {LONG.format('7 min')}"], ["E0717"]),
        ([LONG.format("6 min"), f"altitude < 30 m and {LONG.format('3 s')}"], ["E0717"]),
        ([LONG.format("6 min"), f"altitude < 30 m and {RARE.format('3 s')}"], []),
        ([LONG.format("6 min"), f"altitude < 10 m and {LONG.format('3 s')}"], ["E0717"]),  # not a permit of this step
    ],
)
def test_permit_that_cannot_be_known_at_the_release_is_refused(permits: list[str], expected: list[str]) -> None:
    rules = [f"permit takeoff by role operator through agent when {when}" for when in permits]
    lines = [*rules, "permit hover, return_home, emergency_land by any", "contingency return_home, emergency_land"]
    text = "policy rules version 1 {\n" + "\n".join(lines) + "\n}\n"
    found = findings(program(text, mission("takeoff(altitude = 20 m)", "return_home()")))
    about_steps = [each for each in found if each.code.id == "E0717"]
    assert [each.code.id for each in about_steps] == expected
    assert all(each.labels for each in about_steps)


@pytest.mark.parametrize(("window", "expected"), [("70 s", []), ("71 s", ["E0717"])])
def test_permit_of_a_later_step_may_observe_until_its_release(window: str, expected: list[str]) -> None:
    goto = f"permit goto by role operator through agent when {LONG.format(window)}"
    text = (
        "policy rules version 1 {\n  permit takeoff by role operator through agent\n"
        f"  {goto}\n  permit hover, return_home, emergency_land by any\n  contingency return_home, emergency_land\n}}\n"
    )
    flight = mission("takeoff(altitude = 20 m)", "goto(47.39774 N, 8.54569 E, 20 m)", "return_home()")
    assert [each.code.id for each in findings(program(text, flight))] == expected


# ---------------------------------------------------------------- E1201 to E1203


@pytest.mark.parametrize(
    ("source", "stale", "expected"),
    [
        ("WIND.speed", "150 ms", []),  # every 50 ms, but without a timestamp as old as the position before it
        ("WIND.speed", "149 ms", ["E1201"]),
        ("LOCAL_POSITION_NED.vx", "50 ms", []),  # it has a timestamp
        ("LOCAL_POSITION_NED.vx", "49 ms", ["E1201"]),
        ("GPS_RAW_INT.vel", "267 ms", []),  # its timestamp is that of the fix, five times a second
        ("GPS_RAW_INT.vel", "266 ms", ["E1201"]),
        ("COMMAND_LONG.param1", "1 ms", None),  # never sent, which has its own message
    ],
)
def test_signal_must_be_reported_before_it_is_stale(source: str, stale: str, expected: list[str] | None) -> None:
    kind, limit = ("count", "9") if expected is None else ("speed", "9 m/s")
    signal = f"signal here : {kind} = {source} stale after {stale}\n"
    if expected is None:
        assert codes(signal, skill("probe()", require=f"here < {limit}"), policy()) == ["E0717"]
        return
    for clause in ("assume", "maintain"):
        assert codes(signal, skill("probe()", **{clause: "here < 9 m/s"}), policy()) == expected
    assert codes(signal, skill("probe()"), policy("degrade any when here > 9 m/s to return_home")) == expected
    assert codes(signal, skill("probe()", require="here < 9 m/s"), policy()) == expected
    assert codes(signal, skill("probe()"), policy("forbid probe by any when here > 9 m/s")) == expected


@rows("stale", ["1 ms", "50 ms", "149 ms", "266 ms"])
@rows("source", ["WIND.speed", "LOCAL_POSITION_NED.vx", "GPS_RAW_INT.vel", "GPS_RAW_INT.vel every 700 ms"])
def test_advised_stale_time_removes_the_finding(stale: str, source: str) -> None:
    def found_for(stale: str) -> list[Diagnostic]:
        signal = f"signal here : speed = {source} stale after {stale}\n"
        return findings(program(signal, skill("probe()", assume="here < 9 m/s"), policy()))

    for finding in found_for(stale):
        assert finding.code.id == "E1201"
        assert finding.help is not None
        advised = finding.help.removeprefix("set `stale after` to ").removesuffix(" or more")
        assert not found_for(advised.strip("`")), advised


@pytest.mark.parametrize(("window", "expected"), [("1 s", []), ("999 ms", ["E1201"])])
@pytest.mark.parametrize("kind", ["for the last", "within the last"])
def test_window_shorter_than_the_report_interval_is_refused(window: str, kind: str, expected: list[str]) -> None:
    probe = skill("probe()", assume=f"wind.speed < 9 m/s {kind} {window}")
    assert codes(probe, policy()) == expected


@rows(
    ("clause", "expected"),
    [
        ("up <= 40 m", ["E1203"]),
        ("up <= 40 m or up >= 41 m", ["E1203"]),
        ("height <= up + 5 m", []),
        ("position inside meadow", []),
        ("local time in 08:00 .. 18:00", []),
        ("phase == departure", ["E1203"]),
    ],
)
def test_maintain_clause_that_cannot_change_is_reported(clause: str, expected: list[str]) -> None:
    parts = {"motion": "climb to up", "maintain": clause}
    assert codes(skill("probe(up: altitude in 5 m .. 50 m)", **parts), policy()) == expected


@rows(
    ("timing", "record", "expected"),
    [
        ("tactical", "decision, state, authorization", []),
        ("tactical", "intent, decision", ["E1202"]),
        ("tactical", "intent, decision, state, effect", ["E1202"]),
        ("semantic", "decision, state, authorization", []),
        ("semantic", "state, authorization", ["E1202"]),
        ("reflex", "decision, state, effect", []),
        ("reflex", "decision, state, authorization", ["E1202"]),
        ("tactical", "", []),
        ("tactical", "decisions", ["E0610"]),
        ("tactical", "synced_first", []),
        ("tactical", "written, decision", ["E1202"]),
        ("tactical", "written, synced, written", ["E1205"]),
        ("tactical", "synced, synced", []),
        ("tactical", "buffered", ["E1204"]),
        ("semantic", "buffered", ["E1204"]),
        ("reflex", "buffered", []),
        ("reflex", "buffered, written", ["E1205"]),
    ],
)
def test_record_must_suffice_to_derive_a_decision_again(timing: str, record: str, expected: list[str]) -> None:
    assert codes(skill("probe()", **{"class": timing, "deadline": "200 ms", "record": record})) == expected
