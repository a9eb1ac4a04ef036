"""What imports what, from the imports themselves: the picture and the table of ``architecture.md``.

A part is a folder of the package, or ``cli``; all other single files at the root are one part, ``root files``. Names
that ``snarelab/__init__.py`` hands on when they are asked for, and imports for types alone, are left out.
"""

import ast
from functools import cache, partial
from itertools import combinations, permutations
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
OUTSIDE = {"tests", "docs", "bench", "proof", "build", "setup.py", "__init__.py"}
BASE = "root files"

WIDTH, ROW, BOX, HIGH = 900, 92, 176, 44
COLUMNS, APART = range(150, 751, 50), 300
STYLE = 'text{font-family:system-ui,"Segoe UI",Roboto,Arial,sans-serif;font-size:14px;fill:#1c2329;text-anchor:middle}'
ARROW = (
    '<defs><marker id="a" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="6" markerHeight="6" orient="auto">'
    '<path d="M0 0L8 4L0 8z" fill="#7d8794"/></marker></defs>'
)


def _files() -> dict[str, Path]:
    """Each module's name below ``snarelab``, and its file."""
    found = {}
    for path in sorted(ROOT.rglob("*.py")):
        parts = path.relative_to(ROOT).with_suffix("").parts
        if path.relative_to(ROOT).parts[0] not in OUTSIDE and not parts[0].startswith("."):
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


@cache
def modules() -> dict[str, set[str]]:
    """Which modules each module imports, wherever in its file it does so, by name in a text too."""
    files = _files()
    return {name: _imported(name, path, set(files)) - {name} for name, path in files.items()}


def _imported(name: str, path: Path, known: set[str]) -> set[str]:
    package = name.split(".") if path.name == "__init__.py" else name.split(".")[:-1]
    tree = ast.parse(path.read_text(encoding="utf-8"))
    types_only = {
        inner
        for node in ast.walk(tree)
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
        for inner in ast.walk(node)
    }
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and f"{node.value}".startswith("snarelab."):
            found |= {f"{node.value}".removeprefix("snarelab.")} & known  # by name, when it is needed
        if not isinstance(node, ast.ImportFrom) or node in types_only:
            continue
        if node.level:
            above = package[: len(package) - node.level + 1]
        elif (node.module or "").split(".")[0] == "snarelab":
            above = []
        else:
            continue
        base = ".".join([*above, *(node.module or "").removeprefix("snarelab").strip(".").split(".")]).strip(".")
        for alias in node.names:
            found |= {f"{base}.{alias.name}".strip("."), base} & known
    return found


def part(module: str) -> str:
    """The part that a module belongs to."""
    first = module.split(".")[0]
    return first if first == "cli" or (ROOT / first).is_dir() else BASE


@cache
def arrows() -> set[tuple[str, str]]:
    """Every pair of parts of which the first imports the second."""
    return {(part(a), part(b)) for a, those in modules().items() for b in those if part(a) != part(b)}


def circles(pairs: set[tuple[str, str]]) -> set[frozenset[str]]:
    """Sets of names that import each other, straight or through others."""
    reach = _reach(pairs)
    return {frozenset({a, *(b for b in reach[a] if a in reach[b])}) for a in reach if a in reach[a]}


def _reach(pairs: set[tuple[str, str]]) -> dict[str, set[str]]:
    straight: dict[str, set[str]] = {name: set() for pair in pairs for name in pair}
    for a, b in pairs:
        straight[a].add(b)
    found = {}
    for name in straight:
        seen, left = set(), [name]
        while left:
            new = straight[left.pop()] - seen
            seen |= new
            left += new
        found[name] = seen
    return found


@cache
def rows() -> list[list[str]]:
    """Parts by height: each above all that it imports."""
    pairs = arrows()
    reach = _reach(pairs)
    height: dict[str, int] = {}
    for name in sorted(reach, key=lambda n: len(reach[n])):
        height[name] = 1 + max((height[b] for b in reach[name]), default=-1)
    return [sorted(n for n, h in height.items() if h == k) for k in range(max(height.values()) + 1)]


