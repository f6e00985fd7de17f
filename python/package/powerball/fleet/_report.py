"""What was judged as fleet.json, and in a few lines for a terminal."""

from __future__ import annotations

from typing import Any, Dict, Iterable, List, Optional, Tuple

from ._fit import Json, unit_of_number
from ._past import Past
from ._run import Judged, Work
from ._store import Row
from ._type import LEAST, surest

#: What `differs` and `changed` are worth.
GUARANTEE = (
    "Each unit is compared with its type at the level {level:g} divided by {units} units, over all of its "
    "numbers at once (Bonferroni): where all units are alike, no unit is called different in {sure:g} % of "
    "reports. Where nothing changes over time, a change is reported at most once in {quiet:,.0f} logs of the "
    "fleet on average."
)


def to_json(judged: Judged) -> Json:
    """fleet.json: the odd units first."""
    units = [_unit(judged, past) for past in judged.units]
    units.sort(key=lambda unit: (not unit["differs"], not unit["changed"], unit["p_value"], unit["unit"]))
    rows = judged.rows
    return {
        "arm": judged.whole.identified["arm"],
        "level": judged.level,
        "quiet_logs": judged.quiet,
        "guarantee": guarantee(judged),
        "logs": len(rows),
        "odd": [unit["unit"] for unit in units if unit["differs"] or unit["changed"]],
        "units": units,
        "spread": _spread(judged),
        "not_used": [
            {key: row[key] for key in ("unit", "date", "log", "verdict", "reasons")}
            for row in rows
            if row["verdict"] != "usable"
        ],
    }


def guarantee(judged: Judged) -> str:
    """What the judgement is worth, in words."""
    text = GUARANTEE.format(
        level=judged.level, units=len(judged.units), sure=100 * (1 - judged.level), quiet=judged.quiet
    )
    if not judged.typed.comparison:
        text += f" There are fewer than {LEAST} units: none was compared with its type."
    return text


def _unit(judged: Judged, past: Past) -> Json:
    own = [row for row in judged.rows if row["unit"] == past.unit and row["verdict"] == "usable"]
    comparison = judged.typed.comparison.get(past.unit)
    return {
        "unit": past.unit,
        "logs": len(own),
        "from": own[0]["date"],
        "to": own[-1]["date"],
        "differs": bool(comparison and comparison["differ"]),
        "changed": bool(past.changes),
        "p_value": surest(comparison),
        "logs_since_change": past.count,
        "against_type": comparison,
        "against_past": past.changes,
        "numbers": {
            name: {"value": n.value, "std": n.variance**0.5}
            for name, n in judged.vary.numbers(past.fit, past.count).items()
        },
    }


def _spread(judged: Judged) -> List[Json]:
    """By number: mean over units, and its standard deviation between units and from log to log."""
    found = []
    for name, spread in judged.typed.spread.items():
        of_logs = judged.vary.extra.get(name)
        found.append(
            {
                "number": name,
                "unit": unit_of_number(name),
                "mean": spread.mean,
                "mean_std": spread.mean_std,
                "between_units": spread.deviation,
                "interval": [end if end < 1e300 else None for end in spread.interval],
                "from_log_to_log": of_logs.variance**0.5 if of_logs else None,
            }
        )
    return found


def events(report: Json) -> List[Dict[str, Any]]:
    """One row for each change of a unit, as events.parquet has them."""
    return [
        {
            "unit": unit["unit"],
            "since": change["since"]["date"],
            "since_log": change["since"]["log"],
            "seen": change["seen"]["date"],
            "seen_log": change["seen"]["log"],
            "what": change["comparison"]["sentence"],
            "causes": [cause["cause"] for cause in change["comparison"]["causes"]],
        }
        for unit in report["units"]
        for change in unit["against_past"]
    ]


def words(unit: Json) -> List[Tuple[str, str]]:
    """What is odd about a unit: against what, and what ``compare`` says of it."""
    said = []
    for change in unit["against_past"]:
        said.append((f"its past, since {short(change['since']['date'])}", change["comparison"]["sentence"]))
    if unit["differs"]:
        said.append(("its type", unit["against_type"]["sentence"]))
    compared = [change["comparison"] for change in unit["against_past"]] + [unit["against_type"] or {}]
    for reason in dict.fromkeys(reason for one in compared for reason in one.get("unusable", [])):
        said.append(("its type and its past", f"do not use this: {reason}."))
    return said


def short(date: Optional[str]) -> str:
    """A date without its midnight."""
    return (date or "an unknown date").replace("T00:00:00", "").replace("T", " ")


def terminal(report: Json, work: Work, most: int = 20) -> str:
    """The odd units, and how many others there are."""
    lines = []
    odd = [unit for unit in report["units"] if unit["differs"] or unit["changed"]]
    width = max([len(unit["unit"]) for unit in odd[:most]] + [4])
    for unit in odd[:most]:
        for k, (against, sentence) in enumerate(words(unit)):
            name = unit["unit"] if k == 0 else ""
            lines.append(f"{name:<{width}}  against {against}: {sentence}")
    if len(odd) > most:
        lines.append(f"and {len(odd) - most} more: fleet.html has all")
    count, quiet = len(report["units"]), len(report["units"]) - len(odd)
    like = "like their type and their past" if report["units"][0]["against_type"] else "like their past"
    lines.append(f"{len(odd)} of {count} units are odd; {quiet} are {like}")
    lines.append(in_words(work))
    for log in report["not_used"][:most]:
        lines.append(f"not used: {log['log']}: {'; '.join(log['reasons'])}".replace("\n", "\n  "))
    if len(report["not_used"]) > most:
        lines.append(f"and {len(report['not_used']) - most} more logs that were not used")
    return "\n".join(lines)


def in_words(work: Work) -> str:
    """What a run did."""
    text = f"{work.found} logs: {work.known} were known, {len(work.outcomes)} are new"
    if work.outcomes:
        cost = sum(outcome.seconds for outcome in work.outcomes) / len(work.outcomes)
        read = sum(outcome.bytes for outcome in work.outcomes) / 1e6
        kept = sum(outcome.summary for outcome in work.outcomes) / 1e6
        text += f" in {work.seconds:.1f} s ({cost:.2f} s of a worker each"
        text += f"; {read:.1f} MB, {kept:.1f} MB of summaries)"
    return text


def not_used(rows: Iterable[Row]) -> List[Tuple[str, str]]:
    """Logs without a usable result, and why."""
    return [(row["log"], "; ".join(row["reasons"])) for row in rows if row["verdict"] != "usable"]
