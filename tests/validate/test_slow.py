"""Kill, sabotage and a real browser: minutes, not seconds."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import dnacheck
from dnacheck.model.data_files import data_directory
from dnacheck.validate.scene import scenes_directory

pytestmark = pytest.mark.slow

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
TIMES = {"seconds"}


def validate(folder, *arguments, path=None, wait=True):
    environment = dict(os.environ)
    if path is not None:
        environment["PYTHONPATH"] = str(path)
    command = [sys.executable, "-m", "dnacheck", "validate", "-o", str(folder), *arguments]
    process = subprocess.Popen(
        command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    if not wait:
        return process
    output, _ = process.communicate(timeout=1200)
    return process.returncode, output


def numbers(folder):
    """Every check without its cost."""
    report = json.loads((folder / "report.json").read_text())
    return [{k: v for k, v in check.items() if k not in TIMES} for check in report["checks"]]


def test_killed_and_restarted_gives_the_same_numbers(tmp_path):
    arguments = ("quick", "--only", "table2", "--only", "wanted", "--threads", "1")
    # a copy, because results are shared only while no source file changes
    package = copy_of_package(tmp_path / "package")
    code, output = validate(tmp_path / "whole", *arguments, path=package)
    assert code == 0, output
    process = validate(tmp_path / "cut", *arguments, path=package, wait=False)
    state = tmp_path / "cut" / ".state"
    until = time.monotonic() + 600
    while not list(state.glob("*/*.json")) and time.monotonic() < until:
        time.sleep(0.01)
    os.kill(process.pid, signal.SIGKILL)
    process.communicate()
    kept = {path.stem for path in state.glob("*/*.json")}
    code, output = validate(tmp_path / "cut", *arguments, path=package)
    assert code == 0, output
    report = json.loads((tmp_path / "cut" / "report.json").read_text())
    assert kept <= set(report["provenance"]["resumed"])
    assert numbers(tmp_path / "cut") == numbers(tmp_path / "whole")


# What is broken, where, and the checks that must notice.
SABOTAGE = {
    "a sign": (
        "dnacheck/ring/closure_kernels.py",
        ("out[1, k] = a2 * x - a0 * z", "out[1, k] = a2 * x + a0 * z"),
        "discrete.derivatives",
        ("discrete.derivatives",),
    ),
    "a stiffness": (
        "dnacheck/model/chain.py",
        ("np.diag([float(twist_ratio), 1.0, 1.0])", "np.diag([float(twist_ratio), 1.02, 1.0])"),
        "table2",
        ("table2.discrete",),
    ),
    "a table entry": (
        "dnacheck/data/published/table1_unstressed_angles_deg.csv",
        None,
        "table2",
        ("table2.discrete",),
    ),
    "a filter weight": (
        "dnacheck/model/rod/filtering.py",
        (
            "return average + smooth(points - average, width)",
            "return average + 0.5 * smooth(points - average, width)",
        ),
        "table2",
        ("table2.continuum", "table2.gap"),
    ),
    "a closure tolerance": (
        "dnacheck/ring/discrete.py",
        ("tolerance: float = 1e-10", "tolerance: float = 1e-3"),
        "table2|wanted",
        ("table2", "wanted.energy"),
    ),
}


def copy_of_package(folder):
    source = Path(dnacheck.__file__).parent
    shutil.copytree(source, folder / "dnacheck", ignore=shutil.ignore_patterns("__pycache__"))
    for directory, name in ((data_directory(), "data"), (scenes_directory(), "scenes")):
        if not (folder / "dnacheck" / name).exists():
            shutil.copytree(directory, folder / "dnacheck" / name)
    return folder


def break_table(folder):
    path = folder / "dnacheck/data/angle_sets/trifonov.toml"
    text = path.read_text()
    at = text.index("theta", text.index("[steps.AA]"))
    end = text.index("\n", at)
    other = text.index("theta", text.index("[steps.TT]"))
    stop = text.index("\n", other)
    assert "-6.5" in text[at:end]
    assert "-6.5" in text[other:stop]
    spans = sorted([(at, end), (other, stop)], reverse=True)
    for first, last in spans:
        text = text[:first] + text[first:last].replace("-6.5", "-6.0") + text[last:]
    path.write_text(text)


@pytest.mark.parametrize("fault", SABOTAGE)
def test_sabotage_is_noticed_by_the_right_check(fault, tmp_path):
    file, change, groups, culprits = SABOTAGE[fault]
    package = copy_of_package(tmp_path / "package")
    if change is None:
        break_table(package)
    else:
        path = package / file
        text = path.read_text()
        assert change[0] in text, f"{file} has changed; mend this test"
        path.write_text(text.replace(*change))
    only = [word for group in groups.split("|") for word in ("--only", group)]
    code, output = validate(tmp_path / "out", "quick", *only, path=package)
    assert code == 1, output
    failed = {
        check["name"].partition("[")[0]
        for check in json.loads((tmp_path / "out" / "report.json").read_text())["checks"]
        if check["verdict"] == "fail"
    }
    assert any(name.startswith(culprits) for name in failed), (fault, failed, output)


@pytest.mark.skipif(CHROMIUM is None, reason="chromium is not installed")
@pytest.mark.parametrize("width", [390, 1280])
def test_report_in_a_browser(width, tmp_path):
    code, output = validate(tmp_path / "out", "quick")
    assert code == 0, output
    page = tmp_path / "out" / "report.html"
    assert page.stat().st_size < 8e6
    # the page tells about itself: how wide it is, and every error and request it saw
    probe = (
        "<script>window.problems=[];window.addEventListener('error',e=>problems.push(e.message));"
        "window.addEventListener('load',()=>setTimeout(()=>{const d=document.documentElement;"
        "const r=performance.getEntriesByType('resource').map(x=>x.name)"
        ".filter(x=>!x.startsWith('data:'));"
        "document.title=JSON.stringify({over:d.scrollWidth-d.clientWidth,problems,r})},1500))"
        "</script>"
    )
    # The frame gives the page its width: the window of a headless browser has a smallest one.
    probed = tmp_path / "probed.html"
    probed.write_text(page.read_text().replace("<head>", "<head>" + probe, 1))
    frame = tmp_path / "frame.html"
    frame.write_text(
        f"<iframe src='probed.html' style='width:{width}px;height:900px;border:0'></iframe>"
        "<script>setInterval(()=>{const f=document.querySelector('iframe').contentDocument;"
        "if(f&&f.title.startsWith('{'))document.body.dataset.seen=f.title},200)</script>"
    )
    command = [
        CHROMIUM, "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic",
        "--no-first-run", "--disable-background-networking", "--disable-component-update",
        "--disable-sync", "--allow-file-access-from-files", f"--user-data-dir={tmp_path / 'user'}",
        "--enable-logging=stderr", "--window-size=1400,1000", "--virtual-time-budget=10000",
        "--dump-dom", frame.as_uri(),
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert "data-seen" in done.stdout, done.stderr[-2000:]
    import html
    import re

    found = re.search(r'data-seen="([^"]*)"', done.stdout)
    assert found is not None
    seen = json.loads(html.unescape(found[1]))
    assert seen["over"] <= 0, seen
    assert seen["problems"] == []
    assert seen["r"] == []
    console = [line for line in done.stderr.splitlines() if "CONSOLE" in line]
    errors = [line for line in console if "error" in line.lower()]
    assert errors == []
