"""Numbers as people read them: aligned text and Markdown, ``-`` where nothing is defined."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.evaluation.counts import Counts

COUNT_HEADER = ("TP", "FP", "FN", "P", "R", "F1")


def number(value: float | None, digits: int = 3) -> str:
    """A number of fixed digits."""
    return "-" if value is None else f"{value:.{digits}f}"


def percent(part: int, whole: int) -> str:
    """A share in per cent."""
    return f"{100 * part / whole:.1f} %" if whole else "-"


def count_row(name: str, counts: Counts) -> tuple[str, ...]:
    """Name, counts and ratios."""
    if not counts.occurs:
        return (name, "0", "0", "0", "-", "-", "-")
    ratios = (counts.precision, counts.recall, counts.f1)
    return (name, str(counts.tp), str(counts.fp), str(counts.fn), *map(number, ratios))


def aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Lines of columns: names to the left, numbers to the right."""
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    widths[0] = max(widths[0], 24)
    return [
        "  ".join(
            cell.ljust(width) if column == 0 else cell.rjust(max(width, 6))
            for column, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    ]


def markdown(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A Markdown table, numbers to the right."""
    lines = [header, ["---", *["---:"] * (len(header) - 1)], *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)
