"""Nothing in a diagnosis goes by what an effect, a family or a tree is called: each says itself what it is."""

import ast
from collections.abc import Iterator
from pathlib import Path

import snarelab
from snarelab.models.effects import effects

FOLDER = Path(snarelab.__file__).parent / "identification"
NAMES = {*effects(), *(e.family for e in effects().values())}


def texts(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Every text of a module that is not the family of an effect made there, with its line."""
    made = {id(n.value) for n in ast.walk(tree) if isinstance(n, ast.keyword) and n.arg == "family"}
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in made:
            yield node.lineno, node.value


def asked(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Every class that a module asks a value for by ``isinstance``, with its line."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "isinstance":
            for name in ast.walk(node.args[1]):
                if isinstance(name, ast.Name):
                    yield node.lineno, name.id


def test_no_code_goes_by_a_name_of_the_vocabulary():
    found = [
        f"{path.name}:{line} {text}"
        for path in FOLDER.rglob("*.py")
        for line, text in texts(ast.parse(path.read_text(encoding="utf-8")))
        if text in NAMES or text.partition(".")[0] in effects()
    ]
    assert not found


def test_no_code_asks_a_tree_what_it_is():
    found = [
        f"{path.name}:{line} {name}"
        for path in FOLDER.rglob("*.py")
        for line, name in asked(ast.parse(path.read_text(encoding="utf-8")))
        if name.endswith(("Tree", "Rig"))
    ]
    assert not found


def test_the_scan_sees_what_it_looks_for():
    code = ast.parse('if effect.name == "sensor_delay" and isinstance(tree, Rig | SnareTree): pass')
    assert [text for _, text in texts(code)] == ["sensor_delay"]
    assert {name for _, name in asked(code)} == {"Rig", "SnareTree"}
