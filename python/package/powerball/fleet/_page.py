"""fleet.html: one page without anything from outside, the odd units first."""

from __future__ import annotations

import html
import statistics
from typing import Any, Dict, List, Optional, Sequence, Tuple

from .._result import paragraph, table
from ._fit import Fit, Json, friction_names, unit_of_number
from ._report import short, words
from ._run import Judged
from ._store import Row

_STYLE = """
:root{color-scheme:light dark;--paper:#fff;--ink:#1c1f23;--soft:#5b6570;--line:#dfe3e8;
--like:#0072b2;--odd:#d55e00}
@media (prefers-color-scheme:dark){:root{--paper:#15181c;--ink:#e6e9ec;--soft:#a0a9b2;--line:#31373e;
--like:#5cb3ea;--odd:#f0a04b}}
body{margin:0 auto;max-width:60rem;padding:1.5rem 1rem 4rem;background:var(--paper);color:var(--ink);
font:16px/1.5 system-ui,sans-serif;overflow-wrap:anywhere}
h1{font-size:1.7rem}h2{font-size:1.25rem;margin-top:2.2rem;border-bottom:1px solid var(--line)}
h3{font-size:1.05rem;margin-top:1.6rem}p{max-width:48rem}
table{border-collapse:collapse;font-size:.93rem;font-variant-numeric:tabular-nums}
th,td{padding:.25rem .8rem .25rem 0;text-align:left;border-bottom:1px solid var(--line);vertical-align:top}
th,figcaption,summary{color:var(--soft)}
figure{margin:1.2rem 0}svg{width:100%;height:auto;display:block}svg text{fill:var(--soft);font:12px system-ui}
.like{stroke:var(--like);fill:var(--like)}.odd{stroke:var(--odd);fill:var(--odd)}
.axis{stroke:var(--line)}.band{fill:var(--like);opacity:.12;stroke:none}
"""

#: The width and height of a figure, and the room left of it.
_WIDTH, _HEIGHT, _LEFT = 900, 170, 80


def page(report: Json, judged: Judged) -> str:
    """The page as HTML."""
    odd = [unit for unit in report["units"] if unit["differs"] or unit["changed"]]
    count = len(report["units"])
    body = [f"<h1>Fleet of {html.escape(report['arm'])}</h1>"]
    lead = f"{len(odd)} of {count} units are odd. {report['logs']} logs, {len(report['not_used'])} not used."
    body.append(paragraph(lead, strong=True))
    body.append(paragraph(report["guarantee"]))
    for unit in odd:
        body.append(_odd(unit, report, judged))
    body += ["<h2>All units</h2>", table(_UNITS, [_unit_row(unit) for unit in report["units"]])]
    body += _spread(report)
    if report["not_used"]:
        rows = [
            [log["unit"] or "", log["log"], log["verdict"], "; ".join(log["reasons"])]
            for log in report["not_used"]
        ]
        body += ["<h2>Logs that were not used</h2>", table(["unit", "log", "", "why"], rows)]
    title = html.escape(f"Fleet of {report['arm']}")
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width,initial-scale=1">'
        f"<title>{title}</title>\n<style>{_STYLE}</style></head>\n<body>\n"
        + "\n".join(body)
        + "\n</body></html>\n"
    )


_UNITS = ["unit", "logs", "from", "to", "type", "past", "p-value"]


def _unit_row(unit: Json) -> List[str]:
    against_type = "differs" if unit["differs"] else "alike" if unit["against_type"] else "not compared"
    since = [short(change["since"]["date"]) for change in unit["against_past"]]
    past = f"changed {', '.join(since)}" if since else "as it was"
    p = f"{unit['p_value']:.2g}" if unit["against_type"] else ""
    return [unit["unit"], str(unit["logs"]), short(unit["from"]), short(unit["to"]), against_type, past, p]


def _odd(unit: Json, report: Json, judged: Judged) -> str:
    """What is odd about a unit: sentences, numbers with intervals, and their course over time."""
    parts = [f"<h2>{html.escape(unit['unit'])}</h2>"]
    parts += [paragraph(f"Against {against}: {sentence}") for against, sentence in words(unit)]
    compared = [("before", "after", change["comparison"]) for change in unit["against_past"]]
    if unit["differs"]:
        compared.append(("its type", "this unit", unit["against_type"]))
    shown: Dict[str, None] = {}
    for a, b, comparison in compared:
        rows = _differing(comparison)
        if rows:
            parts.append(table(["number", a, b, "difference (interval)"], rows))
        shown.update(_numbers_of(comparison))
    rows_of_unit = [row for row in judged.rows if row["unit"] == unit["unit"] and row["verdict"] == "usable"]
    spread = {entry["number"]: entry for entry in report["spread"]}
    for name in list(shown)[:4]:
        parts.append(_course(name, rows_of_unit, spread.get(name), judged))
    return "\n".join(parts)


def _differing(comparison: Json) -> List[List[str]]:
    """Numbers that differ: both values, and the difference with the interval that holds for all at once."""
    rows = []
    for entry in comparison["parameters"]:
        if entry["differs"]:
            rows.append(
                [entry["name"], *_three(entry["a"], entry["b"], entry["difference"], entry["interval"])]
            )
    for entry in comparison["friction"]:
        if entry["differs"]:
            for k, v in enumerate(entry["velocities"]):
                name = f"friction of joint {entry['joint']} at {v:.3g} rad/s, N·m"
                three = _three(entry["a"][k], entry["b"][k], entry["difference"][k], entry["interval"][k])
                rows.append([name, *three])
    for entry in comparison["constants"]:
        if entry["differs"]:
            name = f"constant torque of joint {entry['joint']}, N·m"
            rows.append([name, *_three(entry["a"], entry["b"], entry["difference"], entry["interval"])])
    return rows


