"""The page: sections and pictures as one HTML file that needs nothing else."""

from collections.abc import Sequence
from html import escape
from pathlib import Path

from umbrae.bench.report.pictures import WRONGLY_DARK, WRONGLY_LIT, Pair
from umbrae.bench.report.plot import svg
from umbrae.bench.report.section import Grid, Section

TITLE = "Umbrae, measured"
_INTRODUCTION = (
    "Medians of several runs, contestants taking turns in one process. Machines differ: read ratios, not milliseconds. "
    "Figures of papers, in italics, are ratios on their own machines, unless they count bytes."
)


def page(sections: Sequence[Section], pairs: Sequence[Pair]) -> str:
    """All of it; no script but what moves the sliders, and nothing that is fetched."""
    names = [f"s{number}" for number in range(len(sections))]
    contents = "".join(
        f'<li><a href="#{name}">{escape(section.title)}</a></li>' for name, section in zip(names, sections, strict=True)
    )
    pictures = '<li><a href="#pictures">Pictures</a></li>' if pairs else ""
    body = [
        f"<h1>{TITLE}</h1><p class=note>{escape(_INTRODUCTION)}</p>",
        f"<nav aria-label=Contents><ul>{pictures}{contents}</ul></nav>",
        _pictures(pairs),
        *(_section(name, section) for name, section in zip(names, sections, strict=True)),
    ]
    style = (Path(__file__).parent / "style.css").read_text("utf-8")
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1"><link rel="icon" href="data:,">'
        f"<title>{TITLE}</title><style>\n{style}</style></head>\n<body>\n" + "\n".join(body) + "\n</body></html>\n"
    )


def _section(name: str, section: Section) -> str:
    parts = [f'<section><h2 id="{name}">{escape(section.title)}</h2>']
    parts.append(
        f"<p class=machine><code>umbrae bench {escape(section.benchmark)}</code> on {escape(section.machine)}</p>"
    )
    parts += [f"<p class=wrong>{escape(text)}</p>" for text in section.wrong]
    parts += [_table(grid) for grid in section.grids]
    parts += [svg(plot) for plot in section.plots]
    parts += [f"<p class=note>{escape(text)}</p>" for text in section.notes]
    return "\n".join([*parts, "</section>"])


def _table(grid: Grid) -> str:
    head = "".join(f"<th scope=col>{escape(cell)}</th>" for cell in grid.head)
    rows = []
    for number, row in enumerate(grid.rows):
        style = " class=dim" if number in grid.dim else ""
        cells = "".join(f"<td>{escape(cell)}</td>" for cell in row[1:])
        rows.append(f"<tr{style}><th scope=row>{escape(row[0])}</th>{cells}</tr>")
    caption = f"<caption>{escape(grid.caption)}</caption>"
    return (
        f'<div class=scroll tabindex=0 role=group aria-label="{escape(grid.caption)}"><table>{caption}'
        f"<thead><tr>{head}</tr></thead><tbody>{''.join(rows)}</tbody></table></div>"
    )


def _pictures(pairs: Sequence[Pair]) -> str:
    if not pairs:
        return ""
    parts = ['<section><h2 id="pictures">Pictures</h2>']
    for pair in pairs:
        parts.append(_missing(pair) if pair.pictures is None else _pair(pair, *pair.pictures))
    return "\n".join([*parts, "</section>"])


def _missing(pair: Pair) -> str:
    return f"<p class=note>{escape(pair.title)}, {escape(pair.left)}: no picture: {escape(pair.missing or '')}</p>"


def _pair(pair: Pair, left: str, right: str, difference: str) -> str:
    title, one, other = escape(pair.title), escape(pair.left), escape(pair.right)
    keys = "".join(
        f'<span class=key style="background:rgb{colour}"></span>{text}'
        for colour, text in ((WRONGLY_DARK, "wrongly dark"), (WRONGLY_LIT, "wrongly lit"))
    )
    return (
        f"<figure class=pair><figcaption>{title}: {one} (left) and {other} (right); left: {100 * pair.wrong:.2f} % "
        f'of the samples are wrong</figcaption><div class=both><img src="{left}" alt="{title}, {one}">'
        f'<img class=over src="{right}" alt="{title}, {other}"><span class=edge></span></div>'
        f'<input type=range min=0 max=100 value=50 step=0.5 aria-label="{title}: how much is {one}" '
        "oninput=\"this.parentNode.style.setProperty('--at',this.value+'%')\">"
        f"<div class=names><span>{one}</span><span>{other}</span></div></figure>"
        f'<figure class=pair><figcaption>Where {one} is wrong: {keys}</figcaption><img src="{difference}" '
        f'alt="Difference to the truth: {title}, {one}"></figure>'
    )