@cache
def drawn() -> list[tuple[str, str]]:
    """Arrows that no other way through the picture already tells."""
    pairs = arrows()
    reach = _reach(pairs)
    return sorted((a, b) for a, b in pairs if not any(x == a and b in reach[c] for x, c in pairs))


def picture() -> str:
    """The parts and the arrows between them as SVG."""
    levels, place = rows(), _places()
    tall = ROW * (len(levels) - 1) + HIGH + 20
    told = "; ".join(f"{a} imports {b}" for a, b in sorted(arrows()))
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {tall}" width="{WIDTH}" height="{tall}" '
        'role="img" aria-labelledby="title desc">',
        f'<title id="title">What imports what</title>\n<desc id="desc">{told}.</desc>',
        f"<style>{STYLE}</style>\n{ARROW}",
    ]
    for a, b in drawn():
        (x, y), (u, v) = place[a], place[b]
        way = f"M{x:g} {y + HIGH / 2:g}L{u:g} {v - HIGH / 2 - 2:g}"
        lines.append(f'<path d="{way}" stroke="#7d8794" stroke-width="2" fill="none" marker-end="url(#a)"/>')
    for name, (x, y) in sorted(place.items()):
        box = f'x="{x - BOX / 2:g}" y="{y - HIGH / 2:g}" width="{BOX}" height="{HIGH}" rx="8"'
        lines.append(f'<rect {box} fill="#eef2f6" stroke="#8b96a2" stroke-width="1.5"/>')
        lines.append(f'<text x="{x:g}" y="{y + 5:g}">{name}</text>')
    return "\n".join([*lines, "</svg>", ""])


def _places() -> dict[str, tuple[float, float]]:
    """Centre of each box: row by row from below, where the fewest arrows run behind a box and all are shortest."""
    levels = rows()
    found: dict[str, tuple[float, float]] = {}
    for level, row in enumerate(levels):
        y = ROW * (len(levels) - 1 - level) + 10 + HIGH / 2
        choices = (
            c for c in permutations(COLUMNS, len(row)) if all(abs(a - b) >= APART for a, b in combinations(c, 2))
        )
        found |= min(
            ({n: (float(x), y) for n, x in zip(row, c, strict=True)} for c in choices), key=partial(_cost, found)
        )
    return found


def _cost(below: dict[str, tuple[float, float]], here: dict[str, tuple[float, float]]) -> tuple[float, ...]:
    """Of places for a row: how many arrows run behind a box, their length across, and how far the row is off centre."""
    ways = [(here[a], below[b]) for a, b in drawn() if a in here]
    behind = sum(_crosses(way, box) for way in ways for box in below.values() if box != way[1])
    aside = sum(x for x, _ in here.values()) / len(here) - WIDTH / 2
    return behind, sum(abs(a[0] - b[0]) for a, b in ways), abs(aside)


def _crosses(way: tuple[tuple[float, float], tuple[float, float]], box: tuple[float, float]) -> bool:
    """Whether an arrow, from centre to centre, runs behind a box."""
    (x, y), (u, v) = way
    heights = [box[1] + k * HIGH / 2 for k in (-1, 0, 1)]
    return any(y < h < v and abs(x + (u - x) * (h - y) / (v - y) - box[0]) < BOX / 2 + 30 for h in heights)


def table() -> str:
    """Each part, what its docstring says it is, and all that it imports; the highest first."""
    text = "| part | what it is | imports |\n| --- | --- | --- |\n"
    pairs = arrows()
    for name in (n for row in reversed(rows()) for n in row):
        text += f"| `{name}` | {_said(name)} | {', '.join(f'`{b}`' for a, b in sorted(pairs) if a == name)} |\n"
    return text + "\n"


def _said(name: str) -> str:
    """First line of a part's docstring."""
    if name == BASE:
        return ", ".join(f"`{m}`" for m in _files() if part(m) == BASE)
    path = ROOT / name / "__init__.py" if (ROOT / name).is_dir() else ROOT / f"{name}.py"
    words = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
    return words.split("\n")[0].replace("``", "`").replace("|", r"\|").rstrip(".")
