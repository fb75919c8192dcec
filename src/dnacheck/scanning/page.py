"""One page about a finished scan: distribution, best and worst, failures, throughput."""

from __future__ import annotations

import heapq
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from dnacheck.io.files import atomic_write
from dnacheck.scanning.outputs import OK, Pieces

_SHOWN = 10
_BINS = 40
_QUANTILES = (0.01, 0.25, 0.5, 0.75, 0.99)
_FINE = 4096
_LOWEST, _HIGHEST = -20.0, 140.0
"""Range of -ln J that the fine histogram covers; quantiles are read from it."""

_TEMPLATE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>dnacheck scan: {{ title }}</title>
<style>
body { font: 16px/1.5 system-ui, sans-serif; max-width: 60rem; margin: 2rem auto; padding: 0 1rem;
  color: #1c2430; background: #fff; }
h1 { font-size: 1.5rem; } h2 { font-size: 1.15rem; margin-top: 2rem; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
td, th { padding: .2rem .8rem .2rem 0; text-align: left; border-bottom: 1px solid #dde2e8; }
td.n, th.n { text-align: right; }
svg { width: 100%; height: 14rem; } rect { fill: #2f6f9f; } text { font-size: 11px; fill: #445; }
.two { display: flex; gap: 3rem; flex-wrap: wrap; } p.quiet { color: #556; }
</style></head><body>
<h1>Rings of {{ title }}</h1>
<p>{{ "{:,}".format(rows) }} rows, {{ "{:,}".format(ok) }} with a value{% if skipped %};
{{ "{:,}".format(skipped) }} windows skipped for letters other than A, C, G, T{% endif %}.
{{ what }}</p>
<h2>How &minus;ln J is distributed</h2>
{% if ok %}
<svg viewBox="0 0 800 220" role="img" aria-label="histogram of minus ln J">
{% for bar in bars %}<rect x="{{ bar.x }}" y="{{ 190 - bar.height }}" width="{{ bar.width }}"
height="{{ bar.height }}"><title>{{ bar.label }}: {{ bar.count }}</title></rect>
{% endfor %}
{% for tick in ticks %}<text x="{{ tick.x }}" y="210">{{ tick.label }}</text>{% endfor %}
</svg>
<table><tr><th>quantile</th>{% for q, v in quantiles %}<td class="n">{{ q }}</td>{% endfor %}</tr>
<tr><th>&minus;ln(J / 1 M)</th>
{% for q, v in quantiles %}<td class="n">{{ v }}</td>{% endfor %}</tr>
</table>
<p class="quiet">Low &minus;ln J closes easily. One unit is a factor of 2.7 in J.</p>
<div class="two">
{% for name, list in (("Close most easily", best), ("Close hardest", worst)) %}
<div><h2>{{ name }}</h2><table>
<tr><th>where</th><th class="n">&minus;ln J</th>
<th class="n">energy, RT</th><th class="n">link</th></tr>
{% for row in list %}<tr><td>{{ row.where }}</td><td class="n">{{ "%.2f"|format(row.value) }}</td>
<td class="n">{{ "%.2f"|format(row.energy) }}</td><td class="n">{{ row.link }}</td></tr>{% endfor %}
</table></div>{% endfor %}
</div>
{% else %}<p>No row has a value.</p>{% endif %}
<h2>Rows without a value</h2>
{% if reasons %}<table>{% for reason, count in reasons %}<tr><td class="n">{{ count }}</td>
<td>{{ reason }}</td></tr>{% endfor %}</table>{% else %}<p>None.</p>{% endif %}
<h2>Settings and speed</h2>
<table>{% for key, value in settings %}<tr><td>{{ key }}</td><td>{{ value }}</td></tr>{% endfor %}
</table>
<p class="quiet">{{ speed }}</p>
</body></html>
"""


@dataclass
class Digest:
    """What the page needs of all rows, gathered piece by piece."""

    rows: int = 0
    ok: int = 0
    fine: Any = field(default_factory=lambda: np.zeros(_FINE, dtype=np.int64))
    best: list[tuple[float, int, dict[str, Any]]] = field(default_factory=list)
    worst: list[tuple[float, int, dict[str, Any]]] = field(default_factory=list)
    reasons: Counter[str] = field(default_factory=Counter)

    def add(self, columns: dict[str, Any]) -> None:
        """Take the rows of one piece."""
        value = columns["minus_lnJ"]
        good = np.flatnonzero(~np.isnan(value))
        statuses, counts = np.unique(columns["status"].astype(str), return_counts=True)
        self.reasons.update(
            {str(s): int(n) for s, n in zip(statuses, counts, strict=True) if s != OK}
        )
        self.fine += np.histogram(
            np.clip(value[good], _LOWEST, _HIGHEST), _FINE, (_LOWEST, _HIGHEST)
        )[0]
        order = good[np.argsort(value[good], kind="stable")]
        for place in order[:_SHOWN]:
            self._push(self.best, -float(value[place]), int(place), columns)
        for place in order[-_SHOWN:]:
            self._push(self.worst, float(value[place]), int(place), columns)
        self.rows += len(value)
        self.ok += len(good)

    def _push(self, heap: Any, key: float, place: int, columns: dict[str, Any]) -> None:
        if "record" in columns:
            where = f"{columns['record'][place]}:{columns['start'][place] + 1}-"
            where += f"{columns['end'][place]} {columns['strand'][place]}"
        else:
            where = str(columns["name"][place])
        row = {
            "where": where,
            "value": float(columns["minus_lnJ"][place]),
            "energy": float(columns["energy_RT"][place]),
            "link": int(columns["link"][place]),
        }
        heapq.heappush(heap, (key, -(self.rows + place), row))
        if len(heap) > _SHOWN:
            heapq.heappop(heap)

    def quantile(self, share: float) -> float:
        """-ln J below which a share of the rows lies, to 0.04."""
        total = np.cumsum(self.fine)
        k = int(np.searchsorted(total, share * total[-1]))
        return _LOWEST + (k + 0.5) * (_HIGHEST - _LOWEST) / _FINE


def write_page(
    path: Path,
    pieces: Pieces,
    title: str,
    settings: dict[str, Any],
    skipped: int,
    speed: str,
) -> None:
    """Write the page; every text of the user's is escaped."""
    import jinja2

    digest = Digest()
    for columns in pieces.tables():
        digest.add(columns)
    bars, ticks = _bars(digest)
    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined)
    ordered = [
        [row for _, _, row in sorted(heap, key=lambda entry: entry[:2], reverse=True)]
        for heap in (digest.best, digest.worst)
    ]
    page = environment.from_string(_TEMPLATE).render(
        title=title,
        rows=digest.rows,
        ok=digest.ok,
        skipped=skipped,
        what="J is of the closed ring, Laplace's, summed over minima and links.",
        bars=bars,
        ticks=ticks,
        quantiles=[(q, f"{digest.quantile(q):.2f}") for q in _QUANTILES] if digest.ok else [],
        best=ordered[0],
        worst=ordered[1],
        reasons=digest.reasons.most_common(20),
        settings=sorted((key, str(value)) for key, value in settings.items()),
        speed=speed,
    )
    atomic_write(path, page)


def _bars(digest: Digest) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    if not digest.ok:
        return [], []
    filled = np.flatnonzero(digest.fine)
    first, last = int(filled[0]), int(filled[-1]) + 1
    per_bin = max(1, -(-(last - first) // _BINS))
    counts = [int(digest.fine[k : k + per_bin].sum()) for k in range(first, last, per_bin)]
    width = 800.0 / len(counts)
    unit = (_HIGHEST - _LOWEST) / _FINE
    bars, ticks = [], []
    for k, count in enumerate(counts):
        low = _LOWEST + (first + k * per_bin) * unit
        height = 180.0 * count / max(counts)
        bars.append(
            {
                "x": f"{k * width:.2f}",
                "width": f"{0.92 * width:.2f}",
                "height": round(height, 2),
                "count": count,
                "label": f"{low:.2f} to {low + per_bin * unit:.2f}",
            }
        )
        if k % max(1, len(counts) // 8) == 0:
            ticks.append({"x": f"{k * width:.2f}", "label": f"{low:.1f}"})
    return bars, ticks
