"""Running, resuming, reporting."""

import base64
import csv
import gzip
import json
import re
from dataclasses import replace

import jsonschema
import pytest

from dnacheck.cli import main
from dnacheck.model.data_files import data_directory
from dnacheck.numerics.outcome import InputError
from dnacheck.validation.engine import run as harness
from dnacheck.validation.engine import worker
from dnacheck.validation.engine.baseline import compare, read_baseline
from dnacheck.validation.engine.context import Context, seed_of
from dnacheck.validation.engine.plan import Plan, Step, make_plan
from dnacheck.validation.engine.registry import (
    Check,
    Findings,
    Level,
    all_checks,
    find_check,
    select,
)
from dnacheck.validation.engine.runner import run_checks
from dnacheck.validation.engine.state import (
    StateFolder,
    findings_from_json,
    findings_to_json,
    run_key,
)
from dnacheck.validation.engine.verdict import Rule, Verdict, judge, must_fail
from dnacheck.validation.report.html import report_html
from dnacheck.validation.report.record import Column, Figure, Note, Rings, Table
from dnacheck.validation.report.tables import table_csv
from dnacheck.validation.report.write import RunRecord, report_json
from dnacheck.validation.scene.file import load_scene

NASTY = "<script>alert('x')</script>"


@pytest.fixture(scope="module")
def scene():
    return load_scene("quick")


def good(name="a.b[c]", got=1.0):
    return judge(name, "a quantity", got, 1.0, Rule.RELATIVE, "theory", "because", 1e-3)


def findings(results=None):
    table = Table("t", "T", [Column("x", "X", "Å", ".2f")], [{"x": 1.23456789012345}])
    return Findings(results or [good()], [table, Note("n", "words")])


def record_of(scene, found, provenance_seconds=1.0):
    check = Check("table2.discrete", "a check", lambda context: found, 1.0)
    from dnacheck.validation.engine.provenance import provenance

    return RunRecord(
        scene=scene,
        plan=Plan((Step(check, True, "asked for"),)),
        findings={check.name: found},
        skipped=[],
        provenance=provenance(scene, "default", 0, 1),
        seconds=provenance_seconds,
        finished="2000-01-01 00:00 UTC",
    )


def test_findings_survive_the_disk_to_the_last_digit():
    found = findings([good(got=1.0 / 3.0), must_fail(good(got=5.0), "it is wrong")])
    again = findings_from_json(findings_to_json(found))
    assert again.results == list(found.results)
    assert again.blocks[0].rows == list(found.blocks[0].rows)


def test_seeds_depend_on_the_name_and_the_run_only():
    assert seed_of("a", 0) == seed_of("a", 0)
    assert len({seed_of("a", 0), seed_of("b", 0), seed_of("a", 1)}) == 3


def test_an_exception_is_that_checks_failure(scene, monkeypatch):
    def broken(context):
        raise ZeroDivisionError("so it goes")

    monkeypatch.setattr(worker, "find_check", lambda name: Check(name, "t", broken, 1.0))
    found = worker.perform(worker.Job(scene, Level.QUICK, 0, "", ""), "x.y")
    assert [r.verdict for r in found.results] == [Verdict.FAIL]
    assert "so it goes" in found.results[0].reason
    assert found.results[0].seed == seed_of("x.y", 0)


def test_a_dead_process_fails_its_check_and_the_others_go_on(scene, tmp_path):
    job = worker.Job(scene, Level.QUICK, 0, str(tmp_path), "key")
    StateFolder(tmp_path, "key").open()
    unknown = Check("no.such_check", "dies in its process", lambda context: findings(), 9.0)
    seen = []
    done = run_checks(
        job,
        [unknown, find_check("continuum.equations")],
        1,
        lambda check, found, again: seen.append((check.name, again)),
    )
    assert done["no.such_check"].results[0].verdict is Verdict.FAIL
    assert "process ended" in done["no.such_check"].results[0].reason
    assert done["continuum.equations"].results[0].verdict is Verdict.PASS
    # a second run takes both from the state folder
    seen.clear()
    both = [unknown, find_check("continuum.equations")]
    again = run_checks(job, both, 2, lambda check, found, old: seen.append((check.name, old)))
    assert all(resumed for _, resumed in seen)
    assert again["continuum.equations"].results == done["continuum.equations"].results


