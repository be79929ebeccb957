"""The page: sections and pictures as one HTML file that needs nothing else."""

from collections.abc import Sequence
from html import escape
from pathlib import Path

from umbrae.bench.report.merge import letter
from umbrae.bench.report.pictures import WRONGLY_DARK, WRONGLY_LIT, Pair
from umbrae.bench.report.plot import svg
from umbrae.bench.report.section import Grid, Section

TITLE = "Umbrae, measured"
_INTRODUCTION = (
    "Medians of several runs, contestants taking turns in one process. Machines differ: read ratios, not milliseconds. "
    "Figures of papers, in italics, are ratios on their own machines, unless they count bytes."
)
_POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'"
"""The browser itself refuses whatever the page would fetch."""
_MOVED = "this.closest('figure').style.setProperty('--at',this.value+'%')"


def page(sections: Sequence[Section], pairs: Sequence[Pair]) -> str:
    """All of it; no script but what moves the sliders, and nothing that is fetched."""
    titles = {"pictures": "Pictures"} if pairs else {}
    titles |= {f"s{number}": section.title for number, section in enumerate(sections, 1)}
    contents = "".join(f'<li><a href="#{name}">{escape(title)}</a></li>' for name, title in titles.items())
    body = [
        f"<header><h1>{TITLE}</h1><p class=note>{escape(_INTRODUCTION)}</p></header>",
        f"<nav aria-label=Contents><ul>{contents}</ul></nav>",
        "<main>",
        _pictures(pairs),
        *(_section(f"s{number}", section) for number, section in enumerate(sections, 1)),
        "</main>",
    ]
    style = (Path(__file__).parent / "style.css").read_text("utf-8")
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">'
        '<meta name="viewport" content="width=device-width, initial-scale=1"><link rel="icon" href="data:,">'
        f"<title>{TITLE}</title><style>\n{style}</style></head>\n<body>\n" + "\n".join(body) + "\n</body></html>\n"
    )


def _section(name: str, section: Section) -> str:
    parts = [f'<section aria-labelledby="{name}"><h2 id="{name}">{escape(section.title)}</h2>']
    command = f"<code>umbrae bench {escape(section.benchmark)}</code>"
    if len(section.machines) == 1:
        parts.append(f"<p class=machine>{command} on {escape(section.machines[0])}</p>")
    else:
        machines = "".join(
            f"<dt>{letter(number)}</dt><dd>{escape(machine)}</dd>" for number, machine in enumerate(section.machines)
        )
        parts.append(f"<p class=machine>{command} on</p><dl class=machines>{machines}</dl>")
    parts += [f"<p class=wrong>WRONG: {escape(text.removeprefix('WRONG: '))}</p>" for text in section.wrong]
    tables = "".join(_table(f"{name}t{number}", grid) for number, grid in enumerate(section.grids, 1))
    parts.append(f"<div class=tables>{tables}</div>")
    plots = "".join(svg(plot) for plot in section.plots)
    parts += [f"<div class=plots>{plots}</div>"] if plots else []
    parts += [f"<p class=note>{escape(text)}</p>" for text in (*section.notes, *section.missing)]
    return "\n".join([*parts, "</section>"])


def _table(name: str, grid: Grid) -> str:
    head = "".join(f"<th scope=col>{escape(cell)}</th>" for cell in grid.head)
    rows = []
    for number, row in enumerate(grid.rows):
        style = " class=dim" if number in grid.dim else ""
        cells = "".join(f"<td>{escape(cell)}</td>" for cell in row[1:])
        rows.append(f"<tr{style}><th scope=row>{escape(row[0])}</th>{cells}</tr>")
    # Not a caption, which would be as wide as the table, and scroll away with it.
    return (
        f'<div class=table><h3 id="{name}">{escape(grid.caption)}</h3>'
        f'<div class=scroll tabindex=0 role=region aria-labelledby="{name}"><table aria-labelledby="{name}">'
        f"<thead><tr>{head}</tr></thead><tbody>{''.join(rows)}</tbody></table></div></div>"
    )


def _pictures(pairs: Sequence[Pair]) -> str:
    if not pairs:
        return ""
    return "\n".join([
        '<section aria-labelledby="pictures"><h2 id="pictures">Pictures</h2>',
        "<p class=note>Made with this page, on the machine that made it. The slider moves the border between the two "
        "pictures; the pale picture shows in colour where the one on the left is wrong.</p>",
        *map(_pair, pairs),
        "</section>",
    ])  # fmt: skip


def _pair(pair: Pair) -> str:
    title, one, other = escape(pair.title), escape(pair.left), escape(pair.right)
    left, right, difference = pair.pictures
    keys = "".join(
        f'<span class=key><i style="background:rgb{colour}"></i>{text}: {100 * share:.3f} %</span>'
        for colour, text, share in (
            (WRONGLY_DARK, "wrongly dark", pair.wrong_dark),
            (WRONGLY_LIT, "wrongly lit", pair.wrong_lit),
        )
    )
    missing = f"<p class=note>{escape(pair.missing)}</p>" if pair.missing is not None else ""
    return (
        f"<h3>{title}: {one}</h3>{missing}<div class=pair><figure>"
        f'<div class=both><img src="{left}" alt="{title}, {one}">'
        f'<img class=over src="{right}" alt="{title}, {other}"><span class=edge></span></div>'
        f"<figcaption><label><span>{one}</span><span>{other}</span><input type=range min=0 max=100 value=50 step=0.5 "
        f'aria-label="{title}: share that shows {one}" oninput="{_MOVED}"></label></figcaption></figure>'
        f'<figure><img src="{difference}" alt="{title}: where {one} is wrong">'
        f"<figcaption>Wrong samples: {100 * (pair.wrong_dark + pair.wrong_lit):.3f} %{keys}</figcaption></figure></div>"
    )