def _three(a: float, b: float, difference: float, interval: Sequence[float]) -> List[str]:
    low, high = interval
    return [f"{a:.4g}", f"{b:.4g}", f"{difference:+.4g} ({low:+.4g} to {high:+.4g})"]


def _numbers_of(comparison: Json) -> Dict[str, None]:
    """The names of the followed numbers that differ, the surest first."""
    found = [(entry["p_value"], entry["name"]) for entry in comparison["parameters"] if entry["differs"]]
    for entry in comparison["friction"]:
        if entry["differs"]:
            found += [(entry["p_value"], name) for name in friction_names(entry["joint"])]
    return {name: None for _, name in sorted(found)}


def _course(name: str, rows: Sequence[Row], spread: Optional[Json], judged: Judged) -> str:
    """A number of a unit over its logs, with 95 % intervals, and where units of its type are."""
    points = [(row["date"], Fit.of_row(row).numbers(judged.vary.speeds).get(name)) for row in rows]
    known = [(n.value, n.variance**0.5, "odd") for _, n in points if n]
    unit = unit_of_number(name)
    dates = f"{short(rows[0]['date'])} to {short(rows[-1]['date'])}"
    caption = f"{name}{', ' + unit if unit else ''}: log by log, {dates}, with 95 % intervals"
    return _dots(known, spread, caption)


def _spread(report: Json) -> List[str]:
    """Between units, number by number: the figures as a table, each with its picture."""
    if not report["spread"]:
        return []
    rows = []
    for entry in report["spread"]:
        low, high = entry["interval"]
        upper = "?" if high is None else f"{high:.3g}"
        rows.append(
            [
                entry["number"],
                entry["unit"],
                f"{entry['mean']:.4g}",
                f"{entry['between_units']:.3g} ({low:.3g} to {upper})",
                "" if entry["from_log_to_log"] is None else f"{entry['from_log_to_log']:.3g}",
            ]
        )
    parts = [
        "<h2>How units of this type differ</h2>",
        paragraph(
            "Standard deviations over and above the errors of the fits, of units that are like each other, "
            "with 95 % intervals (Paule and Mandel's estimate, Q profile). Parameters are in SI units."
        ),
        table(["number", "", "mean", "between units", "from log to log"], rows),
    ]
    units = sorted(report["units"], key=lambda unit: str(unit["unit"]))
    parts.append("<details><summary>Every number, unit by unit, by name</summary>")
    for entry in report["spread"]:
        name = entry["number"]
        known = [
            (unit["numbers"][name]["value"], unit["numbers"][name]["std"], _class(unit))
            for unit in units
            if name in unit["numbers"]
        ]
        unit = f", {entry['unit']}" if entry["unit"] else ""
        parts.append(
            _dots(known, entry, f"{name}{unit}: units in the order of their names, odd ones in orange")
        )
    return [*parts, "</details>"]


def _class(unit: Json) -> str:
    return "odd" if unit["differs"] or unit["changed"] else "like"


def _dots(points: Sequence[Tuple[float, float, str]], spread: Optional[Json], caption: str) -> str:
    """Values with 95 % intervals next to each other; a band of two deviations where units of the type are."""
    if not points:
        return ""
    # A value that is hardly determined would make the others one line: its bar goes out of the figure.
    most = 4 * statistics.median([std for _, std, _ in points] or [0.0])
    ends = [value + sign * 1.96 * min(std, most) for value, std, _ in points for sign in (-1, 1)]
    band = None
    if spread:
        band = [spread["mean"] + sign * 2 * spread["between_units"] for sign in (-1, 1)]
        ends += band
    low, high = min(ends), max(ends)
    room = 0.05 * (high - low) or 0.05 * abs(high) or 1.0
    low, high = low - room, high + room

    def y(value: float) -> str:
        return f"{_HEIGHT * (high - value) / (high - low):.1f}"

    step = (_WIDTH - _LEFT) / max(1, len(points))
    drawn: List[Any] = []
    if band:
        top, bottom = y(band[1]), y(band[0])
        height = max(1.0, float(bottom) - float(top))
        drawn.append(
            f'<rect class="band" x="{_LEFT}" y="{top}" width="{_WIDTH - _LEFT}" height="{height:.1f}"/>'
        )
    drawn.append(f'<path class="axis" d="M{_LEFT} 0V{_HEIGHT}"/>')
    for value in (low + room, high - room):
        drawn.append(f'<text x="{_LEFT - 6}" y="{y(value)}" text-anchor="end">{value:.4g}</text>')
    for k, (value, std, kind) in enumerate(points):
        x = f"{_LEFT + (k + 0.5) * step:.1f}"
        drawn.append(f'<path class="{kind}" d="M{x} {y(value - 1.96 * std)}V{y(value + 1.96 * std)}"/>')
        drawn.append(f'<circle class="{kind}" cx="{x}" cy="{y(value)}" r="3"/>')
    label = html.escape(caption)
    svg = (
        f'<svg viewBox="0 -8 {_WIDTH} {_HEIGHT + 16}" role="img" aria-label="{label}">{"".join(drawn)}</svg>'
    )
    return f"<figure>{svg}<figcaption>{label}</figcaption></figure>"