def test_a_damaged_state_file_is_computed_again(tmp_path):
    state = StateFolder(tmp_path, "key")
    state.open()
    state.save("a", findings())
    assert state.load("a") is not None
    state.path("a").write_text('{"results": [')
    assert state.load("a") is None


def test_runs_share_results_only_with_the_same_scene_level_and_seed(scene, tmp_path):
    keys = {
        run_key(scene, Level.QUICK, 0),
        run_key(scene, Level.DEFAULT, 0),
        run_key(scene, Level.QUICK, 1),
        run_key(scene.model_copy(update={"title": "other"}), Level.QUICK, 0),
    }
    assert len(keys) == 4
    StateFolder(tmp_path, "old").open()
    StateFolder(tmp_path, "new").open()
    assert not (tmp_path / "old").exists()


def test_report_escapes_names_and_follows_its_schema(scene):
    table = Table("t", NASTY, [Column("x", NASTY)], [{"x": NASTY}], NASTY)
    found = Findings([replace(good(), name=f"table2.discrete[{NASTY}]", quantity=NASTY)], [table])
    record = record_of(scene.model_copy(update={"title": NASTY, "description": NASTY}), found)
    page, _ = report_html(record)
    assert NASTY not in page
    assert "&lt;script&gt;" in page
    assert "http://" not in page.replace("http://www.w3.org", "")
    schema = json.loads((data_directory() / "report.schema.json").read_text())
    jsonschema.validate(json.loads(report_json(record)), schema)


def test_numbers_that_are_not_finite_become_null(scene):
    record = record_of(scene, Findings([good(got=float("nan"))], []))
    text = report_json(record)
    assert json.loads(text)["checks"][0]["got"] is None
    assert json.loads(text)["verdict"] == "fail"


def test_csv_marks_formulas_as_text():
    table = Table("t", "T", [Column("x", "X")], [{"x": "=1+1"}, {"x": -1.5}])
    assert list(csv.reader(table_csv(table).splitlines()))[1:] == [["'=1+1"], ["-1.5"]]


def test_figures_are_drawn_the_same_twice(scene):
    rows = [{"n": n, "orthonormality": 1e-15, "plain": 1e-13, "position": 1e-14, "energy": 1e-12}
            for n in (10, 100)]  # fmt: skip
    figure = Figure("drift", "Drift", "drift", {"rows": rows})
    record = record_of(scene, Findings([good()], [figure]))
    (_, one), (_, two) = report_html(record), report_html(record)
    assert one == two
    assert one["drift"].startswith("<svg")


def test_the_drawing_library_travels_compressed(scene):
    points = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]
    ring = {"name": "x", "curves": [{"label": "x", "style": "line", "points": points}]}
    page, _ = report_html(record_of(scene, Findings([good()], [Rings("r", "R", [ring])])))
    packed = re.search(r'id="plotly-source">([^<]*)<', page)
    assert b"plotly" in gzip.decompress(base64.b64decode(packed[1]))[:200]
    assert len(page) < 3e6
    without, _ = report_html(record_of(scene, findings()))
    assert 'id="plotly-source"' not in without


