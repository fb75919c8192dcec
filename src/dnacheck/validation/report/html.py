"""The HTML page: one file, nothing fetched, every text escaped."""

from __future__ import annotations

import base64
import gzip
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dnacheck.validation.engine.verdict import CheckResult, Verdict
from dnacheck.validation.report.figures import draw_svg
from dnacheck.validation.report.record import Block, Column, Figure, Note, Rings, Table
from dnacheck.validation.report.summary import glance
from dnacheck.validation.report.tables import cell_text, table_csv

if TYPE_CHECKING:
    from dnacheck.validation.report.write import RunRecord

TEMPLATES = Path(__file__).parent / "templates"


def report_html(record: RunRecord) -> tuple[str, dict[str, str]]:
    """The page, and its figures as SVG by name."""
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["cell"] = cell_text
    environment.filters["duration"] = duration
    environment.filters["science"] = science
    svgs: dict[str, str] = {}
    sections = record.sections()
    views: list[dict[str, Any]] = [
        {
            "section": section,
            "blocks": [_view(block, svgs) for block in section.blocks],
            "results": [r for r in record.results if r.name.partition(".")[0] == section.name],
        }
        for section in sections
    ]
    blocks: list[dict[str, Any]] = [view for item in views for view in item["blocks"]]
    uses_rings = any(view["kind"] == "rings" for view in blocks)
    page = environment.get_template("report.html.j2").render(
        record=record,
        verdict=record.verdict.value,
        counts=count(record.results),
        worst=[r for r in record.results if r.verdict in (Verdict.FAIL, Verdict.INCONCLUSIVE)],
        skipped=[r for r in record.results if r.verdict is Verdict.SKIPPED],
        summary=[view for view in blocks if view["summary"]],
        sections=views,
        glance=glance(sections, record.results),
        style=(TEMPLATES / "report.css").read_text(encoding="utf-8"),
        script=(TEMPLATES / "report.js").read_text(encoding="utf-8"),
        plotly=_plotly() if uses_rings else "",
    )
    return page, svgs


def _plotly() -> str:
    """The drawing library, compressed to a third; the page unpacks it when rings are looked at."""
    from plotly.offline import get_plotlyjs

    packed = gzip.compress(str(get_plotlyjs()).encode(), compresslevel=9, mtime=0)
    return base64.b64encode(packed).decode("ascii")


def count(results: Sequence[CheckResult]) -> dict[str, int]:
    """How many checks and controls ended how."""
    plain = [result.verdict for result in results if not result.control]
    controls = [result.verdict for result in results if result.control]
    return {
        "checks": len(plain),
        "passed": plain.count(Verdict.PASS),
        "failed": plain.count(Verdict.FAIL),
        "inconclusive": plain.count(Verdict.INCONCLUSIVE),
        "skipped": plain.count(Verdict.SKIPPED),
        "controls": len(controls),
        "refused": controls.count(Verdict.PASS),
    }


def science(text: str) -> Any:
    """Escaped text with indices such as K_θ set as subscripts."""
    import markupsafe

    escaped = str(markupsafe.escape(text))
    return markupsafe.Markup(
        re.sub(r"\b(K|E|m|w|d|n)_(disc|cont|[θφτ0-9])(?![A-Za-z0-9])", r"\1<sub>\2</sub>", escaped)
    )


def duration(seconds: float | None) -> str:
    """A time span in words of fitting size."""
    if seconds is None:
        return "–"
    if seconds < 1.0:
        return f"{1e3 * seconds:.0f} ms"
    if seconds < 120.0:
        return f"{seconds:.1f} s"
    return f"{int(seconds // 60)} min {int(seconds % 60)} s"


def _view(block: Block, svgs: dict[str, str]) -> dict[str, Any]:
    """A block with what the template needs of it."""
    view: dict[str, Any] = {"block": block, "summary": getattr(block, "summary", False)}
    if isinstance(block, Table):
        view |= {"kind": "table", "csv": data_uri("text/csv", table_csv(block))}
        view |= {"groups": _column_groups(block.columns), "numeric": _numeric(block)}
    elif isinstance(block, Figure):
        drawings = draw_svg(block)
        for number, svg in enumerate(drawings, start=1):
            svgs[f"{block.id}-{number}" if len(drawings) > 1 else block.id] = svg
        view |= {"kind": "figure", "images": [data_uri("image/svg+xml", svg) for svg in drawings]}
    elif isinstance(block, Rings):
        view |= {"kind": "rings", "data": list(block.rings)}
    elif isinstance(block, Note):
        view |= {"kind": "note"}
    return view


def _column_groups(columns: Sequence[Column]) -> list[tuple[str, int]]:
    """Headings over neighbouring columns and how many columns each spans; empty without any."""
    if not any(column.group for column in columns):
        return []
    groups: list[tuple[str, int]] = []
    for column in columns:
        if groups and groups[-1][0] == column.group:
            groups[-1] = (column.group, groups[-1][1] + 1)
        else:
            groups.append((column.group, 1))
    return groups


def _numeric(table: Table) -> list[bool]:
    """Which columns hold numbers, and are aligned to the right."""
    found = []
    for column in table.columns:
        values = [row.get(column.key) for row in table.rows]
        found.append(
            any(isinstance(value, int | float) for value in values)
            and not any(isinstance(value, str | bool) for value in values)
        )
    return found


def data_uri(kind: str, text: str) -> str:
    """The text as an address that holds it."""
    return f"data:{kind};base64,{base64.b64encode(text.encode()).decode()}"