def test_the_check_nearest_to_its_limit_is_shown(scene):
    from dnacheck.validation.report.record import Section
    from dnacheck.validation.report.summary import glance, share_used

    def judged(name, got, rule, tolerance=None, **more):
        return judge(f"table2.{name}", "q", got, 2.0, rule, "s", "w", tolerance, **more)

    assert share_used(judged("a", 2.1, Rule.RELATIVE, 0.1)) == pytest.approx(0.5)
    assert share_used(judged("a", 2.1, Rule.ABSOLUTE, 0.2)) == pytest.approx(0.5)
    assert share_used(judged("a", 1.0, Rule.AT_MOST)) == pytest.approx(0.5)
    assert share_used(judged("a", 4.0, Rule.AT_LEAST)) == pytest.approx(0.5)
    sigmas = judged("a", 3.0, Rule.SIGMAS, 4.0, got_sigma=0.3, expected_sigma=0.4)
    assert share_used(sigmas) == pytest.approx(0.5)
    assert share_used(judged("a", "2", Rule.EQUAL)) is None
    results = [
        judged("far", 2.01, Rule.RELATIVE, 0.1),
        judged("near", 2.19, Rule.RELATIVE, 0.1),
        must_fail(judged("control", 9.0, Rule.RELATIVE, 0.1), "it is wrong"),
    ]
    (line,) = glance([Section("table2", "Table II", "")], results)
    assert line.closest is results[1]
    assert (line.passed, line.checks, line.refused, line.controls) == (2, 2, 1, 1)
    assert line.verdict == "pass"
    page, _ = report_html(record_of(scene, Findings(results)))
    assert "table2.near" in page[: page.index('<section id="table2"')]


def test_baseline_tells_what_changed(scene, tmp_path):
    old = record_of(scene, Findings([good("a"), good("b"), good("c")], []))
    path = tmp_path / "old.json"
    path.write_text(report_json(old))
    new = [good("a"), good("b", 1.0001), good("c", 2.0), good("d")]
    changes = compare(read_baseline(path), new)
    assert [c["name"] for c in changes["changed_numbers"]] == ["b"]
    assert [c["name"] for c in changes["changed_verdicts"]] == ["c"]
    assert changes["added"] == ["d"]
    assert changes["removed"] == []
    page, _ = report_html(replace(old, baseline=changes))
    assert "Since the baseline" in page


@pytest.mark.parametrize("text", ["", "[]", '{"checks": 3}', '{"checks": [{"x": 1}]}'])
def test_a_baseline_that_is_no_report_is_refused(text, tmp_path):
    path = tmp_path / "old.json"
    path.write_text(text)
    with pytest.raises(InputError, match="baseline"):
        read_baseline(path)


def test_names_of_checks_are_unique_and_their_groups_exist():
    names = [check.name for check in all_checks()]
    assert len(set(names)) == len(names)


def test_only_selects_by_name_group_and_pattern():
    assert [c.name for c in select(["table2.discrete"])] == ["table2.discrete"]
    assert {c.group for c in select(["table2"])} == {"table2"}
    with pytest.raises(InputError, match=r"did you mean 'table2"):
        select(["tabel2"])


def test_missing_modules_are_skipped_with_the_reason(scene, monkeypatch):
    check = replace(find_check("table2.discrete"), requires=("dnacheck.nowhere.at_all",))
    monkeypatch.setattr("dnacheck.validation.engine.plan.all_checks", lambda: (check,))
    plan = make_plan(scene, Level.QUICK)
    assert [step.check.name for step in plan.skipped] == ["table2.discrete"]
    assert "not installed" in plan.skipped[0].reason


def test_list_shows_decisions(capsys):
    assert main(["validate", "--list", "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)["checks"]
    assert {"name", "title", "run", "reason"} <= set(listed[0])


def test_table_two_of_one_molecule_passes_and_its_controls_fail(scene):
    context = Context(scene, Level.QUICK, 0)
    for name in ("table2.discrete", "table2.continuum", "table2.gap", "table2.shape"):
        assert all(r.verdict is Verdict.PASS for r in find_check(name).run(context).results), name
    controls = find_check("table2.controls").run(context).results
    assert all(r.control and r.verdict is Verdict.PASS for r in controls)


def test_a_whole_run_writes_its_files(scene, tmp_path):
    options = harness.RunOptions(
        tmp_path / "out", Level.QUICK, processes=1, only=select(["continuum.equations"])
    )
    record = harness.run_scene(scene, options)
    assert record.verdict is Verdict.PASS
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert {"report.html", "report.json", "checks.csv"} <= names
    assert ".state" not in names
